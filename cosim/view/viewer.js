// Shows the content of this page: nodes with shapes that move over frames, and curves over the same
// time. The content's numbers are literals, or [channel] for what changes; see page.py.
"use strict";
const content = JSON.parse(document.getElementById("content").textContent);
const bytes = Uint8Array.from(atob(content.samples), (c) => c.charCodeAt(0));
const samples = new Float32Array(bytes.buffer);
const times = content.times, frames = times.length, end = times[frames - 1], begin = times[0];
const ACCENT = "#2f6fb3", MEASURED = "#e8710a";
const MEASURED_RGB = [0.91, 0.44, 0.04], RED = [0.85, 0.2, 0.15], GREEN = [0.2, 0.62, 0.25], BLUE = [0.16, 0.35, 0.85];
const $ = (id) => document.getElementById(id);

// -- time -------------------------------------------------------------------------------------------

// Frame before a time, and the part of the way to the next one.
function at(time) {
  let low = 0, high = frames - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  if (frames === 1) return [0, 0];
  const part = (time - times[low]) / (times[low + 1] - times[low]);
  return [low, Math.min(Math.max(part, 0), 1)];
}
const sample = (channel, [i, f]) => {
  const a = samples[channel * frames + i];
  return f ? a + f * (samples[channel * frames + i + 1] - a) : a;
};
const value = (item, when) => (typeof item === "number" ? item : sample(item[0], when));

// -- matrices, by columns -----------------------------------------------------------------------------

const identity = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
function times4(a, b) {
  const found = new Array(16);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++)
      found[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
  return found;
}
const moved = (x, y, z) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
function turned(axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  if (axis === "x") return [1, 0, 0, 0, 0, c, s, 0, 0, -s, c, 0, 0, 0, 0, 1];
  if (axis === "y") return [c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, 0, 0, 0, 1];
  return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
}
function quaternion(w, x, y, z) {
  const n = Math.hypot(w, x, y, z) || 1;
  w /= n; x /= n; y /= n; z /= n;
  return [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
          2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
          2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0, 0, 0, 0, 1];
}
// From a point along a vector: the z axis lies on it.
function along(from, vector) {
  const length = Math.hypot(...vector), z = vector.map((v) => v / length);
  const side = Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  let x = [side[1] * z[2] - side[2] * z[1], side[2] * z[0] - side[0] * z[2], side[0] * z[1] - side[1] * z[0]];
  const n = Math.hypot(...x);
  x = x.map((v) => v / n);
  const y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]];
  return [...x, 0, ...y, 0, ...z, 0, ...from, 1];
}
function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2), d = 1 / (near - far);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * d, -1, 0, 0, 2 * far * near * d, 0];
}

// -- poses ----------------------------------------------------------------------------------------------

function motion(item, when) {
  if (item.move) return moved(...item.move.map((v) => value(v, when)));
  if (item.turn) return turned(item.turn, value(item.by, when));
  return quaternion(...item.quaternion.map((v) => value(v, when)));
}
// World matrices of all nodes; a parent comes before its children.
function poses(when) {
  const found = [];
  for (const node of content.nodes) {
    let pose = node.parent < 0 ? identity() : found[node.parent];
    for (const item of node.pose) pose = times4(pose, motion(item, when));
    found.push(pose);
  }
  return found;
}
const trails = content.nodes.map((node) => (node.trail ? new Float32Array(3 * frames) : null));
for (let i = 0; i < frames; i++) {
  const now = poses([i, 0]);
  trails.forEach((trail, n) => trail && trail.set(now[n].slice(12, 15), 3 * i));
}

// -- drawing ----------------------------------------------------------------------------------------------

const canvas = $("scene");
const gl = canvas.getContext("webgl", { alpha: false, antialias: true, stencil: true });
if (!gl) $("message").textContent = "This browser has no WebGL: curves only.";

const VERTEX = `attribute vec3 p, n; uniform mat4 view, model; uniform vec3 size; varying vec3 normal;
void main() { normal = mat3(model) * (n / size); gl_Position = view * model * vec4(p * size, 1.0); }`;
const FRAGMENT = `precision mediump float; varying vec3 normal; uniform vec4 colour; uniform float plain;
void main() { vec3 n = normalize(normal + vec3(0.0, 0.0, 1e-6));
  float light = 0.62 + 0.32 * max(dot(n, vec3(0.42, -0.3, 0.856)), 0.0) + 0.1 * n.z;
  gl_FragColor = vec4(colour.rgb * mix(light, 1.0, plain), colour.a); }`;

