"use strict";

/* The seconds that cost the tree its success: a strip for each episode, as keys on a roll. */

const STEP = 18, ROW = 26; // of a strip: the width of a step, the height of its actions
const WORTHY = ["opening", "review", "watching"]; // states in which something can be changed

function showHurts() {
  const hurts = view.tree?.hurts || [];
  const hadFocus = $("hurts-section").contains(document.activeElement);
  $("hurts-section").hidden = !view.tree?.was_searched;
  if ($("hurts-section").hidden) {
    broughtIntoView = "";
    if (hadFocus) $("verdict-title").focus(); // the answer comes there
    return;
  }
  const found = hurts.some((hurt) => hurt.what !== "show again");
  $("hurts-note").textContent = found
    ? "Found by playing: the tree is better without the marked steps, in the same fresh episodes. "
      + "What you did stays stored; cut or flipped, it is only not imitated."
    : "Trees without one part or another of what you showed were played: none was shown to be better.";
  const edits = hurts.filter((hurt) => hurt.what !== "show again");
  const all = edits.length < 2 ? [] : [changeButton("all", "Do all of these", null, "first", edits.some(isThere))];
  words($("hurts"), ...all, ...hurts.map((hurt, number) => hurtCard(hurt, number, edits.length < 2)));
  const facts = JSON.stringify(hurts);
  if (facts !== broughtIntoView) {
    $("hurts-section").scrollIntoView({ block: "start" });
    $("hurts-title").focus({ preventScroll: true }); // its button has gone
  }
  broughtIntoView = facts;
}
let broughtIntoView = ""; // the hurts that have been

/* The episode of these steps; none where another recorder in the same folder has it. */
function shownIn(segment) { return view.episodes.find((one) => one.number === segment.episode); }

/* Whether the episodes of these steps still count: nothing is changed in discarded ones. */
function isThere(hurt) { return hurt.segments.every((one) => shownIn(one)?.kept); }

function whyNot(hurt) {
  return hurt.segments.every(shownIn) ? "You discarded an episode of these: keep it, or make the tree again."
    : "Another recorder has an episode of these. To change them, end both and start one again.";
}

function changeButton(name, text, number, className, canChange) {
  const button = treeButton(name, text, number);
  button.className = className;
  button.disabled ||= !canChange || !WORTHY.includes(view.state);
  return button;
}

function hurtCard(hurt, number, isAlone) {
  const card = document.createElement("article"), title = document.createElement("h3");
  title.id = `hurt-${number}`;
  title.textContent = hurt.title;
  card.className = "hurt";
  card.setAttribute("aria-labelledby", title.id);
  card.append(title, line(hurt.why), ...hurt.strips.map(strip), legend());
  const more = new Set(hurt.segments.map((one) => one.episode)).size - hurt.strips.length;
  if (more > 0) card.append(line(`And ${more} more ${more === 1 ? "episode" : "episodes"}.`, "soft"));
  card.append(line(hurt.reached, "reached"));
  if (!isThere(hurt)) card.append(line(whyNot(hurt), "soft"));
  const buttons = document.createElement("div");
  buttons.className = "row-of-buttons";
  const offered = { cut: ["cut"], flip: ["flip", "cut"] }[hurt.what] || [];
  for (const name of [...offered, "again"]) {
    const isProposed = name === (offered[0] || "again") && isAlone;
    const button = changeButton(name, { cut: "Cut", flip: "Flip", again: "Show this again" }[name], number, isProposed ? "first" : "", isThere(hurt));
    button.setAttribute("aria-describedby", title.id);
    buttons.append(button);
  }
  card.append(buttons);
  return card;
}

function line(text, className = "") {
  const paragraph = document.createElement("p");
  paragraph.className = className;
  paragraph.textContent = text.replaceAll("<=", "≤").replaceAll(/(\d) (?=[a-z%])/g, "$1\u00a0");
  return paragraph;
}

/* An action that needs no key is a low bar, any other one a high one: a roll of keys. */
function level(action) {
  if (view.actions[action]?.is_idle) return 0.25;
  const active = view.actions.map((_, k) => k).filter((k) => !view.actions[k].is_idle);
  return 1 - 0.5 * active.indexOf(action) / Math.max(active.length, 1);
}

function strip({ number, runs, keys, marks, words: said }) {
  const row = document.createElement("div"), name = document.createElement("span"), roll = document.createElement("div");
  row.className = "strip";
  name.textContent = `No. ${number}`;
  name.setAttribute("aria-hidden", "true");
  const steps = runs.reduce((sum, [, length]) => sum + length, 0), names = [...new Set(keys.map(([key]) => key))];
  const height = ROW + 8 + 7 * names.length + 6;
  const chart = document.createElementNS(SVG, "svg");
  for (const [key, value] of Object.entries({ viewBox: `-2 0 ${STEP * steps + 4} ${height}`, width: STEP * steps + 4, height, role: "img", "aria-label": said, preserveAspectRatio: "none" })) chart.setAttribute(key, value);
  let at = 0;
  for (const [action, length] of runs) {
    const high = ROW * level(action);
    const bar = svg(chart, "rect", { class: `act act-${action % 6}`, x: STEP * at + 0.5, y: 6 + ROW - high, width: STEP * length - 1, height: high });
    svg(bar, "title", {}, `${view.actions[action]?.name ?? action}, ${length} ${length === 1 ? "step" : "steps"}`);
    at += length;
  }
  names.forEach((key, line) => keys.filter(([of]) => of === key).forEach(([, start, stop]) => {
    const held = svg(chart, "rect", { class: "held", x: STEP * start + 0.5, y: ROW + 10 + 7 * line, width: STEP * (stop - start) - 1, height: 4 });
    svg(held, "title", {}, `${GLYPHS[key] || key.toUpperCase()} held`);
  }));
  for (const [start, stop] of marks) {
    svg(chart, "rect", { class: "hurts", x: STEP * start, y: 1.5, width: STEP * (stop - start), height: height - 3, rx: 3 });
  }
  roll.className = "roll";
  roll.append(chart);
  row.append(name, roll);
  return row;
}

/* What the heights and the lines of a strip mean. */
function legend() {
  const list = document.createElement("p");
  list.className = "legend soft";
  list.setAttribute("aria-hidden", "true");
  view.actions.forEach((action, k) => {
    const item = document.createElement("span"), swatch = document.createElement("i");
    swatch.className = `act act-${k % 6}${level(k) < 0.3 ? " low" : ""}`;
    item.append(swatch, action.name);
    list.append(item);
  });
  const held = document.createElement("span"), line = document.createElement("i");
  line.className = "held";
  held.append(line, "a key held");
  const marked = document.createElement("span"), box = document.createElement("i");
  box.className = "hurts";
  marked.append(box, "hurts");
  list.append(held, marked);
  return list;
}
