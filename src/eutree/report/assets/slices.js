"use strict";
/* The policy in the plane of two attributes: exact, a rectangle for each piece of a leaf. */

const slice = byId("slice");
const AXIS = { left: 46, bottom: 34, top: 6, right: 8 };

/** Return the leaves that cut the plane, each with its rectangle in the features' units. */
function rectangles(x, y, observation) {
  const found = [];
  const work = [[0, ranges[x][0], ranges[x][1], ranges[y][0], ranges[y][1]]];
  while (work.length) {
    const [node, left, right, low, high] = work.pop();
    if (isLeaf(node)) {
      found.push({ leaf: tree.leaf[node], left, right, low, high });
      continue;
    }
    const feature = tree.feature[node];
    const at = features[feature].whole ? Math.floor(tree.threshold[node]) + 0.5 : tree.threshold[node]; // as `under` rounds
    if (feature === x) {
      if (left <= at) work.push([tree.left[node], left, Math.min(right, at), low, high]);
      if (right > at) work.push([tree.right[node], Math.max(left, at), right, low, high]);
    } else if (feature === y) {
      if (low <= at) work.push([tree.left[node], left, right, low, Math.min(high, at)]);
      if (high > at) work.push([tree.right[node], left, right, Math.max(low, at), high]);
    } else {
      work.push([observation[feature] <= at ? tree.left[node] : tree.right[node], left, right, low, high]);
    }
  }
  return found;
}

const chosen = () => [Number(byId("slice-x").value), Number(byId("slice-y").value)];

/** Return the functions from the features' units to pixels. */
function scales(x, y) {
  const width = slice.clientWidth - AXIS.left - AXIS.right;
  const height = slice.clientHeight - AXIS.top - AXIS.bottom;
  const [[left, right], [low, high]] = [ranges[x], ranges[y]];
  return {
    toX: (value) => AXIS.left + ((value - left) / (right - left)) * width,
    toY: (value) => AXIS.top + ((high - value) / (high - low)) * height,
    fromX: (pixel) => left + ((pixel - AXIS.left) / width) * (right - left),
    fromY: (pixel) => high - ((pixel - AXIS.top) / height) * (high - low),
  };
}

/** Draw the slice through the present step. */
function drawSlice() {
  if (!slice.clientWidth) return;
  const [x, y] = chosen();
  const { toX, toY } = scales(x, y);
  const observation = observationNow();
  const ratio = window.devicePixelRatio || 1;
  slice.width = slice.clientWidth * ratio;
  slice.height = slice.clientHeight * ratio;
  const pen = slice.getContext("2d");
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  pen.scale(ratio, ratio);
  const node = shownNode();
  const marked = new Set(leavesBelow(node));
  for (const { leaf, left, right, low, high } of rectangles(x, y, observation)) {
    pen.fillStyle = fills[data.leafActions[leaf]];
    pen.globalAlpha = marked.has(leaf) ? 1 : 0.55;
    pen.fillRect(toX(left), toY(high), toX(right) - toX(left), toY(low) - toY(high));
    pen.globalAlpha = 1;
    pen.strokeStyle = colour("--paper");
    pen.lineWidth = 1;
    pen.strokeRect(toX(left), toY(high), toX(right) - toX(left), toY(low) - toY(high));
  }
  drawAxes(pen, x, y, colour);
  if (x !== y && episodeNow()) {
    pen.beginPath();
    pen.arc(toX(observation[x]), toY(observation[y]), 6, 0, 7);
    pen.fillStyle = colour("--live");
    pen.fill();
    pen.strokeStyle = "#ffffff";
    pen.lineWidth = 2;
    pen.stroke();
  }
  slice.setAttribute("aria-label", `Slice of the policy: ${features[x].name} across, ${features[y].name} up; at the present step it takes ${actions[data.leafActions[leafOf(observation)]]}`);
}

/** Return the name and the unit of a feature. */
function axisTitle(feature) {
  const { name, unit } = features[feature];
  return cut(unit ? `${name} [${unit}]` : name);
}

/** Draw names and ends of both axes. */
function drawAxes(pen, x, y, colour) {
  const { clientWidth: width, clientHeight: height } = slice;
  pen.fillStyle = colour("--quiet");
  pen.font = '11px system-ui, "Segoe UI", Helvetica, Arial, sans-serif';
  const bottom = height - AXIS.bottom + 14;
  pen.textAlign = "left";
  pen.fillText(digits(ranges[x][0], x), AXIS.left, bottom);
  pen.textAlign = "right";
  pen.fillText(digits(ranges[x][1], x), width - AXIS.right, bottom);
  pen.fillText(digits(ranges[y][1], y), AXIS.left - 5, AXIS.top + 10);
  pen.fillText(digits(ranges[y][0], y), AXIS.left - 5, height - AXIS.bottom);
  pen.textAlign = "center";
  pen.fillText(axisTitle(x), (AXIS.left + width) / 2, height - 5);
  pen.save();
  pen.translate(13, (height - AXIS.bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(axisTitle(y), 0, 0);
  pen.restore();
}

/** Return the leaf under the pointer and the words for it, or null outside the plane. */
function under(event) {
  const [x, y] = chosen();
  const { fromX, fromY } = scales(x, y);
  const observation = observationNow();
  observation[x] = fromX(event.offsetX);
  observation[y] = fromY(event.offsetY);
  const inside = [x, y].every((feature) => observation[feature] >= ranges[feature][0] && observation[feature] <= ranges[feature][1]);
  if (!inside) return null;
  for (const feature of [x, y]) if (features[feature].whole) observation[feature] = Math.round(observation[feature]);
  const leaf = leafOf(observation);
  const place = [x, y].map((feature) => `${features[feature].name} ${valueWords(observation[feature], feature)}`).join(", ");
  return { leaf, words: `${place}: ${actions[data.leafActions[leaf]]} (leaf ${leaf})` };
}

/* What a derived feature that is tested is made of is no axis: that would change along it, too. */
const axes = [...features.keys()].filter((index) => !features[index].isPart);
if (axes.length < 2) byId("slices").hidden = true;
const begins = [...axes].sort((one, other) => tree.feature.includes(other) - tree.feature.includes(one));
for (const [id, first] of [["slice-x", begins[0] ?? 0], ["slice-y", begins[1] ?? begins[0] ?? 0]]) {
  byId(id).append(...axes.map((index) => element("option", { value: index }, features[index].name)));
  byId(id).value = first;
  byId(id).addEventListener("change", () => {
    const other = id === "slice-x" ? byId("slice-y") : byId("slice-x");
    if (other.value === byId(id).value) other.value = axes.find((index) => String(index) !== other.value);
    drawSlice();
  });
}
slice.addEventListener("pointermove", (event) => {
  byId("slice-words").textContent = under(event)?.words ?? "";
});
slice.addEventListener("pointerleave", () => {
  byId("slice-words").textContent = "";
});
slice.addEventListener("click", (event) => {
  const found = under(event);
  if (!found) return;
  const node = nodeOfLeaf[found.leaf];
  reveal(node);
  show({ selected: node });
  bringIntoView(node);
});
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawSlice);
onChange(drawSlice);
new ResizeObserver(() => drawSlice()).observe(slice);
