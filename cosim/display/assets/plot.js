"use strict";
// Plots of signals: panels over one axis, drawn on a canvas. Drag zooms, a double click (or Escape)
// shows all again, a pointer or the arrow keys read values. Plots of one group move together.

const store = JSON.parse(document.getElementById("signal-data")?.textContent || "{}");
const decoded = new Map();
const groups = new Map();
const GAP = 22; // above a panel, for its title [px]

// A series of the store: numbers as they are, an even axis `{first, step, count}`, or 16 bits per
// number in base64 between the smallest and the largest, `{low, step, data}` (-32768: a gap).
function numbers(key) {
  if (!decoded.has(key)) decoded.set(key, key in store ? decode(store[key]) : null);
  return decoded.get(key);
}

function decode(item) {
  if (Array.isArray(item)) return Float64Array.from(item, (v) => (v === null ? NaN : v));
  if (item.data === undefined) {
    return Float64Array.from({ length: item.count }, (_, i) => item.first + i * item.step);
  }
  const text = atob(item.data);
  const view = new DataView(new ArrayBuffer(text.length));
  for (let i = 0; i < text.length; i++) view.setUint8(i, text.charCodeAt(i));
  return Float64Array.from({ length: text.length / 2 }, (_, i) => {
    const value = view.getInt16(2 * i, true);
    return value === -32768 ? NaN : item.low + (value + 32767) * item.step;
  });
}

// x, smallest and largest values of a line: one array where every sample is there. What a model
// says may be given as measured less residual.
function load(line, run) {
  const named = (key) => numbers(key.replace("{run}", run));
  const x = named(line.x);
  let low = named(line.y);
  if (!low && line.less) {
    const [from, less] = line.less.map(named);
    low = from && less ? from.map((value, i) => value - less[i]) : null;
  }
  if (!x || !low) return null;
  const high = named(`${line.y}^`) || low;
  return { x, low, high, whole: low === high };
}

function ticks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1);
  if (!(rough > 0) || !isFinite(rough)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    found.push(+(k * step).toPrecision(12));
  }
  return found;
}

function shown(value) {
  if (value === null || !isFinite(value)) return "–";
  return String(+value.toPrecision(4)).replace("-", "−");
}

