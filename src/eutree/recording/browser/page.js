"use strict";

/* Shows what the recorder says and tells it what the person does. All decisions are the
   recorder's; the state is published in data- attributes of <body>. */

const $ = (id) => document.getElementById(id);
const body = document.body;
const NAMES = {
  " ": "space", ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
  Enter: "enter", Escape: "escape", Tab: "tab", Delete: "delete", Backspace: "backspace", "=": "+",
};
const PLACES = { Minus: "-", Equal: "+", Period: ".", NumpadAdd: "+", NumpadSubtract: "-" }; // of keys
const GLYPHS = {
  space: "Space", left: "←", right: "→", up: "↑", down: "↓", enter: "Enter", escape: "Esc",
  tab: "Tab", delete: "Del", backspace: "⌫",
};
const CONTROLS = {
  pause: "pause, go on", end: "end the episode", redo: "same start again", discard: "discard",
  finish: "finish", slower: "slower", faster: "faster", mode: "other mode", wait: "one step without a key",
};
const GOOD = "good", BAD = "bad";
const DEAF = 700; // ms after an episode in which a key still belongs to it

let view = {};
let socket = null;
let sequence = 0; // of the last key sent
let drawn = 0; // number of the picture on the screen
let newest = null; // a picture that waits to be drawn
let drawing = false;
let binding = null; // the action that waits for its key
let retry = 0;
let again = 0; // the timer of the next attempt to connect
const down = new Map(); // key -> what holds it: places on the keyboard, fingers on pads
const sentAt = new Map(); // sequence -> when, until a picture answers

function newName() {
  return Array.from(crypto.getRandomValues(new Uint8Array(12)), (b) => b.toString(16).padStart(2, "0")).join("");
}

/* Takes the token out of the address; returns whether there was one. */
function readToken() {
  if (location.hash.length < 2) return false;
  sessionStorage.setItem("token", location.hash.slice(1));
  history.replaceState(null, "", location.pathname);
  token = sessionStorage.getItem("token");
  return true;
}

let token = sessionStorage.getItem("token") || "";
readToken();
let client = sessionStorage.getItem("client") || newName();
sessionStorage.setItem("client", client);

/* A duplicated tab has its original's name, by which it would take over: it asks the other tabs
   and takes a new one. After a reload nobody answers. */
const tabs = new BroadcastChannel("eutree");
const me = newName();
tabs.onmessage = ({ data }) => {
  if (data.asks && data.client === client) tabs.postMessage({ taken: client, to: data.asks });
  if (data.to === me && data.taken === client) {
    client = newName();
    sessionStorage.setItem("client", client);
  }
};
const TAB_ANSWER = 120; // ms

// ---- the socket

function connect() {
  clearTimeout(again);
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  const opened = new WebSocket(`${scheme}//${location.host}/socket`, ["eutree", `token.${token}`]);
  let wasOpen = false;
  socket = opened;
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    wasOpen = true;
    retry = 0;
    sequence = 0;
    drawn = 0;
    down.clear();
    send({ type: "hello", client });
    if (document.hidden) send({ type: "gone" });
  };
  socket.onmessage = (event) => {
    if (typeof event.data === "string") {
      view = { ...view, ...JSON.parse(event.data) };
      show();
    } else {
      receive(event.data);
    }
  };
  socket.onclose = async () => {
    if (socket !== opened) return; // another address was pasted
    down.clear();
    if (view.state === "finished" || view.state === "failed") return;
    body.dataset.connection = "lost";
    retry += 1;
    if (token) again = setTimeout(connect, Math.min(250 * retry, 2000));
    const reason = await whyLost(wasOpen);
    if (socket === opened && body.dataset.connection === "lost") banner(reason);
  };
}

async function whyLost(wasOpen) {
  if (!token) return "This address lacks the recorder's token. Open the whole address that eutree printed.";
  try {
    const status = await (await fetch("/status", { cache: "no-store" })).text();
    if (status === "full") return "Too many pages of this recorder are open. Close another one.";
    if (wasOpen) return "The connection broke. Trying again …";
    return "The recorder that runs here does not know this address: it is of an earlier one. Paste the address that eutree printed last.";
  } catch {
    return "The recorder does not answer. Is it still running? Start it again and paste its new address here.";
  }
}

addEventListener("hashchange", () => {
  if (!readToken()) return;
  const old = socket;
  view = {};
  retry = 0;
  banner("");
  connect();
  old?.close();
});

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function act(name, value = null, key = "") {
  send({ type: "do", name, value, key });
}

// ---- pictures: the newest one is drawn, older ones are dropped

function receive(buffer) {
  const head = new DataView(buffer);
  newest = { number: head.getUint32(0), answered: head.getUint32(4), jpeg: buffer.slice(12) };
  if (!drawing) draw();
}

async function draw() {
  drawing = true;
  while (newest) {
    const { number, answered, jpeg } = newest;
    newest = null;
    const bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
    if (newest) { bitmap.close(); continue; }
    const canvas = $("picture");
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
      body.style.setProperty("--aspect", bitmap.width / bitmap.height);
    }
    canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    drawn = number;
    send({ type: "drawn", frame: number });
    body.dataset.frame = number;
    for (const [key, time] of sentAt) {
      if (key > answered) break;
      body.dataset.latency = `${key} ${(performance.now() - time).toFixed(2)}`;
      sentAt.delete(key);
    }
  }
  drawing = false;
}

// ---- keys and pads

