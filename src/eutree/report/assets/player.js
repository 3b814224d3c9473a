"use strict";
/* The episode player: frames, steps, the live path. */

let timer = null;

/** Return the number of the last step; at it nothing is decided any more. */
const lastStep = () => episodeNow().actions.length;

/** Show one step of the present episode. */
function goTo(step) {
  show({ step: Math.max(0, Math.min(lastStep(), step)) });
}

/** Start or stop playing. */
function play(on = timer === null) {
  clearInterval(timer);
  timer = null;
  if (on) {
    if (state.step >= lastStep()) goTo(0);
    timer = setInterval(() => {
      goTo(state.step + 1);
      if (state.step >= lastStep()) play(false);
    }, Number(byId("speed").value));
  }
  byId("play").classList.toggle("playing", timer !== null);
  byId("play").setAttribute("aria-label", timer === null ? "Play" : "Pause");
  byId("status").setAttribute("aria-live", timer === null ? "polite" : "off");
  document.body.dataset.playing = timer !== null;
}

/** Return the title of an episode in the list. */
function episodeTitle(episode, number) {
  const total = short(episode.rewards.reduce((a, b) => a + b, 0));
  const mark = episode.success === null ? "" : episode.success ? "✓ " : "✗ ";
  const name = episode.by || `Episode ${number + 1}`;
  return `${mark}${name}: ${episode.ending || "ended"}, return ${total}${episode.by ? "" : `, ${episode.actions.length} steps`}`;
}

/** Return what the policy decides at a step where that differs: in an episode of somebody else, or since it was edited. */
function decided(episode, step) {
  const [own, now] = decisions(episode, step);
  if (now !== own) return `edited: ${actions[now]}, `;
  const first = original.leafActions[episode.recorded[step]];
  const other = episode.actions[step] === own ? "" : `this tree: ${actions[own]}, `;
  return other + (own === first ? "" : `as ${actions[first]} is not allowed, `);
}

/** Draw the present step: picture, words, values. */
function drawStep() {
  const episode = episodeNow();
  const { step } = state;
  const frame = episode.frames?.[step];
  byId("frame").hidden = !frame;
  byId("no-frame").hidden = Boolean(frame);
  if (frame) {
    byId("frame").src = frame;
    byId("frame").alt = `The environment at step ${step} of episode ${state.episode + 1}`;
  }
  byId("episode").value = state.episode;
  byId("step").max = lastStep();
  byId("step").value = step;
  byId("step").setAttribute("aria-valuetext", `step ${step} of ${lastStep()}`);
  const soFar = short(episode.rewards.slice(0, step).reduce((a, b) => a + b, 0));
  const action = element("strong", {}, step < lastStep() ? actions[episode.actions[step]] : episode.ending || "end");
  byId("status").replaceChildren(
    `Step ${step} of ${lastStep()}: `, action,
    step < lastStep() ? `, ${decided(episode, step)}leaf ${episode.leaves[step]}, return so far ${soFar}` : `, return ${soFar}`,
  );
  drawObservation(observationNow());
}

/** Draw each value where it lies between its bounds. */
function drawObservation(values) {
  const rows = values.flatMap((value, feature) => {
    const [low, high] = ranges[feature];
    const x = Number.isNaN(value) ? 0 : 100 * Math.min(1, Math.max(0, (value - low) / (high - low)));
    const bar = drawing("svg", { viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" },
      drawing("line", { x1: 0, x2: 100, y1: 5, y2: 5, stroke: "var(--line)", "stroke-width": 4 }),
      drawing("rect", { x: Math.min(98, Math.max(0, x - 1)), y: 0, width: 2, height: 10, fill: "var(--live)" }));
    const name = element("span", { title: features[feature].name }, features[feature].name);
    return [name, bar, element("span", {}, valueWords(value, feature))];
  });
  byId("observation").replaceChildren(...rows);
}

if (data.episodes.length === 0) {
  byId("episode-panel").hidden = true;
  document.querySelector(".skip")?.setAttribute("hidden", "");
} else {
  byId("episode").append(...data.episodes.map((episode, number) => element("option", { value: number }, episodeTitle(episode, number))));
  byId("episode").addEventListener("change", (event) => {
    play(false);
    show({ episode: Number(event.target.value), step: 0, selected: null });
  });
  byId("step").addEventListener("input", (event) => {
    play(false);
    goTo(Number(event.target.value));
  });
  const buttons = {
    first: () => goTo(0), back: () => goTo(state.step - 1),
    forward: () => goTo(state.step + 1), last: () => goTo(lastStep()),
  };
  for (const [id, move] of Object.entries(buttons)) {
    byId(id).addEventListener("click", () => {
      play(false);
      move();
    });
  }
  byId("play").addEventListener("click", () => play());
  byId("speed").addEventListener("change", () => timer !== null && play(true));
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary, a, [role=tree]") || event.ctrlKey || event.metaKey || event.altKey) return;
    const keys = { ArrowLeft: buttons.back, ArrowRight: buttons.forward, " ": play };
    if (!keys[event.key]) return;
    event.preventDefault();
    if (event.key !== " ") play(false);
    keys[event.key]();
  });
  onChange(drawStep);
  onChange(() => {
    const leaf = liveLeaf();
    if (leaf === null || !byId("follow").checked || state.selected !== null) return;
    const node = pathTo(nodeOfLeaf[leaf]).filter((above) => places.has(above)).pop();
    bringIntoView(node);
  });
}