function program() {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.bindAttribLocation(made, 0, "p");
  gl.bindAttribLocation(made, 1, "n");
  gl.linkProgram(made);
  return made;
}
// Triangles as rows of position and normal.
function mesh(rows) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(rows.flat()), gl.STATIC_DRAW);
  return { buffer, count: rows.length };
}
function cube() {
  const rows = [];
  for (const a of [0, 1, 2])
    for (const s of [-1, 1]) {
      const n = [0, 0, 0], corner = (u, v) => {
        const p = [0, 0, 0];
        p[a] = 0.5 * s; p[(a + 1) % 3] = 0.5 * u; p[(a + 2) % 3] = 0.5 * v;
        return [...p, ...n];
      };
      n[a] = s;
      rows.push(corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, -1), corner(1, 1), corner(-1, 1));
    }
  return rows;
}
// A surface of revolution about z through (radius, height) points; `flatly` has edges between rings.
function revolved(profile, parts = 28) {
  const rows = [];
  for (let k = 0; k + 1 < profile.length; k++) {
    const [r0, z0] = profile[k], [r1, z1] = profile[k + 1], l = Math.hypot(z1 - z0, r1 - r0) || 1;
    const nr = (z1 - z0) / l, nz = (r0 - r1) / l;
    for (let i = 0; i < parts; i++) {
      const [a, b] = [i, i + 1].map((j) => (2 * Math.PI * j) / parts);
      const point = (r, z, w) => [r * Math.cos(w), r * Math.sin(w), z, nr * Math.cos(w), nr * Math.sin(w), nz];
      rows.push(point(r0, z0, a), point(r0, z0, b), point(r1, z1, b), point(r0, z0, a), point(r1, z1, b), point(r1, z1, a));
    }
  }
  return rows;
}
const arc = [...Array(13).keys()].map((i) => [Math.cos((i / 12 - 0.5) * Math.PI), Math.sin((i / 12 - 0.5) * Math.PI)]);
let meshes, shader, where, lines;
if (gl) {
  shader = program();
  where = Object.fromEntries(["view", "model", "size", "colour", "plain"].map((n) => [n, gl.getUniformLocation(shader, n)]));
  meshes = {
    box: mesh(cube()),
    cylinder: mesh(revolved([[0, -0.5], [1, -0.5], [1, 0.5], [0, 0.5]])),
    cone: mesh(revolved([[0, 0], [1, 0], [0, 1]])),
    sphere: mesh(revolved(arc)),
  };
  lines = gl.createBuffer();
}
function put(kind, model, size, colour) {
  const m = meshes[kind];
  gl.bindBuffer(gl.ARRAY_BUFFER, m.buffer);
  gl.enableVertexAttribArray(1);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 24, 0);
  gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 24, 12);
  gl.uniformMatrix4fv(where.model, false, model);
  gl.uniform3fv(where.size, size);
  gl.uniform4fv(where.colour, colour);
  gl.drawArrays(gl.TRIANGLES, 0, m.count);
}
function strip(points, colour, mode = gl.LINE_STRIP, model = identity()) {
  gl.bindBuffer(gl.ARRAY_BUFFER, lines);
  gl.bufferData(gl.ARRAY_BUFFER, points, gl.STREAM_DRAW);
  gl.disableVertexAttribArray(1);
  gl.vertexAttrib3f(1, 0, 0, 1);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
  gl.uniformMatrix4fv(where.model, false, model);
  gl.uniform3f(where.size, 1, 1, 1);
  gl.uniform1f(where.plain, 1);
  gl.uniform4fv(where.colour, colour);
  gl.drawArrays(mode, 0, points.length / 3);
  gl.uniform1f(where.plain, 0);
}
// A line as a level band, since lines of WebGL are one pixel wide.
function ribbon(points, half) {
  const found = new Float32Array(2 * points.length), last = points.length - 3;
  let side = [0, half];
  for (let i = 0; i <= last; i += 3) {
    const a = Math.max(i - 3, 0), b = Math.min(i + 3, last);
    const dx = points[b] - points[a], dy = points[b + 1] - points[a + 1], l = Math.hypot(dx, dy);
    if (l > 1e-9) side = [(-dy / l) * half, (dx / l) * half];
    found.set([points[i] + side[0], points[i + 1] + side[1], points[i + 2] + 0.002,
               points[i] - side[0], points[i + 1] - side[1], points[i + 2] + 0.002], 2 * i);
  }
  return found;
}
const LIES = { x: turned("y", Math.PI / 2), y: turned("x", -Math.PI / 2), z: identity() };
// What a shape is made of: [mesh, matrix, size, colour].
function parts(shape, pose, when) {
  const number = (item) => value(item, when), vector = (items) => items.map(number);
  const at = vector(shape.at), colour = shape.rgb, placed = times4(pose, moved(...at));
  if (shape.box) return [["box", placed, vector(shape.box), colour]];
  if (shape.sphere !== undefined) return [["sphere", placed, Array(3).fill(number(shape.sphere)), colour]];
  if (shape.cylinder) {
    const [r, l] = vector(shape.cylinder);
    return [["cylinder", times4(placed, LIES[shape.axis]), [r, r, l], colour]];
  }
  if (shape.rod) {
    const [a, b] = shape.rod.map(vector), d = b.map((v, i) => v - a[i]), l = Math.hypot(...d);
    const r = number(shape.radius);
    return l < 1e-6 ? [] : [["cylinder", times4(times4(pose, along(a, d)), moved(0, 0, l / 2)), [r, r, l], colour]];
  }
  const arrow = (d, thick, rgb) => {
    const l = Math.hypot(...d), head = Math.min(6 * thick, l);
    if (l < 1e-6) return [];
    const stem = times4(pose, along(at, d));
    return [["cylinder", times4(stem, moved(0, 0, (l - head) / 2)), [thick, thick, l - head], rgb],
            ["cone", times4(stem, moved(0, 0, l - head)), [2.4 * thick, 2.4 * thick, head], rgb]];
  };
  if (shape.arrow) return arrow(vector(shape.arrow), 0.008, colour);
  const l = number(shape.frame);
  return [[[l, 0, 0], RED], [[0, l, 0], GREEN], [[0, 0, l], BLUE]].flatMap(([d, rgb]) => arrow(d, 0.03 * l, rgb));
}