function acts() { return body.dataset.role === "acting"; }
function runs() { return ["playing", "countdown", "driving"].includes(view.state); }
function actionKeys() { return (view.actions || []).flatMap((a) => a.keys.flatMap((k) => keysOf(k))); }
function watches() { return view.state === "watching"; }
function drives() { return view.state === "driving"; } // a tree that may be corrected
function waits() { return drives() && (view.driving?.is_paused || view.driving?.is_over); }
function goesOn() { return ["opening", "paused", "review", "watching"].includes(view.state) || waits(); }
function used(key) {
  return actionKeys().includes(key) || Object.values(view.controls || {}).includes(key)
    || (goesOn() && (key === "enter" || key === "space"));
}

/* The name of a key as it is typed; where that means nothing here (Shift was pressed meanwhile, or
   the layout is Cyrillic or Greek), that of its place on the keyboard. */
function nameOf(event) {
  const typed = NAMES[event.key] || event.key.toLowerCase();
  const place = PLACES[event.code] || event.code.replace(/^(Key|Digit|Numpad(?=\d))/, "").toLowerCase();
  return used(typed) || !used(place) ? typed : place;
}

/* Whether what has the focus does something of its own with a key: a field with all, a button with
   those that press it, a part that scrolls with those that act. */
function knows(element, key) {
  if (element.matches("select, input, textarea")) return true;
  const presses = key === "enter" || key === "space";
  if (!element.matches("[role=region]")) return presses;
  return !presses && !Object.values(view.controls || {}).includes(key);
}

function press(key, source) {
  if (down.has(key)) { down.get(key).add(source); return; }
  down.set(key, new Set([source]));
  edge(key, true);
}

/* Lets go of what a place on the keyboard, or a finger, holds; a key that another one holds, too,
   stays down. Returns whether it held anything. */
function release(source) {
  const held = [...down].filter(([, sources]) => sources.delete(source));
  for (const [key, sources] of held) {
    if (sources.size) continue;
    down.delete(key);
    edge(key, false);
  }
  return held.length > 0;
}

function edge(key, isDown) {
  sequence += 1;
  sentAt.set(sequence, performance.now());
  send({ type: "key", sequence, key, down: isDown, frame: drawn });
  body.dataset.sequence = sequence;
  lightPads();
}

function leave() {
  down.clear();
  send({ type: "gone" });
  lightPads();
}

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (binding !== null) {
    if (["Shift", "AltGraph", "CapsLock"].includes(event.key)) return;
    const key = NAMES[event.key] || event.key.toLowerCase(), onButton = event.target.closest("button");
    // A button that has the focus keeps them: Enter on "Cancel" cancels.
    if (onButton && ["enter", "space", "tab"].includes(key) && !event.repeat) return;
    event.preventDefault();
    if (event.repeat) return; // of the key that pressed "Change"
    if (key !== "escape") act("bind", binding, key);
    binding = null;
    $("picture").focus();
    show();
    return;
  }
  const pad = padOf(event), place = event.code || event.key;
  if (pad && acts() && runs() && !waits()) {
    event.preventDefault();
    if (!event.repeat) hold(pad, place);
    return;
  }
  const key = nameOf(event);
  if (!acts() || !used(key)) return;
  const native = event.target.closest("button:not(.pad), summary, select, input, textarea, [role=region]");
  if (native && knows(native, key) && !(runs() && !waits() && actionKeys().includes(key))) return;
  event.preventDefault();
  if (!event.repeat) press(key, place);
});
addEventListener("keyup", (event) => {
  if (release(event.code || event.key) || padOf(event)) event.preventDefault();
});
addEventListener("blur", leave);
document.addEventListener("visibilitychange", () => { if (document.hidden) leave(); });
addEventListener("pagehide", leave);

/* The keys that are held together, of "left+up" or of one alone, "+" too. */
function keysOf(keys) { return keys.length > 1 ? keys.split("+") : [keys]; }
function areDown(keys) { return keysOf(keys).every((key) => down.has(key)); }

/* The button of an action that has the focus, if this is a key that presses it. */
function padOf(event) {
  return ["Enter", " "].includes(event.key) ? event.target.closest(".pad") : null;
}

function hold(pad, source) {
  for (const key of keysOf(pad.dataset.key)) press(key, source);
}

/* One press of whoever can hold nothing, such as a screen reader: down until a decision has fallen,
   where what is held counts. */
function pressOnce(pad) {
  const source = `click ${++clicks}`, atOnce = !drives() && (view.turn_based || view.toggle);
  hold(pad, source);
  setTimeout(() => release(source), atOnce ? 0 : 1000 * view.interval);
}
let clicks = 0;

function pad(action, key, text) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "pad";
  button.dataset.action = action;
  button.dataset.key = key;
  button.id = `pad-${key}`;
  button.append(text, kbd(key));
  let touched = -Infinity; // when a pointer last was on it: its click is no further press
  button.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    button.setPointerCapture(event.pointerId);
    if (acts()) hold(button, `finger ${event.pointerId}`);
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
    button.addEventListener(name, (event) => { touched = performance.now(); release(`finger ${event.pointerId}`); });
  }
  button.addEventListener("mousedown", (event) => event.preventDefault()); // the focus stays: keys keep their meaning
  button.addEventListener("click", (event) => {
    if (acts() && !event.detail && performance.now() > touched + DEAF) pressOnce(button);
  });
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  return button;
}

// ---- what is shown

function banner(text) {
  $("banner").hidden = !text;
  $("banner-text").textContent = text || "";
}

/* A key's cap. */
function cap(key) {
  const element = kbd(key);
  element.removeAttribute("aria-hidden");
  return element;
}

/* A key's cap on a button: to be seen; the button's name for screen readers is its words alone. */
function kbd(key) {
  const element = document.createElement("kbd");
  element.setAttribute("aria-hidden", "true");
  element.textContent = keysOf(key).map((k) => GLYPHS[k] || k.toUpperCase()).join(" + ");
  return element;
}

