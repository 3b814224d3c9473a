"use strict";
/* Search in tests and leaves. */

let matches = [];
let current = -1;

/** Mark what the search finds and say how much it is. */
function search() {
  const wanted = byId("search").value.trim().toLowerCase();
  matches = [];
  for (let node = 0; wanted && node < nNodes; node++) {
    const words = isLeaf(node) ? `leaf ${tree.leaf[node]} ${wordsOf(node)}` : wordsOf(node);
    const exactLeaf = /^leaf \d+$/.test(wanted);
    const hit = exactLeaf ? isLeaf(node) && `leaf ${tree.leaf[node]}` === wanted : words.toLowerCase().includes(wanted);
    if (hit) matches.push(node);
  }
  current = -1;
  markMatches();
  sayCount();
}

/** Outline the matches and fade everything else. */
function markMatches() {
  const found = new Set(matches);
  byId("nodes").classList.toggle("dimmed", matches.length > 0);
  for (const group of byId("nodes").children) {
    group.classList.toggle("found", found.has(Number(group.dataset.node)));
  }
}

/** Say which match is shown, of how many. */
function sayCount() {
  const wanted = byId("search").value.trim();
  const count = matches.length === 1 ? "1 found" : `${matches.length} found`;
  byId("search-count").textContent = !wanted ? "" : current < 0 ? count : `${current + 1} of ${matches.length}`;
}

/** Select the next match. */
function nextMatch() {
  if (!matches.length) return;
  current = (current + 1) % matches.length;
  const node = matches[current];
  point(node);
  markMatches();
  sayCount();
}

byId("search").addEventListener("input", search);
byId("search").addEventListener("keydown", (event) => {
  if (event.key === "Escape") {
    byId("search").value = "";
    search();
  }
});
byId("search-form").addEventListener("submit", (event) => {
  event.preventDefault();
  nextMatch();
});
marks.push(markMatches);
