"use strict";
/* The policy and its episodes as the page was given them, and what follows from them. */

const data = JSON.parse(document.getElementById("data").textContent);
const { tree, features, actions, fills } = data;
const nNodes = tree.feature.length;
const nLeaves = data.leafActions.length;

const isLeaf = (node) => tree.feature[node] < 0;
const childrenOf = (node) => (isLeaf(node) ? [] : [tree.left[node], tree.right[node]]);

const parentOf = new Array(nNodes).fill(-1);
const depthOf = new Array(nNodes).fill(0);
const nodeOfLeaf = new Array(nLeaves).fill(0);
for (let node = 0; node < nNodes; node++) {
  if (isLeaf(node)) nodeOfLeaf[tree.leaf[node]] = node;
  for (const child of childrenOf(node)) {
    parentOf[child] = node;
    depthOf[child] = depthOf[node] + 1;
  }
}

/** Return the nodes from the root to a node, both included. */
function pathTo(node) {
  const nodes = [];
  for (let at = node; at >= 0; at = parentOf[at]) nodes.unshift(at);
  return nodes;
}

/** Return the numbers of the leaves below a node. */
function leavesBelow(node) {
  const found = [];
  const work = [node];
  while (work.length) {
    const at = work.pop();
    if (isLeaf(at)) found.push(tree.leaf[at]);
    else work.push(tree.right[at], tree.left[at]);
  }
  return found;
}

/** Return the interval (low, high] of each feature in which observations reach a node. */
function boxOf(node) {
  const box = features.map(() => [-Infinity, Infinity]);
  const path = pathTo(node);
  for (let k = 0; k + 1 < path.length; k++) {
    const at = path[k];
    const bounds = box[tree.feature[at]];
    if (path[k + 1] === tree.left[at]) bounds[1] = Math.min(bounds[1], tree.threshold[at]);
    else bounds[0] = Math.max(bounds[0], tree.threshold[at]);
  }
  return box;
}

/** Return the leaf of an observation; NaN fails every test, as in the policy. */
function leafOf(observation) {
  let node = 0;
  while (!isLeaf(node)) {
    node = observation[tree.feature[node]] <= tree.threshold[node] ? tree.left[node] : tree.right[node];
  }
  return tree.leaf[node];
}

const endless = new Map([[Infinity, "∞"], [-Infinity, "-∞"]]);

/** Return a number with four significant digits, as people write it; what only rounding left is 0. */
function short(value) {
  if (!Number.isFinite(value)) return endless.get(value) ?? "unknown";
  return Math.abs(value) < 1e-12 ? "0" : String(Number(value.toPrecision(4)));
}

/** Return a value of a feature in the digits that matter. */
function digits(value, feature) {
  if (!Number.isFinite(value)) return endless.get(value) ?? "unknown";
  return String(Number(value.toFixed(features[feature].decimals)) + 0);
}

/* The words of each test and of its opposite, by feature and threshold; those of moved ones are new. */
const testWords = new Map();
tree.feature.forEach((feature, node) => data.tests[node] && testWords.set(`${feature} ${tree.threshold[node]}`, data.tests[node]));
const atMost = (feature, threshold) => testWords.get(`${feature} ${threshold}`)?.[0] ?? `≤ ${threshold}`;
const above = (feature, threshold) => testWords.get(`${feature} ${threshold}`)?.[1] ?? `> ${threshold}`;
const testOf = (node) => atMost(tree.feature[node], tree.threshold[node]);

const withUnit = (text, feature) => (features[feature].unit ? `${text} ${features[feature].unit}` : text);

/** Return a value of a feature as it is called: a category, yes or no, or a number with its unit. */
function valueWords(value, feature) {
  const one = features[feature];
  if (Number.isFinite(value) && (one.flag || one.group)) return value > 0 ? "yes" : "no";
  return one.categories?.[value - one.low] ?? withUnit(digits(value, feature), feature);
}

