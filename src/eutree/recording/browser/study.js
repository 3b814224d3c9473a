"use strict";

/* A study leads the person part by part: what it says stands on a card, or above the picture. All
   decisions are the recorder's; the part is published in data-study and data-part of <body>. */

function tell(name, place = 0, text = "") { send({ type: "tell", name, place, text }); }

/* Answers of this page, by their places: those that a broken connection lost are told again. */
const given = new Map();
function answer(place, text) {
  given.set(place, text);
  tell("answer", place, text);
}

/* Whether a command may be given now. */
function allowed(name) { return !view.study || view.study.allowed.includes(name); }

function showStudy(wasLost) {
  const study = view.study;
  if (!acts()) given.clear(); // another page answers
  if (wasLost) for (const [place, text] of given) tell("answer", place, text);
  body.dataset.study = !study ? "" : study.is_card ? "card" : "on";
  body.dataset.part = study ? study.part : "";
  if (!study) return;
  $("study").hidden = !study.is_card;
  $("study-part").textContent = study.place ? `Part ${study.place} of ${study.of}` : "";
  $("withdraw").hidden = !study.may_withdraw || isOver();
  $("withdraw").disabled = !acts();
  rebuild("study", [study.part, study.is_card, study.title, study.text, study.buttons, acts(), isOver()], () => {
    $("study-title").textContent = study.title;
    $("study-title").hidden = study.part === "consent"; // its text has a heading of its own
    words($("study-text"), ...paragraphs(study.text));
    words($("study-buttons"), ...(isOver() ? [] : study.buttons.map(studyButton)));
    if (isOver() && study.part === "thanks") $("study-text").append(paragraph("p", "You can close this page."));
    if (!study.is_card) { $("picture").focus(); return; }
    $("announce").textContent = [study.title, study.text].join(". ").replaceAll(/[#*\n]+/g, " ");
    scrollTo(0, 0);
    $("study").focus();
  });
  rebuild("questions", [study.questions, acts() || study.answers], () => words($("questions"), ...study.questions.map(question)));
  $("study-work").hidden = !study.works || !view.tree;
  $("study-works").textContent = study.tells && view.tree ? view.tree.message : "";
  if (view.tree?.of) { $("study-work").max = view.tree.of; $("study-work").value = view.tree.finished; }
  else $("study-work").removeAttribute("value");
}

function studyButton([name, text], place) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = text;
  button.dataset.tell = name;
  if (place === 0) button.className = "first";
  button.disabled = !acts();
  button.addEventListener("click", () => tell(name));
  return button;
}

function paragraph(name, text) {
  const element = document.createElement(name);
  const stars = /(^|[^\p{L}\p{N}_*])\*{1,3}([^\s*](?:[^*]*[^\s*])?)\*{1,3}/u; // no star after a word opens
  for (const [place, part] of text.split(stars).entries()) { // text, what stands before the star, what is meant
    const isMeant = place % 3 === 2;
    const piece = isMeant ? document.createElement("em") : document.createTextNode(part);
    if (isMeant) piece.textContent = part;
    element.append(piece);
  }
  return element;
}

/* Headings, paragraphs and lists of a plain Markdown text: no word of it is left out. */
function paragraphs(text) {
  const blocks = []; // name, texts; a text goes on until something else begins
  let open = null;
  for (const line of text.trim().split(/\r?\n/)) {
    const [, heading] = line.match(/^#+\s+(.*)/) || [];
    const [, mark, item] = line.match(/^\s*([-*+]|\d+[.)])\s+(.*)/) || [];
    const name = mark && (/\d/.test(mark) ? "ol" : "ul"), last = blocks.at(-1);
    if (!line.trim()) { open = last?.items && open; if (open) open.rest = true; }
    else if (heading !== undefined) { blocks.push({ name: "h2", text: heading }); open = null; }
    else if (mark) {
      const number = parseInt(mark), above = last?.name === name && last.items.at(-1);
      open = { text: item, number };
      if (above && !(above.rest && number <= above.number)) last.items.push(open); // a new list begins with a number again
      else blocks.push({ name, items: [open] });
    } else if (open && !(open.rest && /^\S/.test(line))) open.text += ` ${line.trim()}`;
    else blocks.push(open = { name: "p", text: line.trim() });
  }
  return blocks.map((block) => {
    if (!block.items) return paragraph(block.name, block.text);
    const list = document.createElement(block.name);
    let shown = 0, before = 0; // as written; but the same number for all, as Markdown allows, counts
    list.append(...block.items.map(({ text, number }, place) => {
      const item = paragraph("li", text), next = place && number === before ? shown + 1 : number;
      if (block.name === "ol" && next !== shown + 1) item.value = next;
      [shown, before] = [next, number];
      return item;
    }));
    return list;
  });
}

/* A question: a scale, choices, or a field for words; each answer is kept as soon as it is given. */
function question(asked, place) {
  const group = document.createElement("fieldset"), legend = document.createElement("legend");
  legend.textContent = asked.text;
  group.append(legend);
  const options = asked.choices.length ? asked.choices : Array.from({ length: asked.points }, (_, k) => String(k + 1));
  if (!options.length) {
    const field = document.createElement("textarea");
    field.setAttribute("aria-label", asked.text);
    field.maxLength = 400;
    field.value = view.study.answers[place];
    field.disabled = !acts();
    field.addEventListener("input", () => answer(place, field.value));
    group.append(field);
    return group;
  }
  const row = document.createElement("div");
  row.className = asked.choices.length ? "choices" : "scale";
  row.append(...options.map((option, k) => {
    const label = document.createElement("label"), input = document.createElement("input");
    input.type = "radio";
    input.name = `question-${place}`;
    input.value = option;
    input.checked = view.study.answers[place] === option;
    input.disabled = !acts();
    input.addEventListener("change", () => answer(place, option));
    label.append(input, document.createTextNode(option));
    const end = asked.choices.length ? "" : k === 0 ? asked.low : k === options.length - 1 ? asked.high : "";
    if (end) { // for the ear; the eye reads the ends of the scale below it
      const meaning = document.createElement("span");
      meaning.className = "unseen";
      meaning.textContent = `: ${end}`;
      label.append(meaning);
    }
    return label;
  }));
  group.append(row);
  if (!asked.choices.length && (asked.low || asked.high)) {
    const ends = document.createElement("p");
    ends.className = "ends soft";
    ends.setAttribute("aria-hidden", "true");
    for (const text of [`1: ${asked.low}`, `${options.length}: ${asked.high}`]) {
      const end = document.createElement("span");
      end.textContent = text;
      ends.append(end);
    }
    group.append(ends);
  }
  return group;
}

$("withdraw").addEventListener("click", () => tell("withdraw"));