// First index whose x is not below a value.
function place(x, value) {
  let low = 0, high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

function nearest(x, value) {
  const after = Math.min(place(x, value), x.length - 1);
  const before = Math.max(after - 1, 0);
  return value - x[before] < x[after] - value ? before : after;
}

class Plot {
  constructor(root) {
    this.root = root;
    this.config = JSON.parse(root.querySelector("script").textContent);
    this.hidden = new Set(this.config.hidden || []);
    this.run = this.config.runs ? this.config.runs[0] : "";
    this.group = groups.get(this.config.group) || { plots: [], range: null, cursor: null };
    groups.set(this.config.group, this.group);
    this.group.plots.push(this);
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${this.config.label}; arrow keys read values, plus ` +
      "and minus zoom, Escape shows all");
    this.reader = document.createElement("div");
    this.reader.className = "reader";
    this.reader.setAttribute("aria-live", "polite");
    this.bar = document.createElement("div");
    this.bar.className = "plotbar";
    this.stage = document.createElement("div");
    this.stage.className = "stage";
    this.stage.append(this.canvas, this.reader);
    root.append(this.bar, this.stage);
    this.buildBar();
    this.listen();
    this.take();
    new ResizeObserver(() => this.draw()).observe(this.stage);
  }

  // -- what is shown ------------------------------------------------------------------------------

  take() {
    this.panels = this.config.panels.map((panel) => ({
      ...panel,
      lines: panel.lines.map((line) => ({ ...line, data: load(line, this.run) }))
        .filter((line) => line.data),
      level: typeof panel.band === "number" ? panel.band : null,
    }));
    let low = Infinity, high = -Infinity;
    for (const { data } of this.panels.flatMap((panel) => panel.lines)) {
      if (!data.x.length) continue;
      low = Math.min(low, data.x[0]);
      high = Math.max(high, data.x[data.x.length - 1]);
    }
    this.extent = high > low ? [low, high] : [low - 0.5, low + 0.5];
    this.draw();
  }

  get range() {
    return this.group.range || this.extent;
  }

  button(text, title, action) {
    const item = document.createElement("button");
    item.type = "button";
    item.textContent = text;
    item.title = title;
    item.addEventListener("click", () => action(item));
    this.bar.append(item);
    return item;
  }

  buildBar() {
    if (this.config.runs && this.config.runs.length > 1) {
      const select = document.createElement("select");
      select.setAttribute("aria-label", "run");
      for (const run of this.config.runs) {
        select.append(new Option(this.config.runNames?.[run] || run, run));
      }
      select.addEventListener("change", () => {
        this.group.range = this.group.cursor = null;
        for (const plot of this.group.plots) {
          plot.run = select.value;
          const own = plot.bar.querySelector("select");
          if (own) own.value = select.value;
          plot.take();
        }
      });
      this.bar.append(select);
    }
    const names = new Map();
    for (const line of this.config.panels.flatMap((panel) => panel.lines)) {
      if (line.name && !names.has(line.name)) names.set(line.name, line);
    }
    for (const [name, line] of names) {
      const item = this.button(name, "show or hide this curve", () => {
        if (!this.hidden.delete(name)) this.hidden.add(name);
        item.setAttribute("aria-pressed", String(!this.hidden.has(name)));
        this.draw();
      });
      item.className = `key ${line.colour}`;
      item.setAttribute("aria-pressed", String(!this.hidden.has(name)));
    }
    this.all = this.button("show all", "back to the whole width (double click)", () => this.zoom(null));
    this.all.className = "all";
  }

  // -- moving -------------------------------------------------------------------------------------

  zoom(range) {
    this.group.range = range;
    for (const plot of this.group.plots) plot.draw();
  }

  point(value) {
    this.group.cursor = value;
    for (const plot of this.group.plots) plot.draw();
  }

  valueAt(event) {
    const x = event.clientX - this.canvas.getBoundingClientRect().left;
    const [low, high] = this.range;
    const share = (x - this.left) / (this.width - this.left - this.right);
    return low + Math.min(Math.max(share, 0), 1) * (high - low);
  }

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      this.drag = { from: this.valueAt(event), to: null, x: event.clientX };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (this.drag && Math.abs(event.clientX - this.drag.x) > 6) {
        this.drag.to = this.valueAt(event);
      }
      this.point(this.valueAt(event));
    });
    canvas.addEventListener("pointerup", (event) => {
      const drag = this.drag;
      this.drag = null;
      if (drag && drag.to !== null) {
        const ends = [drag.from, drag.to].sort((a, b) => a - b);
        this.zoom(ends[1] - ends[0] > 1e-6 * (this.extent[1] - this.extent[0]) ? ends : null);
      } else {
        this.point(this.valueAt(event));
      }
    });
    canvas.addEventListener("pointercancel", () => { this.drag = null; this.point(null); });
    canvas.addEventListener("pointerleave", () => { if (!this.drag) this.point(null); });
    canvas.addEventListener("dblclick", () => this.zoom(null));
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("blur", () => this.point(null));
  }

  key(event) {
    const [low, high] = this.range, width = high - low;
    const cursor = this.group.cursor ?? (low + high) / 2;
    const clip = (value) => Math.min(Math.max(value, this.extent[0]), this.extent[1]);
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      const way = event.key === "ArrowLeft" ? -1 : 1;
      const next = clip(cursor + way * width / (event.shiftKey ? 10 : 100));
      if (next < low || next > high) {
        this.group.range = [clip(low + way * width / 2), clip(high + way * width / 2)];
      }
      this.point(next);
    } else if (event.key === "+" || event.key === "=") {
      this.zoom([clip(cursor - width / 4), clip(cursor + width / 4)]);
    } else if (event.key === "-") {
      this.zoom([clip(cursor - width), clip(cursor + width)]);
    } else if (event.key === "Escape" || event.key === "0") {
      this.zoom(null);
    } else return;
    event.preventDefault();
  }

  // -- drawing ------------------------------------------------------------------------------------

  draw() {
    this.width = this.stage.clientWidth;
    if (!this.width) return;
    const ratio = Math.max(window.devicePixelRatio || 1, 2);
    const heights = this.panels.map((panel) => panel.height || 170);
    const height = heights.reduce((a, b) => a + b + GAP, 0) + 30;
    this.canvas.width = this.width * ratio;
    this.canvas.height = height * ratio;
    this.canvas.style.height = `${height}px`;
    this.left = this.width < 500 ? 50 : 64;
    this.right = 12;
    const style = getComputedStyle(this.root);
    this.ink = (name) => style.getPropertyValue(`--${name}`).trim() || "#888";
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.clearRect(0, 0, this.width, height);
    pen.font = `11px ${style.fontFamily}`;
    let top = GAP - 4;
    for (const [index, panel] of this.panels.entries()) {
      this.drawPanel(pen, panel, top, heights[index], index === this.panels.length - 1);
      top += heights[index] + GAP;
    }
    pen.fillStyle = this.ink("soft");
    pen.textAlign = "center";
    pen.fillText(this.config.axis, (this.left + this.width - this.right) / 2, height - 6);
    this.drawCursor(pen, top);
    this.all.hidden = !this.group.range;
    this.root.dataset.drawn = String(this.panels.reduce((n, panel) => n + panel.lines.length, 0));
  }

  across(value) {
    const [low, high] = this.range;
    return this.left + (value - low) / (high - low) * (this.width - this.left - this.right);
  }

  visible(panel) {
    return panel.lines.filter((line) => !this.hidden.has(line.name));
  }

  limits(panel) {
    let low = Infinity, high = -Infinity;
    for (const { data } of this.visible(panel)) {
      const from = Math.max(place(data.x, this.range[0]) - 1, 0);
      const to = Math.min(place(data.x, this.range[1]) + 1, data.x.length);
      for (let i = from; i < to; i++) {
        if (data.low[i] < low) low = data.low[i];
        if (data.high[i] > high) high = data.high[i];
      }
    }
    if (panel.level !== null) [low, high] = [Math.min(low, -panel.level), Math.max(high, panel.level)];
    if (!(high >= low)) return [-1, 1];
    const margin = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
    return [low - margin, high + margin];
  }

  drawPanel(pen, panel, top, height, last) {
    const [low, high] = this.limits(panel);
    const right = this.width - this.right;
    const down = (value) => top + (high - value) / (high - low) * height;
    pen.save();
    pen.strokeStyle = this.ink("line");
    pen.fillStyle = this.ink("soft");
    pen.lineWidth = 1;
    pen.textAlign = "right";
    for (const value of ticks(low, high, height / 38)) {
      pen.beginPath();
      pen.moveTo(this.left, down(value));
      pen.lineTo(right, down(value));
      pen.stroke();
      pen.fillText(shown(value), this.left - 5, down(value) + 4);
    }
    pen.textAlign = "center";
    for (const value of ticks(...this.range, (this.width - this.left) / 90)) {
      const x = this.across(value);
      pen.beginPath();
      pen.moveTo(x, top);
      pen.lineTo(x, top + height);
      pen.stroke();
      if (last) pen.fillText(shown(value), x, top + height + 14);
    }
    pen.beginPath();
    pen.rect(this.left, top, right - this.left, height);
    pen.clip();
    if (panel.level !== null) {
      pen.fillStyle = this.ink("band");
      pen.fillRect(this.left, down(panel.level), right - this.left,
        down(-panel.level) - down(panel.level));
    }
    for (const line of this.visible(panel)) this.drawLine(pen, line, down);
    pen.restore();
    pen.textAlign = "left";
    pen.fillStyle = this.ink("ink");
    pen.fillText(panel.title, this.left, top - 5);
    panel.down = down;
  }

  drawLine(pen, line, down) {
    const { x, low, high, whole } = line.data;
    const from = Math.max(place(x, this.range[0]) - 1, 0);
    const to = Math.min(place(x, this.range[1]) + 1, x.length);
    pen.strokeStyle = pen.fillStyle = this.ink(line.colour);
    pen.lineWidth = line.width || 1.4;
    pen.setLineDash(line.dash ? [5, 3] : []);
    const dots = line.dots && to - from < (this.width - this.left) / 5;
    if (!whole) {
      // an envelope: everything between the smallest and the largest sample of each stretch
      pen.globalAlpha = line.fill || 0.75;
      pen.beginPath();
      for (let i = from; i < to; i++) pen.lineTo(this.across(x[i]), down(high[i]) - 0.5);
      for (let i = to - 1; i >= from; i--) pen.lineTo(this.across(x[i]), down(low[i]) + 0.5);
      pen.fill();
      pen.globalAlpha = 1;
      return;
    }
    pen.beginPath();
    let open = false;
    for (let i = from; i < to; i++) {
      if (!Number.isFinite(low[i])) { open = false; continue; }
      const px = this.across(x[i]), py = down(low[i]);
      if (open) pen.lineTo(px, py); else pen.moveTo(px, py);
      open = true;
    }
    pen.stroke();
    pen.setLineDash([]);
    for (let i = from; dots && i < to; i++) {
      pen.beginPath();
      pen.arc(this.across(x[i]), down(low[i]), 2, 0, 7);
      pen.fill();
    }
  }

  drawCursor(pen, bottom) {
    const drag = this.drag;
    if (drag && drag.to !== null) {
      const [a, b] = [this.across(drag.from), this.across(drag.to)];
      pen.fillStyle = this.ink("select");
      pen.fillRect(Math.min(a, b), 8, Math.abs(b - a), bottom - GAP - 8);
    }
    const at = this.group.cursor;
    this.reader.hidden = at === null || at < this.range[0] || at > this.range[1];
    if (this.reader.hidden) return;
    const x = this.across(at);
    pen.strokeStyle = this.ink("soft");
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(x, 8);
    pen.lineTo(x, bottom - GAP);
    pen.stroke();
    const rows = [`${this.config.cursor || this.config.axis}: ${shown(at)}`];
    for (const panel of this.panels) {
      for (const line of this.visible(panel)) {
        const { data } = line, i = nearest(data.x, at);
        if (!line.name || !Number.isFinite(data.low[i])) continue;
        pen.fillStyle = this.ink(line.colour);
        pen.beginPath();
        pen.arc(this.across(data.x[i]), panel.down((data.low[i] + data.high[i]) / 2), 3, 0, 7);
        pen.fill();
        const value = data.whole ? shown(data.low[i])
          : `${shown(data.low[i])} to ${shown(data.high[i])}`;
        rows.push(`${panel.short || panel.title} ${line.name}: ${value}`);
      }
    }
    this.reader.replaceChildren(...rows.map((row) => {
      const item = document.createElement("div");
      item.textContent = row;
      return item;
    }));
    const room = this.reader.offsetWidth + 14;
    this.reader.style.left = `${x + room < this.width ? x + 10 : Math.max(x - room, 0)}px`;
  }
}

const plots = [...document.querySelectorAll(".plot")].map((root) => new Plot(root));
const redraw = () => plots.forEach((plot) => plot.draw());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
for (const [event, on] of [["beforeprint", true], ["afterprint", false]]) {
  addEventListener(event, () => { document.documentElement.classList.toggle("printing", on); redraw(); });
}
addEventListener("toggle", redraw, true); // plots in what was closed have had no width