const hidden = new Set();
let time = begin, playing = false, follow = false, shadows = true;
const camera = { turn: -0.9, rise: 0.5, distance: 3, target: [0, 0, 0.3] };
function fit() {
  const low = [1e9, 1e9, 0], high = [-1e9, -1e9, 0.3], reach = content.size;
  const cover = (x, y, z) => [x, y, z].forEach((v, i) => { low[i] = Math.min(low[i], v); high[i] = Math.max(high[i], v); });
  trails.forEach((trail) => { if (trail) for (let i = 0; i < frames; i++) cover(...trail.subarray(3 * i, 3 * i + 3)); });
  poses([0, 0]).forEach((pose) => cover(...pose.slice(12, 15)));
  camera.target = low.map((v, i) => (v + high[i]) / 2);
  camera.distance = Math.hypot(...low.map((v, i) => high[i] - v)) + 2 * reach;
}
function viewMatrix() {
  const { turn, rise, distance, target } = camera;
  const eye = perspective(0.7, canvas.width / canvas.height, distance / 100, distance * 20);
  let m = times4(eye, moved(0, 0, -distance));
  m = times4(times4(m, turned("x", rise - Math.PI / 2)), turned("z", -turn - Math.PI / 2));
  return times4(m, moved(...target.map((v) => -v)));
}
function grid() {
  const wanted = camera.distance / 8, power = 10 ** Math.floor(Math.log10(wanted));
  const step = power * (wanted / power > 5 ? 5 : wanted / power > 2 ? 2 : 1), count = 20, points = [];
  const [x0, y0] = camera.target.map((v) => Math.round(v / step) * step);
  for (let i = -count; i <= count; i++)
    for (let j = -count; j < count; j++) { // in pieces: some drivers drop lines that pass the eye
      points.push(x0 + i * step, y0 + j * step, 0, x0 + i * step, y0 + (j + 1) * step, 0);
      points.push(x0 + j * step, y0 + i * step, 0, x0 + (j + 1) * step, y0 + i * step, 0);
    }
  strip(new Float32Array(points), [0.55, 0.6, 0.66, 0.35], gl.LINES);
  $("scale").textContent = `grid ${+step.toPrecision(1)} m`;
}
// Shadow on the floor along the light.
const SHADOW = [1, 0, 0, 0, 0, 1, 0, 0, -0.49, 0.35, 0, 0, 0, 0, 0.001, 1];

