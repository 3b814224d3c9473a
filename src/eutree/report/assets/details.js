"use strict";
/* What is known of a leaf, or of all leaves below a test. */

const Z95 = 1.959964;

/** Return a heading and what stands below it, or nothing where there is nothing to say. */
function part(title, ...content) {
  return [element("h3", {}, title), ...content];
}

/** Draw the details of the selected node, or of the live leaf. */
function drawDetails() {
  const node = shownNode();
  const leaves = leavesBelow(node);
  const title = isLeaf(node) ? `Leaf ${tree.leaf[node]}` : "Test";
  byId("details-title").textContent = state.selected === null && liveLeaf() !== null ? `${title}, live` : title;
  byId("live").hidden = state.selected === null || liveLeaf() === null;
  byId("details-body").replaceChildren(
    heading(node, leaves), ...before(node), conditionList(node), ...visitsAndValues(node, leaves), ...returnsOf(leaves),
    ...demonstrationsIn(leaves), ...episodesThrough(leaves),
  );
}

/** Return the action of a leaf, or the words of a test. */
function heading(node, leaves) {
  const line = element("p");
  if (isLeaf(node)) {
    const action = data.leafActions[tree.leaf[node]];
    const badge = element("span", { class: "badge" }, actions[action]);
    badge.style.background = fills[action];
    line.append(badge);
  } else {
    line.append(element("strong", {}, `${wordsOf(node)}?`), ` ${leaves.length} leaves below. `);
  }
  if (visitsOf[0]) line.append(`${percent(shareOf(node))} of ${visitsOf[0]} ${statistics ? "visits" : "recorded steps"}`);
  return line;
}

/** Return what was decided in a leaf before, where that was something else. */
function before(node) {
  const change = isLeaf(node) ? data.changes[tree.leaf[node]] : null;
  if (!change) return [];
  return [element("p", {}, "Before: ", element("strong", {}, actions[change.was]), ` in ${percent(change.share)} of the steps that were recorded here.`)];
}

/** Return the box of a node in words. */
function conditionList(node) {
  const words = conditionsOf(node);
  if (!words.length) return element("p", { class: "quiet" }, "Every observation comes here.");
  return element("ul", { class: "conditions" }, ...words.map((text) => element("li", {}, text)));
}

/** Return visits of each action tried and, for a leaf, its values with their 95 % intervals. */
function visitsAndValues(node, leaves) {
  if (!statistics) return [];
  const visits = actions.map((_, action) => leaves.reduce((sum, leaf) => sum + statistics.visits[leaf][action], 0));
  const leaf = isLeaf(node) ? tree.leaf[node] : null;
  const head = ["Action", "Visits", ...(leaf === null ? [] : ["Value", "95 % interval"])];
  const tried = actions.map((_, action) => action).filter((action) => visits[action] > 0);
  const never = actions.length - tried.length;
  const rows = tried.map((action) => {
    const row = element("tr", {}, element("th", { scope: "row" }, swatch(action), actions[action]), element("td", {}, String(visits[action])));
    if (leaf !== null) {
      const value = statistics.values[leaf][action];
      row.append(element("td", {}, value === null ? "unknown" : short(value)), element("td", {}, interval(leaf, action)));
    }
    return row;
  });
  return part(leaf === null ? "Visits" : "Visits and values", element("table", {},
    element("thead", {}, element("tr", {}, ...head.map((text) => element("th", { scope: "col" }, text)))),
    element("tbody", {}, ...rows)),
  ...(never ? [element("p", { class: "quiet" }, `Never tried here: ${tried.length ? "the other " : ""}${never} of ${actions.length} actions.`)] : []),
  ...(leaf !== null && tried.length ? [element("p", { class: "quiet" }, `Here ${statistics.meaning}.`)] : []));
}

/** Return a small drawing of one interval on the scale that all actions of the leaf share. */
function interval(leaf, action) {
  const ends = actions.flatMap((_, other) => {
    const value = statistics.values[leaf][other];
    const half = Z95 * (statistics.deviations[leaf][other] ?? 0);
    return value === null ? [] : [value - half, value + half];
  });
  const value = statistics.values[leaf][action];
  const deviation = statistics.deviations[leaf][action];
  if (value === null) return "";
  const low = Math.min(...ends);
  const scale = 96 / (Math.max(...ends) - low || 1);
  const half = Z95 * (deviation ?? 0);
  const words = deviation === null ? "unknown" : `${short(value - half)} to ${short(value + half)}`;
  const x = (number) => 8 + (number - low) * scale;
  return drawing("svg", { class: "range", viewBox: "0 0 112 16", role: "img", "aria-label": words },
    drawing("title", {}, words),
    drawing("line", { x1: x(value - half), x2: x(value + half), y1: 8, y2: 8, stroke: "var(--strong-line)", "stroke-width": 4, "stroke-linecap": "round" }),
    drawing("circle", { cx: x(value), cy: 8, r: 4.5, fill: action === data.leafActions[leaf] ? "var(--live)" : "var(--ink)" }));
}

