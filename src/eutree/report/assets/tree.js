"use strict";
/* The tree: layout, drawing, pan and zoom, keys. */

const LEAF_BOX = 30, CHANGED_BOX = 46, TEST_BOX = 46, GAP = 44, PADDING = 11, KNOB = 8;
const CLOSEST = 52, WIDEST = 96, LARGEST = 1.5, ROOM = 56;
const RARE = 0.02; // share of the visits below which a page begins with what is below a test folded
const canvas = byId("canvas");
const view = { x: 0, y: 0, scale: 1 };
const collapsed = new Set();
let places = new Map();
let rowHeight = CLOSEST;
let focused = 0;
const marks = []; // what else marks nodes, each time they are drawn anew
const POINTER = "M0 0L9 -6V6Z"; // at a node that the verdict names
const linked = (link) => Number(/^#node-(\d+)$/.exec(link.hash)?.[1] ?? NaN);
const pointed = new Set([...document.querySelectorAll(".verdict a")].map(linked));

/** Return whether a visible node is named by the verdict, or hides one that is. */
function isPointedAt(node) {
  const hides = (end) => !isOpen(node) && end < nNodes && pathTo(end).includes(node);
  return pointed.has(node) || [...pointed].some(hides);
}

const measure = document.createElement("canvas").getContext("2d");

/** Return the width of a text as it will be drawn. */
function textWidth(text, font) {
  measure.font = `${font} system-ui, "Segoe UI", Helvetica, Arial, sans-serif`;
  return measure.measureText(text).width;
}

const cut = (text, longest = 40) => (text.length > longest ? `${text.slice(0, longest - 1)}…` : text);
const isOpen = (node) => !isLeaf(node) && !collapsed.has(node);

/** Return the visible nodes, parents first, the left branch before the right one. */
function visibleNodes() {
  const found = [];
  const work = [0];
  while (work.length) {
    const node = work.pop();
    found.push(node);
    if (isOpen(node)) work.push(tree.right[node], tree.left[node]);
  }
  return found;
}

/** Return the two lines on a test, the words that `answerOf` answers: what is asked about, and what
 * of it. The first is empty where the words are a name alone, as those of a flag are. */
function linesOf(node) {
  const words = wordsOf(node), { group, name } = features[tree.feature[node]];
  const about = group || name;
  if (!words.startsWith(`${about} `)) return ["", cut(words, 24)];
  return [cut(about, 24), cut(words.slice(about.length + 1), 24)];
}

/** Return what a leaf did before, in a few words; nothing where it decides as before. */
function changeOf(node) {
  const change = isLeaf(node) ? data.changes[tree.leaf[node]] : null;
  if (!change) return "";
  const was = `was ${cut(actions[change.was], 24)}`;
  return change.share > 0.995 ? was : `${was} in ${percent(change.share)}`;
}

/** Return how wide a node's box is: its words, and for a leaf its share of the visits. */
function boxWidth(node) {
  if (!isLeaf(node)) {
    const [name, bound] = linesOf(node);
    return Math.max(textWidth(name, "13px"), textWidth(bound, "600 15px")) + 2 * PADDING + KNOB;
  }
  const words = textWidth(cut(wordsOf(node)), "600 15px") + textWidth(saidShare(node), "13px");
  return Math.max(words, textWidth(changeOf(node), "13px")) + 2 * PADDING + 8 + 120 * shareOf(node);
}

/** Compute where each visible node stands: a row for each end, columns by depth. */
function placeNodes() {
  const nodes = visibleNodes();
  const widest = [];
  places = new Map();
  let row = 0;
  for (const node of nodes) {
    const width = boxWidth(node);
    const depth = depthOf[node];
    if (isOpen(node)) widest[depth] = Math.max(widest[depth] ?? 0, width);
    else widest[depth] = Math.max(widest[depth] ?? 0, Math.min(width, 120));
    places.set(node, { width, y: isOpen(node) ? 0 : (row++ + 0.5) * rowHeight });
  }
  const starts = [0];
  for (const width of widest) starts.push(starts[starts.length - 1] + width + GAP);
  for (const node of [...nodes].reverse()) {
    const place = places.get(node);
    place.x = starts[depthOf[node]];
    if (isOpen(node)) {
      place.y = (places.get(tree.left[node]).y + places.get(tree.right[node]).y) / 2;
    }
  }
}

/** Return the extent of the drawing. */
function extent() {
  let width = 0;
  let height = 0;
  for (const { x, y, width: w } of places.values()) {
    width = Math.max(width, x + w + 30);
    height = Math.max(height, y + rowHeight / 2);
  }
  return { width, height };
}

/** Draw all visible nodes and branches anew. */
function drawTree() {
  placeNodes();
  if (!places.has(focused)) focused = pathTo(focused).filter((node) => places.has(node)).pop();
  const edges = [];
  const nodes = [];
  for (const [node, place] of places) {
    nodes.push(drawNode(node, place));
    if (isOpen(node)) edges.push(...drawBranch(node, true), ...drawBranch(node, false));
  }
  byId("edges").replaceChildren(...edges);
  byId("nodes").replaceChildren(...nodes);
  document.body.dataset.visible = places.size;
  markTree();
  for (const mark of marks) mark();
}

/** Return the curve to a child and the answer beside it. */
function drawBranch(node, isLeft) {
  const child = isLeft ? tree.left[node] : tree.right[node];
  const from = places.get(node);
  const to = places.get(child);
  const start = from.x + from.width + KNOB;
  const bend = (start + to.x) / 2;
  const width = 1.3 + 8 * shareOf(child);
  return [
    drawing("path", {
      class: "edge", "data-child": child, "stroke-width": width.toFixed(2),
      d: `M${start} ${from.y}C${bend} ${from.y} ${bend} ${to.y} ${to.x} ${to.y}`,
    }),
    drawing("text", {
      class: "answer", "data-child": child, x: to.x - 6, "text-anchor": "end",
      y: isLeft ? to.y - 5 - width / 2 : to.y + 12 + width / 2,
    }, answerOf(node, isLeft)),
  ];
}

/** Return a node as an item of the ARIA tree. */
function drawNode(node, { x, y, width }) {
  const leaf = isLeaf(node);
  const siblings = node === 0 ? [0] : childrenOf(parentOf[node]);
  const change = changeOf(node);
  const words = leaf
    ? `${wordsOf(node)}${saidShare(node)}${change && ` ${change},`}${visitsOf[0] ? " of visits" : ""}, leaf ${tree.leaf[node]}`
    : `${wordsOf(node)}?`;
  const answer = node === 0 ? "" : `${answerOf(parentOf[node], siblings[0] === node)}: `;
  const group = drawing("g", {
    class: leaf ? "node leaf" : "node", role: "treeitem", "data-node": node,
    "aria-label": answer + words, "aria-level": depthOf[node] + 1, "aria-setsize": siblings.length,
    "aria-posinset": siblings.indexOf(node) + 1, tabindex: node === focused ? 0 : -1,
    transform: `translate(${x} ${y})`,
  });
  const height = !leaf ? TEST_BOX : change ? CHANGED_BOX : LEAF_BOX;
  const box = drawing("rect", { class: "box", y: -height / 2, width, height, rx: leaf ? height / 2 : 7 });
  const ring = drawing("rect", { class: "ring", x: -4, y: -height / 2 - 4, width: width + 8, height: height + 8, rx: leaf ? height / 2 + 4 : 10 });
  group.append(ring, box);
  if (leaf) {
    box.style.fill = fills[data.leafActions[tree.leaf[node]]];
    const label = drawing("text", { x: width / 2, y: change ? -2 : 5, "text-anchor": "middle" }, cut(wordsOf(node)));
    if (visitsOf[0]) label.append(" ", drawing("tspan", { class: "share", dx: 2 }, saidShare(node).trim()));
    group.append(label);
    if (change) {
      group.classList.add("changed");
      group.append(drawing("text", { class: "was", x: width / 2, y: 15, "text-anchor": "middle" }, change));
    }
  } else {
    group.setAttribute("aria-expanded", isOpen(node));
    group.append(...drawLines(node, (width - KNOB) / 2), drawKnob(node, width));
  }
  if (isPointedAt(node)) {
    const after = width + (leaf ? 6 : KNOB + 4);
    group.append(drawing("path", { class: "pointed", d: POINTER, transform: `translate(${after} 0)` }));
  }
  group.append(drawing("title", {}, leaf ? words : wordsOf(node)));
  return group;
}

/** Return the lines on a test. */
function drawLines(node, x) {
  const [name, bound] = linesOf(node);
  return [
    ...(name ? [drawing("text", { class: "name", x, y: -5, "text-anchor": "middle" }, name)] : []),
    drawing("text", { class: "bound", x, y: name ? 14 : 5, "text-anchor": "middle" }, bound),
  ];
}

/** Return the little circle that opens and closes what is below a node. */
function drawKnob(node, width) {
  const sign = isOpen(node) ? "M-3.5 0H3.5" : "M-3.5 0H3.5M0 -3.5V3.5";
  return drawing("g", { class: "knob", "data-knob": node, transform: `translate(${width} 0)` },
    drawing("circle", { class: "reach", r: 14 }), drawing("circle", { r: KNOB }), drawing("path", { d: sign }));
}

/** Mark the live path, the selected node and what the search found. */
function markTree() {
  const leaf = liveLeaf();
  const path = new Set(leaf === null ? [] : pathTo(nodeOfLeaf[leaf]));
  for (const part of byId("edges").children) {
    part.classList.toggle("live", path.has(Number(part.dataset.child)));
  }
  for (const group of byId("nodes").children) {
    const node = Number(group.dataset.node);
    group.classList.toggle("live", path.has(node));
    group.classList.toggle("selected", node === state.selected);
    group.setAttribute("aria-selected", node === state.selected);
  }
  for (const part of byId("edges").querySelectorAll("path.live")) part.parentNode.append(part);
}

/** Open or close what is below a node. */
function toggle(node, open = collapsed.has(node)) {
  if (isLeaf(node)) return;
  if (open) collapsed.delete(node);
  else collapsed.add(node);
  const before = places.get(node);
  drawTree();
  const after = places.get(node);
  view.x += (before.x - after.x) * view.scale;
  view.y += (before.y - after.y) * view.scale;
  applyView();
}

/** Open all that hides a node. */
function reveal(node) {
  if (places.has(node)) return;
  for (const above of pathTo(node).slice(0, -1)) collapsed.delete(above);
  drawTree();
}

/** Put the view's transformation on the drawing. */
function applyView() {
  byId("view").setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.scale})`);
}

/** Return what the buttons take below the drawing where they lie over it, and as much above. */
const room = () => (getComputedStyle(document.querySelector(".tools")).position === "absolute" ? ROOM : 16);

/** Show the whole tree, but never larger than life; rows spread where there is room. */
function fit(smallest = 0) {
  const { clientWidth, clientHeight } = canvas;
  const across = Math.min(LARGEST, (clientWidth - 32) / extent().width);
  const nRows = [...places.keys()].filter((node) => !isOpen(node)).length;
  const wanted = (clientHeight - 2 * room()) / Math.max(smallest, across) / nRows;
  rowHeight = Math.min(WIDEST, Math.max(CLOSEST, wanted));
  drawTree();
  const { width, height } = extent();
  view.scale = Math.max(smallest, Math.min(across, (clientHeight - 2 * room()) / height));
  const wide = width * view.scale > clientWidth - 32;
  view.x = wide ? 16 : (clientWidth - width * view.scale) / 2;
  const tall = height * view.scale > clientHeight;
  view.y = tall ? clientHeight / 2 - places.get(0).y * view.scale : (clientHeight - height * view.scale) / 2;
  applyView();
}

/** Return the scale at which all that is visible fits, with rows as close as they may be. */
function scaleThatFits() {
  rowHeight = CLOSEST;
  placeNodes();
  const { width, height } = extent();
  return Math.min((canvas.clientWidth - 32) / width, (canvas.clientHeight - 2 * room()) / height);
}

/** Fold nothing where the whole tree can be read, else open what is reached most as long as that can. */
function openToFit(legible) {
  if (scaleThatFits() >= legible) return;
  const size = new Array(nNodes).fill(1); // leaves below each node
  for (let node = nNodes - 1; node >= 0; node--) {
    if (!isLeaf(node)) {
      size[node] = size[tree.left[node]] + size[tree.right[node]];
      if (node) collapsed.add(node);
    }
  }
  const named = new Set([...pointed].flatMap((node) => (node < nNodes ? pathTo(node) : [])));
  const weight = (node) => (visitsOf[0] ? shareOf(node) : size[node] / nLeaves) + named.has(node);
  const work = childrenOf(0);
  while (work.length) {
    const node = work.splice(work.indexOf(work.reduce((most, other) => (weight(other) > weight(most) ? other : most))), 1)[0];
    if (isLeaf(node) || weight(node) < RARE) continue;
    collapsed.delete(node);
    if (scaleThatFits() < legible) collapsed.add(node);
    else work.push(...childrenOf(node));
  }
  placeNodes();
}

/** Zoom by a factor around a point of the canvas. */
function zoom(factor, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) {
  const scale = Math.min(4, Math.max(0.05, view.scale * factor));
  view.x = x - ((x - view.x) * scale) / view.scale;
  view.y = y - ((y - view.y) * scale) / view.scale;
  view.scale = scale;
  applyView();
}

/** Move the view as little as it takes to see a node whole; a row out of sight comes to the middle. */
function bringIntoView(node) {
  const { x, y, width } = places.get(node);
  const left = view.x + x * view.scale;
  const right = left + (width + KNOB) * view.scale;
  const middle = view.y + y * view.scale;
  const half = (TEST_BOX / 2) * view.scale;
  if (right > canvas.clientWidth) view.x -= right - canvas.clientWidth + 20;
  if (left < 0 || right - left > canvas.clientWidth) view.x += 20 - left;
  if (middle < half || middle > canvas.clientHeight - half) view.y += canvas.clientHeight / 2 - middle;
  applyView();
}

/** Give the keyboard's focus to a node. */
function focusNode(node) {
  byId("nodes").querySelector(`[data-node="${focused}"]`)?.setAttribute("tabindex", -1);
  focused = node;
  const group = byId("nodes").querySelector(`[data-node="${node}"]`);
  group.setAttribute("tabindex", 0);
  group.focus({ preventScroll: true });
  bringIntoView(node);
}

byId("nodes").addEventListener("keydown", (event) => {
  const nodes = visibleNodes();
  const at = nodes.indexOf(focused);
  const moves = {
    ArrowDown: () => focusNode(nodes[Math.min(at + 1, nodes.length - 1)]),
    ArrowUp: () => focusNode(nodes[Math.max(at - 1, 0)]),
    Home: () => focusNode(nodes[0]),
    End: () => focusNode(nodes[nodes.length - 1]),
    ArrowRight: () => {
      if (isLeaf(focused)) return;
      if (isOpen(focused)) focusNode(tree.left[focused]);
      else {
        toggle(focused);
        focusNode(focused);
      }
    },
    ArrowLeft: () => {
      if (isOpen(focused)) {
        toggle(focused);
        focusNode(focused);
      } else if (focused !== 0) focusNode(parentOf[focused]);
    },
    Enter: () => show({ selected: focused }),
    " ": () => show({ selected: focused }),
  };
  if (!moves[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  event.stopPropagation();
  moves[event.key]();
});

/* Pointers: one drags, two pinch; a press that does not move is a click. */
const pointers = new Map();
let moved = 0;

canvas.addEventListener("pointerdown", (event) => {
  if (event.button > 0) return;
  pointers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
  if (pointers.size === 1) moved = 0;
});
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const box = canvas.getBoundingClientRect();
  const now = { x: event.clientX - box.left, y: event.clientY - box.top };
  const other = [...pointers.entries()].find(([id]) => id !== event.pointerId)?.[1];
  if (other) {
    const distance = (point) => Math.hypot(point.x - other.x, point.y - other.y) || 1;
    zoom(distance(now) / distance(before), other.x, other.y);
    moved = 99;
  } else {
    moved += Math.abs(now.x - before.x) + Math.abs(now.y - before.y);
    if (moved > 4) {
      if (!canvas.hasPointerCapture(event.pointerId)) canvas.setPointerCapture(event.pointerId);
      canvas.classList.add("moving");
      view.x += now.x - before.x;
      view.y += now.y - before.y;
      applyView();
    }
  }
  pointers.set(event.pointerId, now);
});
for (const name of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(name, (event) => {
    pointers.delete(event.pointerId);
    canvas.classList.remove("moving");
  });
}
canvas.addEventListener("click", (event) => {
  if (moved > 4) return;
  const knob = event.target.closest("[data-knob]");
  const group = event.target.closest("[data-node]");
  if (knob) {
    const node = Number(knob.dataset.knob);
    focused = node;
    toggle(node);
  } else if (group) {
    focusNode(Number(group.dataset.node));
    show({ selected: focused });
  }
});
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const box = canvas.getBoundingClientRect();
  zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), event.clientX - box.left, event.clientY - box.top);
}, { passive: false });

byId("zoom-in").addEventListener("click", () => zoom(1.25));
byId("zoom-out").addEventListener("click", () => zoom(0.8));
byId("fit").addEventListener("click", () => fit());
byId("expand-all").addEventListener("click", () => {
  collapsed.clear();
  drawTree();
  fit();
});
byId("collapse-all").addEventListener("click", () => {
  for (let node = 0; node < nNodes; node++) if (!isLeaf(node) && depthOf[node] >= 2) collapsed.add(node);
  drawTree();
  fit();
});
byId("tree-panel").addEventListener("keydown", (event) => {
  const keys = { "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), 0: () => fit() };
  if (keys[event.key] && !event.ctrlKey && !event.metaKey) keys[event.key]();
});

/** Select a node and bring it before the reader's eyes. */
function point(node) {
  reveal(node);
  show({ selected: node });
  bringIntoView(node);
  byId("tree-panel").scrollIntoView({ block: "nearest" });
}

/** Follow a link to a node, such as #node-12. */
function follow(link) {
  const node = linked(link);
  if (node < nNodes) point(node);
}
addEventListener("hashchange", () => follow(location));
document.addEventListener("click", (event) => {
  const link = event.target.closest('a[href^="#node-"]');
  if (link && link.hash === location.hash) follow(link);
});

const pointer = drawing("svg", { viewBox: "0 -6 9 12", "aria-hidden": "true" }, drawing("path", { class: "pointed", d: POINTER }));
if (data.levels) byId("key").append(element("li", {}, data.levels.label));
byId("key").append(...actions.map((name, action) => element("li", { title: name }, swatch(action), data.levels?.texts[action] ?? name)));
if (Object.keys(data.changes).length) {
  byId("key").append(element("li", {}, element("span", { class: "swatch outlined" }), "decided otherwise before"));
}
if ([...pointed].some((node) => node < nNodes)) {
  byId("key").append(element("li", {}, pointer, "named in the headline"));
}