/** Return which categories are meant, or which are not where those are fewer. */
function choiceOf(name, told, others) {
  return others.length < told.length ? `${name} is not ${others.join(",")}` : `${name} is ${told.join(",")}`;
}

/** Return the whole numbers of (low, high] in the words of their kind; nothing of all or of none. */
function wholeWords(feature, low, high, one = features[feature]) {
  if (!one.whole) return "";
  const first = Math.max(one.low ?? -Infinity, Math.floor(low) + 1);
  const last = Math.min(one.high ?? Infinity, Math.floor(high));
  if (first > last || (first === (one.low ?? -Infinity) && last === (one.high ?? Infinity))) return "";
  if (one.group) return `${one.group} is ${first > 0 ? "" : "not "}${one.category}`;
  if (one.flag) return first > 0 ? one.name : `not ${one.name}`;
  if (one.categories.length) {
    const isTold = (_, code) => code + one.low >= first && code + one.low <= last;
    return choiceOf(one.name, one.categories.filter(isTold), one.categories.filter((...x) => !isTold(...x)));
  }
  if (first === last) return withUnit(`${one.name} = ${first}`, feature);
  const test = first > (one.low ?? -Infinity) ? (last < (one.high ?? Infinity) ? `≥ ${first} and ≤ ${last}` : `≥ ${first}`) : `≤ ${last}`;
  return withUnit(`${one.name} ${test}`, feature);
}

/** Return the feature that a node tests, with the categories alone that the tests above leave. */
function askedAt(node) {
  const feature = tree.feature[node], one = features[feature], cut = Math.floor(tree.threshold[node]);
  if (!one.categories?.length) return one;
  let low = one.low, high = one.high;
  for (let child = node, above = parentOf[child]; above >= 0; child = above, above = parentOf[child]) {
    if (tree.feature[above] !== feature) continue;
    const bound = Math.floor(tree.threshold[above]);
    if (tree.left[above] === child) high = Math.min(high, bound);
    else low = Math.max(low, bound + 1);
  }
  if (cut < low || cut >= high) return one;
  return {...one, low, high, categories: one.categories.slice(low - one.low, high - one.low + 1)};
}

/** Return whether a test is asked for its right branch: "open ?", and not "not open ?". */
function isReversed(node) {
  const one = askedAt(node), threshold = tree.threshold[node];
  if (one.categories?.length) {
    const nLeft = Math.floor(threshold) - one.low + 1;
    return one.categories.length / 2 < nLeft && nLeft < one.categories.length;
  }
  return Boolean(one.flag || one.group) && threshold >= 0 && threshold < 1;
}

/** Return which answer to the test of a node leads to its left, or its right, branch. */
const answerOf = (node, isLeft) => (isLeft !== isReversed(node) ? "yes" : "no");

/** Return the short words on a node. */
function wordsOf(node) {
  if (isLeaf(node)) return actions[data.leafActions[tree.leaf[node]]];
  const feature = tree.feature[node];
  const sides = isReversed(node) ? [tree.threshold[node], Infinity] : [-Infinity, tree.threshold[node]];
  const own = wholeWords(feature, ...sides, askedAt(node));
  if (own) return own;
  return withUnit(`${features[feature].name} ${testOf(node)}`, feature);
}