function words(parent, ...children) { parent.replaceChildren(...children); return parent; }

function cell(text, className = "") {
  const td = document.createElement("td");
  td.className = className;
  td.append(text);
  return td;
}

/* Rebuilds a part of the page only when what it shows has changed, so that the focus stays; if its
   element was rebuilt, the one of the same id gets it. */
const built = {};
function rebuild(name, facts, build) {
  const text = JSON.stringify(facts), focused = document.activeElement;
  if (built[name] === text) return;
  built[name] = text;
  build();
  if (focused?.id && !focused.isConnected) $(focused.id)?.focus({ preventScroll: true });
}

/* Fills a part whose buttons go once they are pressed: the focus then is where the answer comes. */
function wordsThatGo(parent, ...children) {
  const hadFocus = parent.contains(document.activeElement);
  words(parent, ...children);
  if (hadFocus) $("verdict-title").focus({ preventScroll: true });
}

function show() {
  if (view.state !== "opening") binding = null; // no key is awaited behind the opening
  const before = body.dataset.state, wasLost = body.dataset.connection === "lost";
  Object.assign(body.dataset, {
    state: view.state, role: view.role || "", connection: "open", saved: view.saved, step: view.step,
    episodes: (view.episodes || []).length, action: view.action, speed: view.speed,
  });
  showStudy(wasLost);
  const watching = !acts();
  const nobody = view.role === "idle";
  banner(nobody ? "Nobody is acting. The page that did is closed."
    : watching ? "Another page is acting. You are watching." : "");
  $("take").hidden = !watching;
  $("take").textContent = nobody ? "Act here" : "Take over";
  $("environment").textContent = view.environment;
  $("saved").textContent = `${view.saved} of ${view.target}`;
  $("progress").setAttribute("aria-label", `${view.saved} of ${view.target} demonstrations saved`);
  $("fill").style.width = `${Math.min(100, 100 * view.saved / view.target)}%`;
  document.title = `${view.saved} of ${view.target} – eutree recorder`;
  rebuild("keys", [view.actions, view.state, binding, view.keys_chosen, view.role], showKeys);
  rebuild("controls", [view.controls, view.turn_based, view.study?.allowed], showControls);
  rebuild("pads", [view.actions, view.turn_based || drives(), view.controls], showPads);
  rebuild("buttons", [view.state, watching, asksToLeave(), view.saved >= view.target, view.saved > 0, view.controls,
    lastEpisode()?.kept, view.makes, phase(), view.tree?.asks, view.can_watch, view.can_correct, Boolean(view.missing), scene(), view.study?.allowed], showButtons);
  rebuild("practise", [view.state, watching, phase(), view.tree?.may_gain, view.tree?.asks, view.tree?.was_searched], showPractise);
  rebuild("episodes", [view.episodes, watching, isOver()], showEpisodes);
  rebuild("numbers", view.numbers, showNumbers);
  rebuild("tree", [view.tree, isOver()], showTree);
  rebuild("hurts", [view.tree?.hurts, view.tree?.was_searched, view.state, acts(), view.episodes.map((e) => e.kept)], showHurts);
  rebuild("way", [view.driving?.nodes, view.driving?.tests, view.driving?.action, view.tree?.svg], showWay);
  rebuild("commands", commandsNow(), showCommands);
  showPace(watching);
  showCard();
  showPill();
  showBeat();
  lightPads();
  const begins = works() && body.dataset.works !== "true", ends = !works() && body.dataset.works === "true";
  body.dataset.works = works();
  if (begins || ends) announce(view.tree.message, view.tree.note);
  if (asksToLeave() && body.dataset.leaving !== "true") announce($("title").textContent);
  body.dataset.leaving = asksToLeave();
  const seen = view.driving && view.driving.is_over ? `over ${view.driving.number}` : "";
  if (seen && seen !== body.dataset.seen) announce($("title").textContent, $("text").textContent);
  body.dataset.seen = seen;
  const refused = view.state === "opening" ? view.message || "" : "";
  if (refused && refused !== body.dataset.refused) announce(refused);
  body.dataset.refused = refused;
  if (before !== view.state) {
    if (runs() && !document.activeElement?.closest?.("select, .pad")) $("picture").focus();
    if (runs() && document.activeElement?.tagName === "SELECT") $("picture").focus();
    announce($("title").textContent, $("text").textContent);
    if (view.driving) scrollTo(0, 0); // the picture is what matters now
    if (view.state === "review" && before === "playing") deaf = performance.now() + DEAF;
  }
}
let deaf = 0;

function isOver() { return view.state === "finished" || view.state === "failed"; }

/* The episode that ended just now; nothing where it ended without a step. */
function lastEpisode() { return (view.episodes || [])[view.last ?? -1]; }

function keyFor(name) {
  return (view.controls || {})[name] || "";
}

/* Lets a screen reader say it; where a study has the floor, its own words stay. */
function announce(...texts) {
  if (!view.study?.is_card) $("announce").textContent = texts.filter(Boolean).join(". ").replaceAll(/([?!.])\. /g, "$1 ");
}

