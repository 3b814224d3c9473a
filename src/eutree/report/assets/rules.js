"use strict";
/* The rules, which a person may change: thresholds, actions, locks; what that does; the new file. */

const LOCK = "M5 7V5a3 3 0 0 1 6 0v2h1v7H4V7zM6.2 7h3.6V5a1.8 1.8 0 0 0-3.6 0z";
const LOCK_OPEN = "M5 7V5a3 3 0 0 1 5.8-1l-1.1.5A1.8 1.8 0 0 0 6.2 5v2H12v7H4V7z";
const editable = data.document !== null;
const lockedAtFirst = editable ? data.document.leaves.map((leaf) => leaf.locked === true) : [];
let locked = [...lockedAtFirst];
const earlier = [];

const isLocked = (node) => leavesBelow(node).every((leaf) => locked[leaf]);
const holdsLocked = (node) => leavesBelow(node).some((leaf) => locked[leaf]);
const snapshot = () => ({ threshold: [...tree.threshold], leafActions: [...data.leafActions], locked: [...locked] });

/** Take over a policy's changeable parts, and draw everything anew. */
function restore({ threshold, leafActions, locked: now }) {
  threshold.forEach((value, node) => (tree.threshold[node] = value));
  leafActions.forEach((action, leaf) => (data.leafActions[leaf] = action));
  locked = [...now];
  recount();
  drawTree();
  drawRules();
  drawEffects();
  show({});
}

/** Make one change, which can be undone. */
function change(edit) {
  const before = snapshot();
  earlier.push(before);
  const after = { ...before, threshold: [...before.threshold], leafActions: [...before.leafActions], locked: [...before.locked] };
  edit(after);
  byId("rules-problem").textContent = "";
  restore(after);
}

/** Return why a threshold cannot be, or nothing. */
function problemWith(text, feature) {
  const value = Number(text);
  const { name, low, high } = features[feature];
  const bound = (end, none) => (end === null ? none : digits(end, feature));
  if (text.trim() === "" || !Number.isFinite(value)) return `The threshold of ${name} must be a number.`;
  if ((low !== null && value < low) || (high !== null && value > high)) {
    return `The threshold of ${name} must be from ${bound(low, "-∞")} to ${bound(high, "∞")}.`;
  }
  return "";
}

