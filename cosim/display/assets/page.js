"use strict";
// Tables that sort, explanations that keyboard and touch reach, commands that copy.

for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = head.querySelector("button");
    if (!button) return;
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") !== "descending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = (row) => {
        const cell = row.cells[column];
        const text = cell.dataset.sort ?? cell.textContent;
        return text !== "" && isFinite(text) ? +text : text;
      };
      const order = (a, b) => {
        const [x, y] = [key(a), key(b)];
        if (typeof x !== typeof y) return typeof x === "number" ? -1 : 1; // gaps stay below
        const sign = typeof x === "number" ? x - y : x.localeCompare(y, undefined, { numeric: true });
        return down === (typeof x === "number") ? -sign : sign;
      };
      table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
    });
  });
}

const bubble = document.createElement("div");
bubble.className = "bubble";
bubble.hidden = true;
bubble.setAttribute("role", "tooltip");
bubble.id = "bubble";
document.body.append(bubble);
let explained = null; // what the bubble belongs to

function place() {
  const box = explained.getBoundingClientRect();
  const x = Math.min(Math.max(box.left, 8), innerWidth - bubble.offsetWidth - 8);
  const below = box.bottom + bubble.offsetHeight + 10 < innerHeight;
  bubble.style.left = `${Math.max(x, 8)}px`;
  bubble.style.top = `${below ? box.bottom + 6 : box.top - bubble.offsetHeight - 6}px`;
}

function hide() {
  explained?.removeAttribute("aria-describedby");
  explained = null;
  bubble.hidden = true;
}

for (const item of document.querySelectorAll("[title]")) {
  if (item.closest("svg") || item.closest(".plot")) continue;
  const text = item.title;
  item.removeAttribute("title");
  item.dataset.tip = text;
  if (!item.matches("button, a, summary, input, select")) item.tabIndex = 0;
  const show = () => {
    hide();
    explained = item;
    bubble.textContent = text;
    bubble.hidden = false;
    item.setAttribute("aria-describedby", "bubble");
    place();
  };
  item.addEventListener("mouseenter", show);
  item.addEventListener("focus", show);
  item.addEventListener("mouseleave", hide);
  item.addEventListener("blur", hide);
}
addEventListener("keydown", (event) => { if (event.key === "Escape") hide(); });
addEventListener("scroll", () => { if (explained) place(); }, true);

for (const button of document.querySelectorAll("button.copy")) {
  button.addEventListener("click", async () => {
    const text = button.parentElement.querySelector("code").textContent;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const range = document.createRange(); // pages opened as files may have no clipboard
      range.selectNodeContents(button.parentElement.querySelector("code"));
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      document.execCommand("copy");
    }
    button.textContent = "copied";
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  });
}

let closed = [];
addEventListener("beforeprint", () => {
  closed = [...document.querySelectorAll("details:not([open])")];
  closed.forEach((item) => { item.open = true; });
});
addEventListener("afterprint", () => closed.forEach((item) => { item.open = false; }));