function showKeys() {
  const rows = view.actions.map((action, index) => {
    const row = document.createElement("tr");
    row.dataset.action = index;
    const keys = document.createElement("td");
    const known = drives() && action.is_idle ? [...action.keys, keyFor("wait")] : action.keys;
    if (binding === index) keys.append("press a key …");
    else known.filter(Boolean).forEach((key) => keys.append(cap(key), " "));
    if (binding !== index && action.is_idle && !drives()) keys.append(known.length ? "or no key" : "no key");
    if (view.state === "opening" && acts() && allowed("bind")) {
      const change = document.createElement("button"), awaits = binding === index;
      change.type = "button";
      change.textContent = awaits ? "Cancel" : "Change";
      change.setAttribute("aria-label", awaits ? `Cancel: keep the key of ${action.name}` : `Change the key of ${action.name}`);
      change.addEventListener("click", (event) => {
        binding = awaits ? null : index;
        show();
        const after = $("keys").children[index].querySelector("button"); // the one in its place
        (event.detail && !awaits ? $("picture") : after).focus({ preventScroll: true }); // after a pointer each key is free
      });
      keys.append(change);
    }
    row.append(cell(action.name), keys);
    return row;
  });
  words($("keys"), ...rows);
  $("keys-note").hidden = view.keys_chosen || view.state !== "opening";
  $("keys-note").textContent = "These keys are a suggestion; change them before you start.";
}

function showControls() {
  const rows = Object.keys(CONTROLS).filter((name) => keyFor(name) && allowed(name) && (name !== "wait" || view.turn_based));
  words($("controls"), ...rows.map((name) => {
    const row = document.createElement("tr");
    row.append(cell(CONTROLS[name]), cell(cap(keyFor(name))));
    return row;
  }));
}

function showPads() {
  const pads = view.actions.filter((a) => a.keys.length)
    .map((a) => pad(a.name, a.keys[0], a.name));
  const idle = view.actions.find((a) => a.is_idle);
  if ((view.turn_based || drives()) && idle && keyFor("wait")) pads.push(pad("", keyFor("wait"), idle.name));
  words($("pads"), ...pads);
}

function lightPads() {
  for (const button of $("pads").children) {
    const action = view.actions.find((a) => a.name === button.dataset.action);
    const held = areDown(button.dataset.key) || Boolean(action?.keys.some(areDown))
      || (view.toggle && runs() && view.actions[view.coming] === action && !action?.is_idle);
    button.classList.toggle("on", held);
    button.setAttribute("aria-pressed", held);
  }
  for (const row of $("keys").children) {
    row.classList.toggle("on", view.state === "playing" && !view.awaits_key && Number(row.dataset.action) === view.action);
  }
}

/* How far the scene is that the tree plays: what its buttons depend on. */
function scene() {
  const driving = view.driving;
  return driving ? [driving.number, driving.of, driving.is_over, driving.is_paused] : null;
}

function watchingButtons() {
  const { number, of, is_over, is_paused } = view.driving;
  if (drives()) {
    const end = ["finish", "That is enough"], drop = ["discard", "Discard"];
    if (is_over) return [["start", "Drive on", actionKeys().includes("enter") ? "" : "enter"], drop, end];
    return [is_paused ? ["start", "Go on", "enter"] : ["pause", "Pause"], drop, end];
  }
  const next = number < of ? "Next one" : "That was the last", back = ["finish", "Back"];
  if (is_over) return [["start", next, "enter"], ["redo", "Show it again"], back];
  return [is_paused ? ["start", "Go on", "enter"] : ["pause", "Pause"], ["end", next], ["redo", "From its start"], back];
}

function phase() { return view.tree ? view.tree.phase : ""; }
function asksToLeave() { return Boolean(view.leaving) && works(); }
function works() { return isMaking() && !isOver(); }
function isMaking() { return ["fitting", "playing", "practising"].includes(phase()); }

function recordingButtons() {
  const enough = view.saved >= view.target;
  const more = ["end", "One more"], same = ["redo", "Same start again"], drop = ["discard", "Discard"];
  const make = ["make", view.tree ? "Make it again" : "Make my tree", enough && !view.tree ? "enter" : ""];
  if (asksToLeave()) return [["stay", "Wait for it", "enter"], ["finish", "Finish without it"]];
  if (view.driving) return watchingButtons();
  const asks = works() || view.tree?.asks; // nothing else is to be done with the tree now
  const watch = asks ? [] : [...(view.can_correct ? [["correct", "Correct it"]] : []),
    ...(view.can_watch ? [["watch", "Watch it"]] : [])];
  const trees = [...watch, ...(!view.makes || !view.episodes.some((e) => e.kept) || asks ? [] : [make])];
  if (view.state === "opening") {
    if (view.can_correct && !view.saved) return [["correct", "Let it drive", "enter"], ...trees.filter(([name]) => name === "make"), ["finish", "Leave"]];
    return enough && view.makes ? [...trees.reverse(), more, ["finish", "Leave"]]
      : [["start", "Start", "enter"], ...trees, ["finish", "Leave"]];
  }
  if (view.state === "review") {
    const done = ["finish", "Finish"];
    const missing = view.missing ? [["missing", "Show that next"]] : [];
    if (!enough) return [["start", "Next episode", "enter"], ...missing, same, drop, ...trees, ["finish", "Finish for now"]];
    if (!view.makes) return [["finish", "Finish", "enter"], more, same, drop];
    return phase() === "ready" ? [done, more, same, drop, ...trees] : [...trees.reverse(), more, same, drop, done];
  }
  return {
    countdown: [["pause", "Pause"], drop],
    playing: [["pause", "Pause"], ["end", "End here"], same, drop],
    paused: [["start", "Go on", "enter"], ["end", "End here"], same, drop],
  }[view.state] || [];
}

function showButtons() {
  const list = recordingButtons().filter(([name]) => allowed(name));
  const buttons = list.map(([name, text, key], place) => {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.command = name;
    if (place === 0 && (!runs() || view.driving) && text !== "Pause" && (!works() || asksToLeave())) button.className = "first";
    button.append(text);
    const shown = key || (["make", "practise", "watch", "correct", "missing"].includes(name) ? "" : keyFor(name));
    if (shown) {
      button.append(kbd(shown));
      button.setAttribute("aria-keyshortcuts", shown[0].toUpperCase() + shown.slice(1));
    }
    button.disabled = !acts() || (name === "discard" && view.state === "review" && !lastEpisode()?.kept);
    button.addEventListener("click", () => {
      if (view.state === "review" && performance.now() < deaf) return;
      act(name);
    });
    return button;
  });
  words($("buttons"), ...buttons);
}