/** Return a box as conditions in words, one for each feature that it bounds. */
function conditionsOf(node) {
  const words = [], box = boxOf(node);
  const groups = new Set(features.map((one) => one.group).filter(Boolean));
  for (const group of groups) {
    const members = [...features.keys()].filter((feature) => features[feature].group === group);
    const chosen = members.filter((feature) => box[feature][0] >= 0);
    const left = chosen.length ? chosen : members.filter((feature) => box[feature][1] >= 1);
    const named = (list) => list.map((feature) => features[feature].category);
    if (left.length < members.length) {
      words.push(choiceOf(group, named(left), named(members.filter((feature) => !left.includes(feature)))));
    }
  }
  box.forEach(([low, high], feature) => {
    const name = features[feature].name;
    if (features[feature].group) return;
    const own = wholeWords(feature, low, high);
    if (own) words.push(own);
    else if (low > -Infinity && high < Infinity) {
      words.push(withUnit(`${name} ${above(feature, low)} and ${atMost(feature, high)}`, feature));
    } else if (low > -Infinity) words.push(withUnit(`${name} ${above(feature, low)}`, feature));
    else if (high < Infinity) words.push(withUnit(`${name} ${atMost(feature, high)}`, feature));
  });
  return words;
}

/** Return, for each leaf, the steps of some episodes that fell in it. */
function stepsByLeaf(episodes) {
  const steps = Array.from({ length: nLeaves }, () => []);
  episodes.forEach((episode, number) => {
    if (episode.own === false) return; // what others earned says nothing of this policy
    let rest = 0;
    for (let step = episode.actions.length - 1; step >= 0; step--) {
      rest += episode.rewards[step]; // no number where a log has no rewards
      steps[episode.leaves[step]].unshift({
        episode: number, step, action: episode.actions[step], rest,
      });
    }
  });
  for (const entries of steps) entries.sort((a, b) => a.episode - b.episode || a.step - b.step);
  return steps;
}

/* The policy as it came; `tree.threshold` and `data.leafActions` change with what a person edits. */
const original = { threshold: [...tree.threshold], leafActions: [...data.leafActions] };
for (const episode of data.episodes) episode.recorded = episode.leaves;
const valuesOf = (row) => row.map((value) => (value === null ? NaN : Number(value))); // infinite ones are words
const isMoved = () => tree.threshold.some((threshold, node) => threshold !== original.threshold[node]);
const isKept = (leaf) => data.leafActions[leaf] === original.leafActions[leaf];
const isRelabelled = () => !nodeOfLeaf.every((_, leaf) => isKept(leaf));

/** Return the order in which a leaf prefers the actions under masks, its own first, once it is edited.
 *
 * One that keeps its action keeps its order, as in `with_actions` of `eutree.policies.reach`; that of
 * others follows from what is known, as in `orders_of` of `eutree.policies.leaf_statistics`. */
function orderOf(leaf) {
  if (isKept(leaf)) return data.orders[leaf];
  const { values, visits } = data.document.leaves[leaf];
  const near = pathTo(nodeOfLeaf[leaf]).reverse().map((node) => { // leaves of each action below the nodes above
    const counts = actions.map(() => 0);
    for (const other of leavesBelow(node)) counts[data.leafActions[other]]++;
    return counts;
  });
  const keys = actions.map((_, action) => {
    const isOwn = action === data.leafActions[leaf], known = values?.[action] ?? null;
    const level = near.filter((counts) => counts[action] === 0).length; // they never fall on the way up
    return [isOwn ? 0 : 1, known === null ? 1 : 0, -(known ?? 0), -(visits?.[action] ?? 0), level, -(near[level]?.[action] ?? 0), action];
  });
  const compare = (one, other) => one.map((key, k) => key - other[k]).find((difference) => difference !== 0) ?? 0;
  return keys.sort(compare).map((key) => key[key.length - 1]);
}

let statistics, episodeSteps, demonstrationSteps, orders;
const visitsOf = new Array(nNodes).fill(0);