function draw() {
  const when = at(time), now = poses(when);
  if (follow) camera.target = now[content.follow].slice(12, 15);
  if (gl) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0.957, 0.965, 0.973, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.useProgram(shader);
    gl.enableVertexAttribArray(0);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.uniformMatrix4fv(where.view, false, viewMatrix());
    gl.uniform1f(where.plain, 0);
    gl.enable(gl.DEPTH_TEST);
    grid();
    const solid = [], clear = [], above = [];
    content.nodes.forEach((node, n) => {
      if (hidden.has(node.group)) return;
      for (const shape of node.shapes) {
        const opacity = node.measured ? 0.38 : shape.opacity;
        const list = shape.arrow ? above : opacity < 1 ? clear : solid;
        for (const [kind, model, size, rgb] of parts(shape, now[n], when))
          if (size.every((v) => Math.abs(v) > 1e-9))
            list.push([kind, model, size, [...(node.measured && !shape.frame ? MEASURED_RGB : rgb), opacity]]);
      }
    });
    if (shadows) {
      gl.enable(gl.STENCIL_TEST);
      gl.stencilFunc(gl.EQUAL, 0, 255);
      gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
      gl.uniform1f(where.plain, 1);
      for (const [kind, model, size] of solid.concat(clear.filter((p) => p[3][3] > 0.4)))
        put(kind, times4(SHADOW, model), size, [0.2, 0.24, 0.3, 0.16]);
      gl.uniform1f(where.plain, 0);
      gl.disable(gl.STENCIL_TEST);
    }
    content.nodes.forEach((node, n) => {
      if (!trails[n] || hidden.has(node.group)) return;
      const rgb = node.measured ? MEASURED_RGB : node.rgb, done = 3 * (when[0] + 1);
      const past = new Float32Array(done + 3);
      past.set(trails[n].subarray(0, done));
      past.set(now[n].slice(12, 15), done);
      strip(trails[n], [...rgb, 0.4]);
      strip(ribbon(past, 0.0016 * camera.distance), [...rgb, 1], gl.TRIANGLE_STRIP);
    });
    for (const part of solid) put(...part);
    gl.depthMask(false);
    for (const part of clear) put(...part);
    gl.disable(gl.DEPTH_TEST);
    gl.uniform1f(where.plain, 0.6);
    for (const part of above) put(...part);
    gl.uniform1f(where.plain, 0);
    gl.depthMask(true);
  }
  $("clock").textContent = `${time.toFixed(2)} s`;
  $("slider").value = time;
  plots.forEach((plot) => plot.draw());
}

// -- curves ---------------------------------------------------------------------------------------------

class Plot {
  constructor(name) {
    this.box = document.createElement("div");
    this.select = document.createElement("select");
    this.canvas = document.createElement("canvas");
    this.box.append(this.select, this.canvas);
    $("plots").append(this.box);
    content.signals.forEach((signal, i) => this.select.add(new Option(signal.unit ? `${signal.name} [${signal.unit}]` : signal.name, i)));
    this.select.value = Math.max(content.signals.findIndex((signal) => signal.name === name), 0);
    this.select.onchange = () => draw();
    const seek = (event) => {
      const x = (event.offsetX - 6) / (this.canvas.clientWidth - 12);
      go(begin + Math.min(Math.max(x, 0), 1) * (end - begin));
    };
    this.canvas.onpointerdown = (event) => { this.canvas.setPointerCapture(event.pointerId); seek(event); };
    this.canvas.onpointermove = (event) => { if (event.buttons) seek(event); };
  }
  draw() {
    const signal = content.signals[+this.select.value], c = this.canvas;
    if (!signal) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2), w = c.clientWidth, h = c.clientHeight;
    c.width = w * ratio; c.height = h * ratio;
    const g = c.getContext("2d");
    g.scale(ratio, ratio);
    const series = [...(signal.measured === undefined ? [] : [[signal.measured, MEASURED]]), [signal.channel, ACCENT]];
    let low = Infinity, high = -Infinity;
    for (const [channel] of series)
      for (let i = 0; i < frames; i++) { const v = samples[channel * frames + i]; if (v < low) low = v; if (v > high) high = v; }
    const pad = high - low || Math.abs(high) || 1;
    const x = (t) => 6 + ((w - 12) * (t - begin)) / (end - begin || 1), y = (v) => h - 8 - ((h - 16) * (v - low + 0.04 * pad)) / (high - low + 0.08 * pad);
    for (const [channel, colour] of series) {
      g.beginPath();
      for (let i = 0; i < frames; i++) g.lineTo(x(times[i]), y(samples[channel * frames + i]));
      g.strokeStyle = colour; g.lineWidth = 1.4; g.stroke();
    }
    g.beginPath(); g.moveTo(x(time), 0); g.lineTo(x(time), h);
    g.strokeStyle = "#b91c1c"; g.lineWidth = 1; g.stroke();
    g.fillStyle = "#6b7280"; g.font = "11px system-ui, sans-serif";
    g.fillText(high.toPrecision(4), 8, 12); g.fillText(low.toPrecision(4), 8, h - 3);
    g.textAlign = "right";
    const now = series.map(([channel]) => sample(channel, at(time)).toPrecision(4)).reverse();
    g.fillText(now.join("  measured "), w - 8, 12);
  }
}
const plots = content.plots.map((name) => new Plot(name));