function mark(episode) {
  if (episode.success === true || episode.result === "goal") return GOOD;
  const cut = ["time limit", "truncated", "stopped", "interrupted", "fault"]; // no mistake of one moment
  if (episode.success === false && !cut.includes(episode.result)) return BAD;
  return "";
}

const MARKS = { [GOOD]: "✓", [BAD]: "✕" };

function treeButton(command, text, value = null) {
  const button = document.createElement("button");
  button.type = "button";
  button.id = `tree-${command}-${value ?? ""}`;
  button.dataset.command = command;
  button.textContent = text;
  button.disabled = !acts();
  button.addEventListener("click", () => act(command, value));
  return button;
}

function showPractise() {
  const offered = phase() === "ready" && view.tree.svg && ["opening", "review", "watching"].includes(view.state);
  const buttons = [];
  if (offered && view.tree.asks) buttons.push(treeButton("accept", "Keep what is left"), treeButton("undo", "Take it back"));
  else if (offered) {
    if (view.tree.may_gain) buttons.push(treeButton("practise", "Let it practise"));
    if (!view.tree.was_searched) buttons.push(treeButton("hurting", "Which seconds hurt?"));
  }
  const now = buttons.filter((button) => allowed(button.dataset.command));
  if (now.length && now[0].dataset.command !== "hurting") now[0].className = "first";
  wordsThatGo($("tree-buttons"), ...now);
}

function showEpisodes() {
  const rows = view.episodes.map((episode, index) => {
    const row = document.createElement("tr");
    row.className = episode.kept ? "" : "dropped";
    row.dataset.number = episode.number;
    const sign = document.createElement("span");
    sign.className = `mark ${mark(episode)}`;
    sign.setAttribute("aria-hidden", "true");
    sign.textContent = MARKS[mark(episode)] || "–";
    const result = cell(sign);
    const corrected = episode.by_hand === null ? "" : `, driven by the tree, ${episode.by_hand} by you`;
    result.append((episode.kept || !["redone", "discarded"].includes(episode.comment)
      ? episode.result : `${episode.result}, ${episode.comment}`) + corrected);
    const use = document.createElement("button");
    use.type = "button";
    use.id = `use-${episode.number}`;
    use.textContent = episode.kept ? "Discard" : "Keep";
    use.setAttribute("aria-label", `${use.textContent} episode ${episode.number}`);
    use.disabled = !acts() || isOver();
    use.addEventListener("click", (event) => {
      act(episode.kept ? "drop" : "keep", index);
      if (event.detail) $("picture").focus({ preventScroll: true }); // by mouse: Enter goes on
    });
    const total = episode.total === null ? "" : String(Math.round(episode.total * 100) / 100);
    row.append(cell(String(episode.number)), result, cell(String(episode.length), "right"),
      cell(total, "right"), cell(use));
    return row;
  });
  words($("episodes"), ...rows.reverse());
  $("episodes-table").hidden = rows.length === 0;
  $("none").hidden = rows.length > 0;
  $("episodes-list").hidden = rows.length === 0;
  const kept = view.episodes.filter((e) => e.kept);
  $("episodes-count").textContent = `${kept.length} kept, ${view.episodes.length - kept.length} not used`;
  const early = kept.filter((e) => ["stopped", "interrupted"].includes(e.result));
  $("early").hidden = early.length === 0;
  $("early").textContent = `${early.length} ended early (stopped or interrupted): the tree learns from them, `
    + "but the verdict counts whole episodes only. Discard those that you did not mean.";
  $("failures").hidden = !kept.some((e) => mark(e) === BAD);
  $("failures").textContent = "✕ failed and kept: most of its decisions were right, and the tree learns from "
    + "them too. Discard it only if your hand slipped.";
}

function showNumbers() {
  $("numbers-section").hidden = !view.numbers?.length;
  words($("numbers"), ...(view.numbers || []).map(([name, value]) => {
    const row = document.createElement("tr");
    row.append(cell(name), cell(value, "right"));
    return row;
  }));
}

function showPace(watching) {
  $("speed").value = String(view.speed);
  $("mode").value = view.turn_based ? "turn" : view.toggle ? "toggle" : "hold";
  $("speed").disabled = watching;
  $("mode").disabled = watching || runs();
}
$("speed").addEventListener("change", (event) => act("speed", Number(event.target.value)));
$("mode").addEventListener("change", (event) => {
  act("toggle", event.target.value === "toggle");
  act("turn_based", event.target.value === "turn");
});
$("take").addEventListener("click", () => send({ type: "take" }));
$("picture").addEventListener("pointerdown", () => $("picture").focus());

// ---- what to do now, below the picture

function keyNames(action) {
  return action.keys.map((key) => keysOf(key).map((k) => GLYPHS[k] || k.toUpperCase()).join(" + ")).join(" or ");
}

/* Whether there are only fingers: then the buttons below are what to hold. */
const fingers = matchMedia("(hover: none) and (pointer: coarse)").matches;
const KEY = fingers ? "button" : "key";

function keySentence() {
  const idle = view.actions.find((a) => a.is_idle);
  const rest = view.turn_based ? "" : idle ? `; no ${KEY}: ${idle.name}` : `; without a ${KEY} the last one goes on`;
  const verb = view.turn_based ? "Press" : view.toggle ? "Switch with" : "Hold";
  const acting = view.actions.filter((a) => a.keys.length);
  if (fingers) return `${verb} a button below: ${acting.map((a) => a.name).join(", ")}${rest}.`;
  return `${verb} ${acting.map((a) => `${keyNames(a)}: ${a.name}`).join(", ")}${rest}.`;
}