const earnedIn = (steps) => steps.map(({ rest }) => rest).filter(Number.isFinite);
const allReturns = earnedIn([...episodeSteps, ...demonstrationSteps].flat());
const lowestReturn = allReturns.reduce((a, b) => Math.min(a, b), Infinity);
const highestReturn = allReturns.reduce((a, b) => Math.max(a, b), -Infinity);

/** Return the histogram of what was earned from here to the end of the episode. */
function returnsOf(leaves) {
  if (data.visits) return []; // counted on more than what is played here: too few for a histogram
  if (!allReturns.length) return []; // nothing is played here, as on a run's page, or no reward is known
  const values = earnedIn(leaves.flatMap((leaf) => [...episodeSteps[leaf], ...demonstrationSteps[leaf]]));
  if (!values.length) return part("Returns from here", element("p", { class: "quiet" }, "No recorded step fell in here."));
  const nBins = 24;
  const span = highestReturn - lowestReturn || 1;
  const counts = new Array(nBins).fill(0);
  for (const value of values) counts[Math.min(nBins - 1, Math.floor(((value - lowestReturn) / span) * nBins))]++;
  const most = Math.max(...counts);
  const mean = values.reduce((a, b) => a + b, 0) / values.length;
  const words = `${values.length} recorded steps, mean return ${short(mean)}, from ${short(Math.min(...values))} to ${short(Math.max(...values))}`;
  const bars = counts.map((count, bin) => drawing("rect", {
    x: 4 + bin * 14.5, width: 12.5, y: 70 - (62 * count) / most, height: (62 * count) / most, rx: 1.5,
  }));
  const label = (x, anchor, text) => drawing("text", { x, y: 86, "text-anchor": anchor }, text);
  return part("Returns from here",
    drawing("svg", { class: "histogram", viewBox: "0 0 354 92", role: "img", "aria-label": `Histogram: ${words}` },
      ...bars, drawing("line", { x1: 2, x2: 352, y1: 70.5, y2: 70.5, stroke: "var(--strong-line)" }),
      label(4, "start", short(lowestReturn)), label(350, "end", short(highestReturn))),
    element("p", { class: "quiet" }, words));
}

/** Return runs of consecutive steps as words, for example "4 to 7". */
function runs(steps) {
  const found = [];
  for (const entry of steps) {
    const last = found[found.length - 1];
    if (last && last.episode === entry.episode && last.end + 1 === entry.step && last.action === entry.action) last.end++;
    else found.push({ ...entry, end: entry.step });
  }
  return found;
}

const inOrder = (steps) => steps.sort((a, b) => a.episode - b.episode || a.step - b.step);

/** Return which steps of the demonstrations fell in some leaves, and what the expert did. */
function demonstrationsIn(leaves) {
  if (!data.demonstrations.length || isMoved()) return [];
  const found = runs(inOrder(leaves.flatMap((leaf) => demonstrationSteps[leaf])));
  if (!found.length) return part("Demonstrations", element("p", { class: "quiet" }, "No demonstrated step fell in here."));
  const words = ({ episode, step, end, action }) =>
    `demonstration ${episode}, ${end > step ? `steps ${step} to ${end}` : `step ${step}`}: ${actions[action]}`;
  const items = found.slice(0, 12).map((run) => element("li", {}, words(run)));
  if (found.length > 12) items.push(element("li", {}, `and ${found.length - 12} more`));
  return part("Demonstrations", element("ul", { class: "conditions" }, ...items));
}

/** Return buttons that show where the recorded episodes passed through some leaves. */
function episodesThrough(leaves) {
  if (!data.episodes.length) return [];
  const found = runs(inOrder(leaves.flatMap((leaf) => episodeSteps[leaf])).map((entry) => ({ ...entry, action: 0 })));
  if (!found.length) return part("Episodes", element("p", { class: "quiet" }, "No recorded episode passed through here."));
  const items = found.slice(0, 24).map(({ episode, step, end }) => {
    const words = `${episode + 1}: ${step}${end > step ? `–${end}` : ""}`;
    const button = element("button", { type: "button", "aria-label": `${words}, show episode ${episode + 1} at step ${step}` }, words);
    button.addEventListener("click", () => {
      play(false);
      show({ episode, step });
    });
    return element("li", {}, button);
  });
  if (found.length > 24) items.push(element("li", { class: "quiet" }, `and ${found.length - 24} more`));
  return part("Episodes through here (episode: steps)", element("ul", { class: "links" }, ...items));
}

byId("live").addEventListener("click", () => show({ selected: null }));
onChange(drawDetails);