/** Count anew what fell in which leaf; counts from other boxes say nothing once a test is moved. */
function recount() {
  const moved = isMoved();
  for (const episode of data.episodes) {
    episode.leaves = moved ? episode.observations.map((row) => leafOf(valuesOf(row))) : episode.recorded;
  }
  statistics = moved ? null : data.leaves;
  orders = data.orders && nodeOfLeaf.map((_, leaf) => orderOf(leaf));
  episodeSteps = stepsByLeaf(data.episodes);
  demonstrationSteps = stepsByLeaf(moved ? [] : data.demonstrations);
  const leafVisits = data.visits ? data.visits : statistics
    ? statistics.visits.map((row) => row.reduce((a, b) => a + b, 0))
    : episodeSteps.map((steps, leaf) => steps.length + demonstrationSteps[leaf].length);
  for (let node = nNodes - 1; node >= 0; node--) {
    visitsOf[node] = isLeaf(node)
      ? leafVisits[tree.leaf[node]]
      : visitsOf[tree.left[node]] + visitsOf[tree.right[node]];
  }
}
recount();

/** Return the first action of an order that a mask of 0 and 1 allows. */
const allowedIn = (order, mask) => order.find((action) => mask[action] === "1");

/** Return what the policy decides at a step of an episode as it came, and as it is now. */
function decisions(episode, step) {
  const [before, after, mask] = [episode.recorded[step], episode.leaves[step], episode.allowed?.[step]];
  if (!mask) return [original.leafActions[before], data.leafActions[after]];
  return [allowedIn(data.orders[before], mask), allowedIn(orders[after], mask)];
}

const shareOf = (node) => visitsOf[node] / Math.max(1, visitsOf[0]);

/** Return a node's share of the visits in words; nothing where no visit is known. */
const saidShare = (node) => (visitsOf[0] ? ` ${percent(shareOf(node))}` : "");

/** Return a share as a percentage. */
function percent(share) {
  const value = 100 * share;
  return `${value === 0 || value >= 1 ? value.toFixed(0) : value.toPrecision(1)} %`;
}

/* What is shown: changed only through `show`, and told to everything that draws. */
const state = { episode: 0, step: 0, selected: null };
const listeners = [];
const onChange = (listener) => listeners.push(listener);

/** Change some of the state, publish it on the body, and let everything draw it. */
function show(change) {
  Object.assign(state, change);
  const root = document.body.dataset;
  root.episode = state.episode;
  root.step = state.step;
  root.selected = state.selected === null ? "" : state.selected;
  root.leaf = liveLeaf() ?? "";
  for (const listener of listeners) listener(change);
}

const episodeNow = () => data.episodes[state.episode] ?? null;
const liveLeaf = () => episodeNow()?.leaves[state.step] ?? null;
const shownNode = () => state.selected ?? (liveLeaf() === null ? 0 : nodeOfLeaf[liveLeaf()]);

/** Return the values of the present step, or the middle of what is possible. */
function observationNow() {
  const episode = episodeNow();
  return episode
    ? valuesOf(episode.observations[state.step])
    : ranges.map(([low, high]) => (low + high) / 2);
}

/* The interval of each feature worth drawing: its bounds, or what was seen and tested. */
const ranges = features.map((feature, index) => {
  if (feature.low !== null && feature.high !== null && feature.high - feature.low < 1e6) {
    return [feature.low, feature.high];
  }
  let low = Infinity;
  let high = -Infinity;
  const see = (value) => {
    if (!Number.isFinite(value)) return;
    low = Math.min(low, value);
    high = Math.max(high, value);
  };
  tree.feature.forEach((tested, node) => tested === index && see(tree.threshold[node]));
  for (const episode of data.episodes) for (const row of episode.observations) see(row[index]);
  if (low > high) [low, high] = [-1, 1];
  const margin = (high - low) * 0.06 || 1;
  return [low - margin, high + margin];
});

/** Return a new element of the page; text is never read as HTML. */
function element(name, attributes = {}, ...content) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...content);
  return made;
}

/** Return a new element of a drawing. */
function drawing(name, attributes = {}, ...content) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...content);
  return made;
}

const byId = (id) => document.getElementById(id);

/** Return a dot in the colour of an action. */
function swatch(action) {
  const dot = element("span", { class: "swatch" });
  dot.style.background = fills[action];
  return dot;
}