function recordingCard() {
  const last = lastEpisode();
  const enough = view.saved >= view.target;
  const kept = (view.episodes || []).filter((one) => one.kept).length; // those that a tree drove, too
  const so_far = view.saved || !kept ? `${view.saved} of ${view.target} saved` : `${kept} saved`;
  if (asksToLeave()) {
    return ["Finish without your tree?", "It is still being made, and would be given up. What you recorded is stored.", ""];
  }
  const begins = view.awaits_key !== undefined && !view.actions.some((a) => a.is_idle);
  const slow = view.is_slowed ? " It is shown slowly at first, because it is quick; see Pace." : "";
  return {
    opening: () => ["Show how it is done", view.task || "Act as you would have the machine act.",
      `${view.message ? `Not changed: ${view.message} ` : ""}${keySentence()}${slow} ${enough ? `${so_far}.` : view.saved ? `${so_far}; this goes on with the next.` : "Failures may stay."}`],
    countdown: () => ["Get ready", begins ? `The episode begins with your first ${KEY}.`
      : `Hold the ${KEY} while it counts: what you hold counts from the first decision on.`, keySentence()],
    playing: () => [view.awaits_key ? `Press a ${KEY} to begin`
      : view.study?.label || `Episode ${view.saved + 1}${enough ? "" : ` of ${view.target}`}`, keySentence(), ""],
    watching: watchingCard,
    driving: drivingCard,
    paused: () => ["Paused", view.message || "All keys are released. Go on when you are ready.", ""],
    review: () => [last ? sentence(last) : "Nothing was recorded", view.study?.label ? "No tree learns from this one."
      : enough ? `${view.saved} of ${view.target} done.`
      : `${so_far}, ${view.target - view.saved} to go.`,
    [last && last.kept && mark(last) === BAD ? `It counts: failures may stay.${allowed("discard") ? " Discard it if your hand slipped." : ""}` : "",
      enough ? "" : view.missing].filter(Boolean).join(" ")],
    finished: () => [enough ? `${view.saved} of ${view.target} done` : so_far,
      kept ? "Everything is stored. You can close this page." : "Nothing was recorded. You can close this page.", ""],
    failed: () => ["The recording has ended", `${view.message} — what was recorded before is stored.`, ""],
  }[view.state]?.() || ["Connecting …", "", ""];
}

function watchingCard() {
  const { number, of, note, is_over, is_paused, why } = view.driving;
  const place = `${number} of ${of}, worst first; ${note}.`;
  if (is_over) return [sentence({ ...view.driving, result: view.driving.ending, kept: true }), why || "Nothing went wrong.", place];
  return [is_paused ? "Paused" : "Your tree drives", is_paused ? "It waits for you." : "Its way through the tree is marked.", place];
}

function drivingCard() {
  const { is_over, is_paused, ending, n_by_hand, number } = view.driving;
  const acted = n_by_hand ? `You acted in ${n_by_hand} of ${view.step} steps; the rest you let pass.`
    : "You let all of it pass: that counts as approval.";
  if (is_over) return [sentence({ ...view.driving, result: ending, kept: true }), `${acted} The tree is fitted again and drives on.`, ""];
  const idle = view.actions.find((a) => a.is_idle);
  const waits = idle && !fingers && keyFor("wait") ? ` ${GLYPHS[keyFor("wait")] || keyFor("wait")}: ${idle.name}.` : "";
  const how = fingers ? "Hold a button below to act, let go to hand back."
    : `${keySentence().replace(/; (no|without).*/, ".")}${waits} Let go to hand back.`;
  if (is_paused) return ["Paused", "All keys are released. Go on when you are ready.", how];
  return [view.driving.by_hand ? "You drive" : "The tree drives: take over where it is wrong", how,
    `Episode ${number}; what you let pass counts as approval, but for the two steps before you step in or it fails.`];
}

function showCard() {
  const last = lastEpisode();
  const [title, text, how] = recordingCard();
  const counting = view.state === "countdown" && view.countdown;
  $("big").hidden = !counting;
  if (counting) $("big").textContent = String(view.countdown);
  for (const [id, words] of [["title", title], ["text", text], ["how", how || ""]]) {
    if ($(id).textContent !== words) $(id).textContent = words;
    $(id).hidden = !words;
  }
  reachCard();
  body.dataset.result = view.state === "review" && last ? mark(last)
    : view.driving ? (view.driving.is_over ? mark({ success: view.driving.success, result: view.driving.ending }) : "")
    : view.state === "finished" && view.saved >= view.target ? GOOD : view.state === "failed" ? BAD : "";
}

/* Words that have to be scrolled can be reached without a mouse. */
function reachCard() {
  const card = $("card");
  card.toggleAttribute("tabindex", card.scrollHeight > card.clientHeight);
  if (card.hasAttribute("tabindex")) card.tabIndex = 0;
}
addEventListener("resize", reachCard);

/* Without an idle action nothing is under way before the first key. */
function awaitsKey() {
  const counts = view.state === "countdown" && !view.step && !view.actions.some((a) => a.is_idle);
  return view.awaits_key || (counts && !view.held.length);
}