/** Return the button that locks and unlocks all leaves below a node. */
function lockButton(node) {
  const on = isLocked(node);
  const what = isLeaf(node) ? `leaf ${tree.leaf[node]}` : `all below test ${node}`;
  const button = element("button", { type: "button", class: "lock", "aria-pressed": on, "aria-label": `Lock ${what}`, title: `${on ? "Unlock" : "Lock"} ${what}` });
  button.append(drawing("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, drawing("path", { d: on ? LOCK : LOCK_OPEN })));
  button.disabled = !editable;
  button.addEventListener("click", () => change((policy) => {
    for (const leaf of leavesBelow(node)) policy.locked[leaf] = !on;
  }));
  return button;
}

/** Return the words of a test with a field for its threshold. */
function testRule(node) {
  const feature = tree.feature[node];
  const { name, unit } = features[feature];
  const [sign, text] = testOf(node).split(" ");
  const field = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", value: text, "aria-label": `Threshold of ${name}${unit ? ` in ${unit}` : ""}, test ${node}` });
  field.disabled = !editable || holdsLocked(node);
  field.addEventListener("change", () => {
    const problem = problemWith(field.value, feature);
    byId("rules-problem").textContent = problem;
    field.setAttribute("aria-invalid", problem !== "");
    if (!problem && field.value !== text && Number(field.value) !== tree.threshold[node]) {
      change((policy) => (policy.threshold[node] = Number(field.value)));
    }
  });
  return [element("span", { class: "what", title: name }, name), ` ${sign} `, field, unit ? ` ${cut(unit, 8)}` : ""];
}

/** Return the choice of a leaf's action. */
function leafRule(node) {
  const leaf = tree.leaf[node];
  const choice = element("select", { "aria-label": `Action of leaf ${leaf}` },
    ...actions.map((name, action) => element("option", { value: action }, cut(name, 28))));
  choice.value = data.leafActions[leaf];
  choice.disabled = !editable || locked[leaf];
  choice.addEventListener("change", () => change((policy) => (policy.leafActions[leaf] = Number(choice.value))));
  return [swatch(data.leafActions[leaf]), choice, element("span", { class: "quiet" }, ` leaf ${leaf}`)];
}

/** Return one rule of the list. */
function ruleOf(node) {
  const yes = node !== 0 && tree.left[parentOf[node]] === node;
  const answer = element("span", { class: "quiet when" }, node === 0 ? "" : yes ? "yes" : "no");
  const rule = element("li", { "data-rule": node }, answer, ...(isLeaf(node) ? leafRule(node) : testRule(node)), lockButton(node));
  rule.style.paddingLeft = `${Math.min(depthOf[node], 12) * 0.7}rem`;
  const changed = isLeaf(node)
    ? data.leafActions[tree.leaf[node]] !== original.leafActions[tree.leaf[node]]
    : tree.threshold[node] !== original.threshold[node];
  rule.classList.toggle("changed", changed);
  return rule;
}

/** Return all nodes, parents first, "yes" before "no". */
function inReadingOrder() {
  const found = [];
  const work = [0];
  while (work.length) {
    const node = work.pop();
    found.push(node);
    if (!isLeaf(node)) work.push(tree.right[node], tree.left[node]);
  }
  return found;
}

/** Draw the list, if it is open; the keyboard stays where it was. */
function drawRules() {
  if (!byId("rules-fold").open) return;
  const at = document.activeElement?.closest("[data-rule]");
  const place = at && [at.dataset.rule, [...at.querySelectorAll("input, select, button")].indexOf(document.activeElement)];
  byId("rule-list").replaceChildren(...inReadingOrder().map(ruleOf));
  markRules();
  if (place) byId("rule-list").querySelector(`[data-rule="${place[0]}"]`).querySelectorAll("input, select, button")[place[1]]?.focus();
}

/** Mark the rules of the live path. */
function markRules() {
  const leaf = liveLeaf();
  const path = new Set(leaf === null ? [] : pathTo(nodeOfLeaf[leaf]));
  for (const rule of byId("rule-list").children) rule.classList.toggle("live", path.has(Number(rule.dataset.rule)));
}

/** Return the recorded steps that get another action now, by their old and new leaf. */
function changedSteps() {
  const found = new Map();
  let total = 0;
  data.episodes.forEach((episode, number) => {
    for (let step = 0; step < episode.actions.length; step++) {
      total++;
      const [before, after] = [episode.recorded[step], episode.leaves[step]];
      const [old, now] = decisions(episode, step);
      if (old === now) continue;
      const key = `${before} ${after} ${old} ${now}`;
      if (!found.has(key)) found.set(key, { before, after, old, now, steps: [] });
      found.get(key).steps.push({ episode: number, step, action: now });
    }
  });
  return { total, groups: [...found.values()].sort((a, b) => b.steps.length - a.steps.length) };
}

/** Return whether an observation within the bounds, and of the kinds of the features, lies in a box. */
function isPossible(box) {
  const groups = new Map();
  const fits = box.every(([low, high], feature) => {
    const bounds = features[feature];
    const top = Math.min(high, bounds.high ?? Infinity);
    if (bounds.group) groups.set(bounds.group, [...(groups.get(bounds.group) ?? []), [low, high]]);
    if (bounds.whole) return Math.floor(top) >= Math.max(Math.floor(low) + 1, bounds.low ?? -Infinity);
    return top > low && top >= (bounds.low ?? -Infinity);
  });
  // Of a group one is 1: not two that have to be, nor none that can be.
  return fits && [...groups.values()].every((members) =>
    members.filter(([low]) => low >= 0).length < 2 && members.some(([, high]) => high >= 1));
}

/** Return the leaves that observations within the bounds reached before, and none reaches now. */
function lostLeaves() {
  const now = [...tree.threshold];
  const reached = (threshold) => {
    tree.threshold = threshold;
    return nodeOfLeaf.map((node) => isPossible(boxOf(node)));
  };
  const before = reached(original.threshold);
  const after = reached(now);
  return [...before.keys()].filter((leaf) => before[leaf] && !after[leaf]);
}

/* The places that tell of a certificate, the last fact of the head and a section: it is of the policy as it came. */
const certified = byId("certificate") ? [[...document.querySelectorAll(".head .facts")].pop(), byId("certificate")] : [];

/** Say what the changes do to the recorded steps. */
function drawEffects() {
  const edit = edits();
  const isOther = isMoved() || isRelabelled();
  for (const place of certified) place.hidden = isOther;
  byId("effects").hidden = !edit.length && !earlier.length;
  byId("undo").disabled = byId("start-over").disabled = !earlier.length;
  byId("download").disabled = byId("copy").disabled = !edit.length;
  byId("command").value = edit.length ? commandOf(edit) : "";
  document.body.dataset.edits = edit.length;
  if (byId("effects").hidden) return;
  const { total, groups } = changedSteps();
  const count = groups.reduce((sum, { steps }) => sum + steps.length, 0);
  document.body.dataset.changed = count;
  const words = !edit.length
    ? "Everything is as it was."
    : total
      ? `${count} of ${total} recorded steps (${percent(count / total)}) get another action.`
      : "No episode is recorded on this page, so nothing can be compared.";
  byId("effects-words").replaceChildren(
    element("p", {}, words),
    ...(certified.length && isOther ? [element("p", {}, "The certificate is of the policy as it came: of this one nothing is proven.")] : []),
    element("ul", { class: "conditions" }, ...groups.slice(0, 6).map(groupWords),
      ...(groups.length > 6 ? [element("li", { class: "quiet" }, `and ${groups.length - 6} more`)] : []),
      ...lostLeaves().map((leaf) => element("li", {}, `No observation reaches leaf ${leaf} any more.`))));
}

/** Return what changed between two leaves, with buttons that show the steps. */
function groupWords({ before, after, old, now, steps }) {
  const where = before === after ? `leaf ${before}` : `leaf ${before}, now leaf ${after}`;
  const item = element("li", {}, `${steps.length} in ${where}: ${actions[old]} became ${actions[now]} `);
  for (const { episode, step, end } of runs(steps).slice(0, 4)) {
    const words = `${episode + 1}: ${step}${end > step ? `–${end}` : ""}`;
    const button = element("button", { type: "button", class: "small", "aria-label": `${words}, show episode ${episode + 1} at step ${step}` }, words);
    button.addEventListener("click", () => {
      play(false);
      show({ episode, step, selected: null });
    });
    item.append(button, " ");
  }
  return item;
}

/** Return the largest subtrees whose leaves are all in a set. */
function covering(wanted) {
  const found = [];
  const work = [0];
  while (work.length) {
    const node = work.pop();
    const leaves = leavesBelow(node);
    if (leaves.every((leaf) => wanted.has(leaf))) found.push(node);
    else if (!isLeaf(node) && leaves.some((leaf) => wanted.has(leaf))) work.push(tree.right[node], tree.left[node]);
  }
  return found;
}

/** Return the options of `eutree edit` that make the present policy of the original one. */
function edits() {
  if (!editable) return [];
  const touched = new Set();
  const options = [];
  tree.threshold.forEach((threshold, node) => {
    if (isLeaf(node) || threshold === original.threshold[node]) return;
    options.push(["--set-threshold", `${node}=${threshold}`]);
    leavesBelow(node).forEach((leaf) => touched.add(leaf));
  });
  data.leafActions.forEach((action, leaf) => {
    if (action === original.leafActions[leaf]) return;
    options.push(["--set-action", `${leaf}=${actions[action]}`]);
    touched.add(leaf);
  });
  const leaves = [...locked.keys()];
  const unlock = new Set(leaves.filter((leaf) => lockedAtFirst[leaf] && (!locked[leaf] || touched.has(leaf))));
  const lock = new Set(leaves.filter((leaf) => locked[leaf] && (!lockedAtFirst[leaf] || unlock.has(leaf))));
  options.push(...covering(unlock).map((node) => ["--unlock", String(node)]));
  options.push(...covering(lock).map((node) => ["--lock", String(node)]));
  return options;
}

/** Return a word as a shell reads it; control characters need the $'...' of bash and zsh. */
function quoted(word) {
  if (/^[\w./=+:@%-]+$/.test(word)) return word;
  if (!/[\x00-\x1f\x7f]/.test(word)) return `'${word.replaceAll("'", "'\\''")}'`;
  const escaped = word.replace(/[\\']/g, "\\$&").replace(/[\x01-\x1f\x7f]/g, (sign) => `\\x${sign.charCodeAt(0).toString(16).padStart(2, "0")}`);
  return `$'${escaped}'`;
}

const nameOfCopy = () => data.file.replace(/(\.json)?$/, "-edited.json");

/** Return the command line that does the same. */
function commandOf(options) {
  if (options.flat().some((word) => word.includes("\0"))) return "# A name holds a character that no command line can: use the download.";
  const path = (name) => quoted(name.startsWith("-") ? `./${name}` : name);
  return ["eutree edit", path(data.file), ...options.flat().map(quoted), "--out", path(nameOfCopy())].join(" ");
}

const CRC = Uint32Array.from({ length: 256 }, (_, byte) => {
  for (let bit = 0; bit < 8; bit += 1) byte = byte & 1 ? (byte >>> 1) ^ 0xedb88320 : byte >>> 1;
  return byte;
});

/** Return the checksum of a document as eutree.files.documents.checksum_of makes it. */
function checksumOf(content) {
  let crc = 0xffffffff;
  const take = (bytes) => bytes.forEach((byte) => { crc = CRC[(crc ^ byte) & 255] ^ (crc >>> 8); });
  const number = (size, set) => {
    const view = new DataView(new ArrayBuffer(size));
    set(view);
    take(new Uint8Array(view.buffer));
  };
  const mark = (sign) => take([sign.charCodeAt(0)]);
  const spell = (value) => {
    if (typeof value === "string") {
      const text = new TextEncoder().encode(value);
      mark("s");
      number(4, (view) => view.setUint32(0, text.length, true));
      take(text);
    } else if (typeof value === "number") {
      mark("#");
      number(8, (view) => view.setFloat64(0, value + 0, true)); // -0 becomes 0
    } else if (value === null || typeof value === "boolean") {
      mark(value === null ? "n" : value ? "t" : "f");
    } else if (Array.isArray(value)) {
      mark("[");
      value.forEach(spell);
      mark("]");
    } else {
      mark("{");
      Object.keys(value).sort().forEach((key) => { spell(key); spell(value[key]); });
      mark("}");
    }
  };
  const { checksum, made_by, ...sealed } = content;
  spell(sealed);
  return ((crc ^ 0xffffffff) >>> 0).toString(16).padStart(8, "0");
}

/** Return the content of the edited policy's file. */
function editedFile() {
  const policy = structuredClone(data.document);
  // Counts of other boxes say nothing, but under masks they are what is fallen back on.
  const uncounted = isMoved() && !policy.masked ? ["visits", "values", "deviations"] : [];
  const isRanked = policy.masked && isRelabelled();
  policy.nodes.forEach((node, index) => {
    if (!isLeaf(index)) node.threshold = tree.threshold[index];
  });
  policy.leaves.forEach((leaf, number) => {
    leaf.action = data.leafActions[number];
    if (locked[number]) leaf.locked = true;
    else delete leaf.locked;
    for (const name of uncounted) delete leaf[name];
    if (isRanked) leaf.ranks = actions.map((_, action) => (isKept(number) ? data.orders[number].indexOf(action) : 0));
  });
  policy.checksum = checksumOf(policy);
  // The environment goes as it came: its arguments may hold whole numbers that no number of a page can.
  const text = JSON.stringify({ ...policy, environment: null }, null, 1);
  return `${text.replace('"environment": null', () => `"environment": ${data.environment}`)}\n`;
}

byId("rules-fold").addEventListener("toggle", drawRules);
byId("undo").addEventListener("click", () => restore(earlier.pop()));
byId("start-over").addEventListener("click", () => change((policy) => Object.assign(policy, {
  threshold: [...original.threshold], leafActions: [...original.leafActions], locked: [...lockedAtFirst],
})));
byId("download").addEventListener("click", () => {
  const address = URL.createObjectURL(new Blob([editedFile()], { type: "application/json" }));
  element("a", { href: address, download: nameOfCopy() }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
});
byId("copy").addEventListener("click", () => {
  byId("command").select();
  navigator.clipboard?.writeText(byId("command").value).catch(() => document.execCommand("copy"));
});
onChange(markRules);