// -- controls -----------------------------------------------------------------------------------------

function go(to) { time = Math.min(Math.max(to, begin), end); draw(); }
let last = null;
function tick(stamp) {
  if (!playing) { last = null; return; }
  if (last !== null) {
    const next = time + ((stamp - last) / 1000) * +$("speed").value;
    go(next > end ? begin : next);
  }
  last = stamp;
  requestAnimationFrame(tick);
}
function play(wanted) {
  playing = wanted;
  $("play").textContent = playing ? "Pause" : "Play";
  if (playing) { if (time >= end) time = begin; requestAnimationFrame(tick); }
}
$("play").onclick = () => play(!playing);
Object.assign($("slider"), { min: begin, max: end, step: (end - begin) / 2000 || 1, oninput: (e) => { play(false); go(+e.target.value); } });
$("follow").onchange = (e) => { follow = e.target.checked; draw(); };
$("fit").onclick = () => { fit(); draw(); };
const VIEWS = { above: [-Math.PI / 2, 1.5], side: [-Math.PI / 2, 0.06], behind: [Math.PI, 0.35], oblique: [-0.9, 0.5] };
$("from").onchange = (e) => { [camera.turn, camera.rise] = VIEWS[e.target.value]; draw(); };
for (const group of content.groups) {
  const label = document.createElement("label"), check = document.createElement("input");
  Object.assign(check, { type: "checkbox", checked: true });
  check.onchange = () => { check.checked ? hidden.delete(group.name) : hidden.add(group.name); draw(); };
  const mark = document.createElement("span");
  mark.className = "mark";
  mark.style.background = group.colour;
  label.append(check, mark, group.name);
  $("groups").append(label);
}
canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
canvas.onpointermove = (event) => {
  if (!event.buttons) return;
  const dx = event.movementX / canvas.clientHeight, dy = event.movementY / canvas.clientHeight;
  if (event.buttons === 1 && !event.shiftKey) {
    camera.turn -= 4 * dx;
    camera.rise = Math.min(Math.max(camera.rise + 4 * dy, -0.2), 1.55);
  } else {
    const s = Math.sin(camera.turn), c = Math.cos(camera.turn), d = 0.75 * camera.distance;
    camera.target[0] += d * (s * dx + c * dy);
    camera.target[1] += d * (-c * dx + s * dy);
  }
  draw();
};
canvas.oncontextmenu = (event) => event.preventDefault();
canvas.addEventListener("wheel", (event) => { event.preventDefault(); camera.distance *= Math.exp(0.001 * event.deltaY); draw(); }, { passive: false });
document.onkeydown = (event) => {
  if (event.target.tagName === "SELECT") return;
  if (event.key === " ") { event.preventDefault(); play(!playing); }
  if (event.key === "ArrowRight" || event.key === "ArrowLeft") go(time + (event.key === "ArrowRight" ? 1 : -1) * (end - begin) / 100);
};
window.onresize = () => draw();
fit();
const asked = new URLSearchParams(location.hash.slice(1)); // page.html#t=3.5&from=above&follow=1
if (asked.has("from")) { $("from").value = asked.get("from"); [camera.turn, camera.rise] = VIEWS[asked.get("from")] || VIEWS.oblique; }
if (asked.has("follow")) { $("follow").checked = follow = true; camera.distance = 4 * content.size; }
go(asked.has("t") ? +asked.get("t") : begin);