function showPill() {
  const action = (view.actions || [])[view.action];
  $("pill").hidden = !(runs() || watches()) || !action || awaitsKey() || (view.driving && !view.step);
  if ($("pill").hidden) return;
  if (view.driving) {
    $("acting").textContent = drives() ? `${view.driving.by_hand ? "you" : "tree"}: ${action.name}` : action.name;
    $("coming").hidden = true;
    $("pill").classList.toggle("on", drives() ? view.driving.by_hand : !action.is_idle);
    return;
  }
  const coming = view.actions[view.coming];
  $("acting").textContent = view.state === "playing" ? action.name : coming.name; // what counts next
  $("coming").hidden = coming === action || view.state !== "playing";
  $("coming").textContent = coming.name;
  $("pill").classList.toggle("on", !coming.is_idle);
}

/* The thin line: full when the next decision falls, so that a key never seems dead. */
const SHORTEST_BEAT = 0.15; // seconds; below that a line would only flicker
let beat = null;

function showBeat() {
  const moves = view.driving && !view.driving.is_over && !view.driving.is_paused;
  const plays = (moves || view.state === "playing") && !view.awaits_key && !view.turn_based && view.interval >= SHORTEST_BEAT;
  rebuild("beat", [plays, view.step, view.beat, view.interval], () => {
    beat?.cancel();
    beat = null;
    if (!plays) return;
    beat = $("beat-fill").animate([{ transform: `scaleX(${view.beat})` }, { transform: "scaleX(1)" }],
      { duration: 1000 * view.interval * (1 - view.beat), fill: "forwards" });
  });
}

// ---- the tree, and how to go on

const SVG = "http://www.w3.org/2000/svg";

function svg(parent, name, attributes, text = "") {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  parent.append(element);
  return element;
}

/* The whole tree at first; where its words are too small then, a button makes it larger, which is
   scrolled, and its rules stand below. A tree that would be a stripe is large at first. */
const READABLE = 0.75, STRIPE = 0.4; // shares of the drawing's own size
let isLarge = false;

function fitTree(large) {
  const tree = $("tree"), own = Number(tree.getAttribute("width"));
  if (!own || $("drawing").hidden) return;
  const share = $("drawing").clientWidth / own;
  isLarge = large ?? share < STRIPE;
  tree.style.minWidth = isLarge ? `${READABLE * own}px` : "0";
  $("larger").hidden = share >= READABLE;
  $("larger").textContent = isLarge ? "The whole tree" : "Larger";
}

/* Puts the drawing into the page, where its nodes can be lit; its style comes along as a sheet. */
function drawTree(text, leaves) {
  const [, style] = text.match(/<style>([^]*?)<\/style>/) || ["", ""]; // not in the page: its policy forbids that
  const drawing = new DOMParser().parseFromString(text.replace(/<style>[^]*?<\/style>/, ""), "image/svg+xml").documentElement;
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(style);
  document.adoptedStyleSheets = [sheet];
  drawing.id = "tree";
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label",
    `Drawing of the tree, ${leaves === 1 ? "one leaf" : `${leaves} leaves`}; the same as rules below`);
  $("drawing").replaceChildren(drawing);
  fitTree();
  $("rules-details").open ||= !$("larger").hidden;
}

/* The way of the present decision: lit in the drawing, and in words beside the picture. */
function showWay() {
  const nodes = new Set((view.driving?.nodes || []).map(String)), tree = $("tree");
  $("way-section").hidden = !nodes.size;
  tree.classList.toggle("drives", nodes.size > 0);
  const edges = tree.querySelectorAll(".eutree-edge");
  tree.querySelectorAll(".eutree-test").forEach((node, k) => {
    edges[2 * k]?.classList.toggle("lit", nodes.has(node.dataset.yes));
    edges[2 * k + 1]?.classList.toggle("lit", nodes.has(node.dataset.no));
  });
  for (const node of tree.querySelectorAll("[data-node]")) node.classList.toggle("lit", nodes.has(node.dataset.node));
  if (!nodes.size) return;
  const lines = [...view.driving.tests, `so: ${view.actions[view.driving.action].name}`];
  words($("way"), ...lines.map((line) => {
    const item = document.createElement("li");
    item.textContent = line;
    return item;
  }));
}
$("larger").addEventListener("click", () => fitTree(!isLarge));
addEventListener("resize", () => fitTree());

let scrolledAt = ""; // the phase at which the tree was last brought into view

function showTree() {
  const tree = view.tree;
  const was = $("verdict-section").hidden;
  $("verdict-section").hidden = !tree;
  $("tree-section").hidden = !tree || !(tree.svg || tree.curve.length);
  body.dataset.tree = tree ? tree.phase : "";
  if (!tree) return;
  $("verdict").textContent = isMaking() && isOver() ? "Given up before it was done" : tree.message.replaceAll(" %", "\u00a0%"); // a number and its unit stay together
  $("verdict-section").dataset.verdict = tree.phase === "failed" ? BAD
    : ["better", "as good"].includes(tree.verdict) ? GOOD : "";
  $("tree-note").textContent = tree.note;
  $("tree-note").hidden = !tree.note;
  $("work").hidden = !works();
  if (tree.of) { $("work").max = tree.of; $("work").value = tree.finished; } else { $("work").removeAttribute("value"); }
  $("drawing").hidden = !tree.svg;
  if (!tree.svg) $("larger").hidden = true;
  if (tree.svg) rebuild("drawing", tree.svg, () => drawTree(tree.svg, tree.n_leaves));
  $("rules-details").hidden = !tree.rules;
  $("rules").textContent = tree.rules;
  showCurve(tree);
  rebuild("ways", [tree.ways, tree.columns, tree.changes, view.state, acts()], () => showWays(tree));
  if (was) $("episodes-list").open = false; // the tree is what matters now
  if (was || tree.phase !== scrolledAt) $("verdict-section").scrollIntoView({ block: "nearest" });
  scrolledAt = tree.phase;
}

