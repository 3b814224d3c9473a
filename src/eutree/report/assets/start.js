"use strict";
/* Everything is there: draw it. */

const READABLE = 0.6; // the smallest scale that a page begins with

/** Within a report the tree's panel is as high as the tree, where there is room on the screen. */
function settle() {
  const panel = byId("tree-panel");
  if (!panel.closest(".watch")) return;
  const across = Math.max(READABLE, Math.min(LARGEST, (canvas.clientWidth - 32) / extent().width));
  const wanted = extent().height * across + 128;
  panel.style.height = `${Math.round(Math.max(260, Math.min(wanted, 0.85 * innerHeight)))}px`;
}

onChange(markTree);
drawTree();
settle();
openToFit(READABLE);
const foldedAtFirst = new Set(collapsed); // by the page, not by a person: paper has room for it
settle();
fit();
show({});
follow(location);

/* On paper there is nothing to drag: the whole tree, as wide as the page. */
const unfolded = [];
addEventListener("beforeprint", () => {
  unfolded.push(...[...collapsed].filter((node) => foldedAtFirst.has(node)));
  for (const node of unfolded) collapsed.delete(node);
  rowHeight = CLOSEST;
  drawTree();
  const { width, height } = extent();
  canvas.setAttribute("viewBox", `-8 -8 ${width + 16} ${height + 16}`);
  Object.assign(view, { x: 0, y: 0, scale: 1 });
  applyView();
});
addEventListener("afterprint", () => {
  canvas.removeAttribute("viewBox");
  for (const node of unfolded.splice(0)) collapsed.add(node);
  fit();
});
document.body.dataset.ready = "true";