/* The person's way beside the tree of it, the practised one and those between, to choose from. */
function showWays(tree) {
  const ways = tree.ways || [];
  $("ways-section").hidden = !ways.length;
  const heads = (tree.columns || []).map((text) => {
    const head = document.createElement("th");
    head.scope = "col";
    head.textContent = text || "Way";
    return head;
  });
  words($("ways-head"), ...heads, cell(""));
  let place = 0;
  wordsThatGo($("ways"), ...ways.map((way) => {
    const row = document.createElement("tr");
    row.classList.toggle("on", way.is_kept);
    const last = document.createElement("td");
    if (way.keep) {
      const number = ++place, button = document.createElement("button");
      button.type = "button";
      button.textContent = way.is_kept ? "Kept" : way.keep;
      button.disabled = way.is_kept || !acts() || isOver() || runs();
      button.addEventListener("click", () => act("choose", number));
      last.append(button);
    }
    row.append(cell(way.name), ...way.cells.map((text) => cell(text)), last);
    return row;
  }));
  words($("changes"), ...(tree.changes || []).map((text) => {
    const item = document.createElement("li");
    item.textContent = text.replaceAll("<=", "≤").replaceAll(/(\d) (?=[a-z%])/g, "$1\u00a0"); // a number and its unit stay together
    return item;
  }));
  $("changes-title").hidden = !(tree.changes || []).length;
}

/* What the practising tree reaches, by episodes of practice; the dashed line is the person. */
function showCurve(tree) {
  $("curve-figure").hidden = tree.curve.length === 0;
  if (tree.curve.length === 0) return;
  const values = tree.curve.map(([, value]) => value).concat(tree.yours === null ? [] : [tree.yours]);
  const low = tree.is_share ? 0 : Math.min(...values), high = tree.is_share ? 1 : Math.max(...values);
  const last = Math.max(tree.of, tree.curve.at(-1)[0], 1);
  const x = (episode) => 48 + 580 * episode / last;
  const y = (value) => 160 - 145 * (high > low ? (value - low) / (high - low) : 0.5);
  const said = (value) => tree.is_share ? `${Math.round(100 * value)} %` : value.toFixed(1);
  const chart = document.createElementNS(SVG, "svg");
  chart.setAttribute("viewBox", "0 0 680 190");
  chart.setAttribute("role", "img");
  const what = tree.is_share ? "successful episodes" : "mean return";
  chart.setAttribute("aria-label", `${what} by episodes of practice: `
    + tree.curve.map(([episode, value]) => `${episode}: ${said(value)}`).join(", "));
  for (const value of [low, high]) {
    svg(chart, "line", { class: "axis", x1: 48, x2: 628, y1: y(value), y2: y(value) });
    svg(chart, "text", { x: 42, y: y(value) + 4, "text-anchor": "end" }, said(value));
  }
  if (tree.yours !== null) {
    svg(chart, "line", { class: "you", x1: 48, x2: 628, y1: y(tree.yours), y2: y(tree.yours) });
    svg(chart, "text", { x: 634, y: y(tree.yours) + 4 }, "you");
  }
  const points = tree.curve.map(([episode, value]) => `${x(episode)},${y(value)}`).join(" ");
  svg(chart, "polyline", { class: "line", points });
  for (const [episode, value] of tree.curve) svg(chart, "circle", { cx: x(episode), cy: y(value), r: 3.5 });
  svg(chart, "text", { x: 48, y: 182 }, "0");
  svg(chart, "text", { x: 628, y: 182, "text-anchor": "end" }, `${last} episodes of practice`);
  $("curve-caption").textContent = `What it reaches as it practises (${what})`;
  words($("curve"), chart);
}

function commandsNow() {
  if (phase() === "ready") return view.tree.commands;
  return view.state === "finished" && view.saved && view.commands ? view.commands : [];
}

function showCommands() {
  const lines = commandsNow();
  $("commands-section").hidden = lines.length === 0;
  words($("commands"), ...lines.map((line) => {
    const row = document.createElement("div");
    row.className = "command";
    const code = document.createElement("code");
    words(code, ...line.split(/(?<= )/).map((word) => { // whole, or "--out" breaks behind its first hyphen
      const whole = document.createElement("span");
      whole.textContent = word;
      return whole;
    }));
    const copy = document.createElement("button");
    copy.type = "button";
    copy.textContent = "Copy";
    copy.setAttribute("aria-label", `Copy: ${line}`);
    copy.addEventListener("click", () => copyText(code, line, copy));
    row.append(code, copy);
    return row;
  }));
}

async function copyText(code, text, button) {
  try {
    await navigator.clipboard.writeText(text);
  } catch { // no permission, or no secure context: select it, so that Ctrl-C copies it
    getSelection().selectAllChildren(code);
    document.execCommand("copy");
  }
  label(button, "Copied");
  setTimeout(() => label(button, "Copy"), 1500);

  function label(of, word) {
    of.textContent = word;
    of.setAttribute("aria-label", `${word}: ${text}`);
  }
}

function sentence(episode) {
  const ended = { true: "Succeeded", false: "Failed" }[episode.success] || "The episode is over";
  const known = {
    goal: "Goal reached", collision: "Collision", "time limit": "Time is over", stopped: "Stopped by you",
    terminated: ended, truncated: "Time is over", interrupted: "Interrupted",
  };
  const text = known[episode.result] || episode.result.charAt(0).toUpperCase() + episode.result.slice(1);
  return episode.kept ? text : `${text} — ${episode.comment || "discarded"}`;
}

tabs.postMessage({ asks: me, client });
/* What arrives is shown by the scripts that come after this one, too: wait for them. */
addEventListener("DOMContentLoaded", () => setTimeout(connect, TAB_ANSWER));
