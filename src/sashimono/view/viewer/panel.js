// Everything that is not the 3D view. Names and reasons come from files: they are only ever set as text.

/** How a step's part is held, in words: the grasp that carries it first, a push with its force. */
function contactWords({ contact, carry }) {
  // no exponents, and nothing that is there as 0
  const short = (value) => (value >= 1e-3 ? +value.toPrecision(3) : value > 5e-5 || !value ? +value.toFixed(4) : "less than 0.0001");
  const words = carry ? [`${carry.kind}, then`, contact.kind] : [contact.kind];
  if (contact.kind === "grasp" && contact.quality !== null) words.push(`of quality ${short(contact.quality)}`);
  if (contact.kind === "push" && contact.force) words.push(`with ${short(Math.hypot(...contact.force[0]))} N`);
  return words.join(" ");
}

function element(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children.filter((child) => child !== null));
  return node;
}

function button(label, path, action, className = "") {
  const node = element("button", { type: "button", title: label, className, onclick: action });
  node.setAttribute("aria-label", label);
  setIcon(node, path);
  return node;
}

function setIcon(node, path) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const shape = document.createElementNS("http://www.w3.org/2000/svg", "path");
  svg.setAttribute("viewBox", "0 0 16 16");
  shape.setAttribute("d", path);
  svg.append(shape);
  node.replaceChildren(svg);
}

const ICONS = {
  play: "M4 2.2v11.6L13.6 8z", pause: "M3.5 2.5h3.2v11H3.5zM9.3 2.5h3.2v11H9.3z",
  previous: "M3 2.5h2v11H3zM13.5 2.5v11L5.8 8z", next: "M11 2.5h2v11h-2zM2.5 2.5v11L10.2 8z",
};
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
const ANSWERS = { PROVEN_BLOCKED: "proven blocked", UNKNOWN: "unknown" };

function formatLength(metres) {
  const mm = metres * 1000;
  if (Math.abs(mm) >= 1000) return `${+(mm / 1000).toPrecision(4)} m`;
  if (Math.abs(mm) < 1e-5) return "0 mm"; // less is rounding
  if (Math.abs(mm) < 0.001) return `${+(mm * 1000).toFixed(2)} µm`;
  return `${+mm.toPrecision(3)} mm`;
}

function deepest(steps) {
  const known = steps.filter((step) => step.penetration !== null);
  if (!known.length) return "not measured";
  const worst = known.reduce((a, b) => (b.penetration > a.penetration ? b : a));
  const limit = worst.tolerance === null ? "" : ` of ${formatLength(worst.tolerance)}`;
  return formatLength(worst.penetration) + limit;
}

function describeStep(step) {
  const facts = [];
  if (step.way) facts.push(`goes in ${step.way}`);
  if (step.simultaneous.length) facts.push(`at the same time as ${step.simultaneous.join(", ")}`);
  if (step.declaredPitch !== null) {
    facts.push(`screwed in, pitch ${formatLength(step.declaredPitch)} (declared: the CAD has no thread)`);
  }
  if (step.contact) facts.push(contactWords(step));
  else if (step.contactReason && step.poses.length > 1) facts.push(`no grasp: ${step.contactReason}`);
  if (step.toolBlocked) facts.push(`${step.tool}: ${step.toolBlocked}`);
  if (step.closeFits.length) facts.push(`close fit with ${step.closeFits.join(", ")} (the CAD shows no clearance)`);
  if (step.held.length) facts.push(`hold ${step.held.join(", ")}`);
  if (step.penetration !== null) facts.push(`overlap ${deepest([step])} allowed`);
  return facts.join(" · ");
}

const TURN = "Turn the product over";
const PHASES = { hold: "", turn: " · turned over, a way that is not planned", carry: " · carried over, a way that is not planned", transit: " · on its way from where it waits", wait: " · waits for what goes in at the same time", insertion: " · going in" };
const KEYS = [
  ["Space", "play or pause"], ["← →", "previous, next step"], ["Home, End", "first, last"], ["/", "find a part by its name"],
  ["F", "show everything"], ["Shift + ← → ↑ ↓", "turn the view"], ["+ −", "nearer, farther"], ["C", "follow each step"],
  ["E", "draw apart, together"], ["H", "hide the chosen part"], ["I", "show the chosen part alone"], ["S", "cut by a plane"],
  ["X Y Z", "axis of the cut"], [", .", "move the cut"], ["V", "other side of the cut"], ["M", "measure"],
  ["Arrows, Enter", "in the picture: aim and pick"], ["Esc", "leave, choose none, show all"],
];

/** A name that is cut in its middle where there is no room: the end tells _1 from _2. */
function nameElement(name) {
  const tail = name.length > 8 ? name.slice(-Math.max(4, (name.match(/_?\d+$/) ?? [""])[0].length)) : "";
  return element("span", { className: "name" },
    element("span", { className: "head", textContent: tail ? name.slice(0, -tail.length) : name }),
    element("span", { className: "tail", textContent: tail }));
}

class Panel {
  constructor(plan, player) {
    this.plan = plan;
    this.player = player;
    this.caption = document.getElementById("caption");
    this.tip = document.getElementById("tip");
    this.#side();
    this.#bar();
    this.#tools();
  }

  #side() {
    const { plan } = this;
    const moves = plan.steps.filter((step) => step.poses.length > 1);
    const held = moves.filter((step) => step.contact).length;
    const complete = plan.status === "complete" && !plan.unsolved.length;
    const unplanned = plan.status === "in place";
    const badge = unplanned ? "Assembled pose, not planned" : complete ? "Complete & verified" : `Partial: ${plan.unsolved.length} of ${plan.parts.length} parts unsolved`;
    const figures = [
      ["Parts", String(plan.parts.length)], ["Steps", this.#count(plan.steps)],
      ["With a grasp or push", `${held} of ${moves.length}`], ["Deepest overlap", deepest(moves)],
    ];
    const list = element("dl", {}, ...figures.flatMap(([name, value]) => [
      element("dt", { textContent: name }), element("dd", { textContent: value }),
    ]));
    const header = element("header", {}, element("h1", { textContent: plan.title }),
      element("span", { className: complete || unplanned ? "badge" : "badge partial", textContent: badge }),
      unplanned ? null : element("p", { className: "note", textContent: plan.verdict }), list, this.#finder());
    const lists = element("div", { id: "lists" });
    this.unsolvedRows = plan.unsolved.map((item) => this.#unsolvedRow(item));
    if (plan.unsolved.length) lists.append(element("h2", { textContent: "Unsolved" }), element("ol", {}, ...this.unsolvedRows));
    this.rows = plan.steps.map((step, k) => this.#stepRow(step, k));
    lists.append(element("h2", { textContent: "Steps" }), element("ol", {}, ...this.rows.map((row) => element("li", {}, row))));
    if (plan.notes.length) {
      lists.append(element("h2", { textContent: "Notes" }), ...plan.notes.map((note) => element("p", { className: "note", textContent: note })));
    }
    this.lists = lists;
    document.getElementById("side").replaceChildren(header, lists);
  }

  /** A field that leaves the rows of the parts whose names hold what is typed. */
  #finder() {
    this.search = element("input", { type: "search", placeholder: "Find a part (/)", autocomplete: "off", spellcheck: false });
    this.search.setAttribute("aria-label", "Find a part by its name");
    this.found = element("span", { className: "note" });
    this.found.setAttribute("role", "status");
    this.search.addEventListener("input", () => this.player.find(this.search.value));
    this.search.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.player.chooseFound();
      if (event.key === "Escape" && !this.search.value) this.search.blur();
    });
    return element("div", { id: "finder" }, this.search, this.found);
  }

  /** Show only the rows with one of these parts, or with null all. */
  showFound(parts, text) {
    const known = parts && new Set(parts);
    const shown = (members) => !known || members.some((part) => known.has(part));
    this.rows.forEach((row, k) => (row.parentElement.hidden = !shown(this.plan.steps[k].moving)));
    this.unsolvedRows.forEach((row, k) => (row.hidden = !shown([this.plan.unsolved[k].part])));
    this.found.textContent = parts ? `${parts.length} of ${this.plan.parts.length} parts` : "";
    if (this.search.value !== text) this.search.value = text;
  }

  /** "5", or "5, and 3 inside subassemblies". */
  #count(steps) {
    const own = steps.filter((step) => !step.turns);
    const inside = own.filter((step) => step.depth > 0).length;
    return String(own.length - inside) + (inside ? ` + ${inside} inside` : "");
  }

  #swatch(part) {
    const swatch = element("span", { className: "swatch" });
    swatch.style.background = this.plan.parts[part].color;
    return swatch;
  }

  #stepRow(step, k) {
    const name = step.turns ? TURN : step.product ?? this.plan.parts[step.part].name;
    const tag = step.poses.length < 2 ? "base" : step.contact ? step.contact.kind : "no grasp";
    const row = element("button", { type: "button", className: step.depth ? "row inside" : "row", title: name, onclick: () => this.player.showStep(k) },
      element("span", { className: "number", textContent: step.label }), this.#swatch(step.part),
      nameElement(name), element("span", { className: "tag", textContent: tag }),
      element("span", { className: "more", textContent: this.#members(step) }),
      element("span", { className: "more when-current", textContent: describeStep(step) }));
    this.#hovers(row, step.part);
    return row;
  }

  /** The parts of a subassembly, in words; nothing for a single part. */
  #members(step) {
    if (step.turns || step.moving.length < 2) return "";
    return `subassembly of ${step.moving.length}: ${step.moving.map((part) => this.plan.parts[part]).map(({ name, solved }) => (solved ? name : `${name} (unsolved)`)).join(", ")}`;
  }

  #title(step) {
    if (step.turns) return TURN;
    const others = step.moving.length - 1;
    if (step.product) return `${step.product}, ${others + 1} parts`;
    return this.plan.parts[step.part].name + (others > 0 ? ` and ${others} more` : "");
  }

  #titleNodes(step) {
    if (step.turns) return [TURN];
    const others = step.moving.length - 1;
    if (step.product) return [nameElement(step.product), `, ${others + 1} parts`];
    return [nameElement(this.plan.parts[step.part].name), ...(others > 0 ? [` and ${others} more`] : [])];
  }

  #unsolvedRow(item) {
    const reason = item.reason.replace(/\.?\s*$/, ".");
    const by = item.blockedBy.length ? ` Blocked by ${item.blockedBy.join(", ")}.` : "";
    const row = element("div", { className: "row unsolved" }, element("span"), this.#swatch(item.part),
      nameElement(this.plan.parts[item.part].name),
      element("span", {
        className: "tag",
        textContent: (ANSWERS[item.answer] ?? item.answer) + (item.provenFor ? ` for ${item.provenFor}` : ""),
      }),
      element("span", { className: "more", textContent: reason + by }));
    this.#hovers(row, item.part);
    return element("li", {}, row);
  }

  #hovers(row, part) {
    row.addEventListener("pointerenter", () => this.player.hover(part));
    row.addEventListener("pointerleave", () => this.player.hover(-1));
  }

  #bar() {
    const { plan, player } = this;
    this.playButton = button("Play (space)", ICONS.play, () => player.toggle(), "play");
    this.slider = element("input", { type: "range", min: 0, max: plan.duration, step: "any", value: 0 });
    this.slider.addEventListener("input", () => player.setTime(Number(this.slider.value)));
    this.ticks = plan.steps.map((step) => {
      const tick = element("i", { title: this.#title(step) });
      tick.style.left = `${(100 * step.start) / plan.duration}%`;
      tick.style.width = `${(100 * (step.stop - step.start)) / plan.duration}%`;
      tick.style.background = plan.parts[step.part].color;
      return tick;
    });
    this.slider.setAttribute("aria-label", "Time in the animation");
    const speed = element("select", { title: "Speed" }, ...SPEEDS.map((s) => element("option", { value: s, textContent: `${s}×`, selected: s === 1 })));
    speed.setAttribute("aria-label", "Speed");
    speed.addEventListener("change", () => (player.speed = Number(speed.value)));
    this.clock = element("span", { className: "clock" });
    document.getElementById("bar").replaceChildren(
      element("div", { className: "buttons" }, button("Previous step (←)", ICONS.previous, () => player.skip(-1)), this.playButton,
        button("Next step (→)", ICONS.next, () => player.skip(1))),
      element("div", { id: "track" }, element("div", { className: "steps" }, ...this.ticks), this.slider), this.clock, speed);
  }

  #tools() {
    const { player } = this;
    this.toggles = {};
    const toggle = (key, label, title) => {
      const onclick = () => player.setView({ [key]: !player.view[key] });
      return (this.toggles[key] = element("button", { type: "button", textContent: label, title, onclick }));
    };
    this.explode = element("input", { type: "range", min: 0, max: 1, step: 0.01, value: 0 });
    this.explode.addEventListener("input", () => player.setView({ explode: Number(this.explode.value) }));
    document.getElementById("tools").append(
      element("label", {}, "Explode", this.explode), toggle("section", "Section", "Cut by a plane (S)"),
      toggle("measure", "Measure", "Distances and angles between two picks (M)"),
      toggle("follow", "Follow", "Look at each step from where it is best seen (C)"),
      this.#menu("Show", element("div", {}, toggle("contacts", "Contacts", "Show how the moving part is held"),
        toggle("table", "Table", "Show the table and the tray"), toggle("xray", "See through", "Make placed parts transparent"),
        ...(this.plan.parts.some((part) => part.cadColor) ? [toggle("cadColors", "CAD colours", "Use the colours of the source file")] : []))),
      element("button", { type: "button", textContent: "Fit", title: "Show everything (F)", onclick: () => player.fit() }),
      this.#menu("Keys", this.#shortcuts()), this.#cutter(), this.#gauge());
    this.showView(player.view);
    this.choice = element("div", { id: "choice", hidden: true });
    this.choice.setAttribute("role", "group");
    this.choice.setAttribute("aria-label", "The chosen part");
    document.getElementById("stage").append(this.choice);
  }

  #shortcuts() {
    const list = element("dl", {}, ...KEYS.flatMap(([key, what]) => [element("dt", { textContent: key }), element("dd", { textContent: what })]));
    // where it is too long for the window, the arrow keys move it
    const frame = element("div", { className: "keys", tabIndex: 0 }, list);
    frame.setAttribute("role", "region");
    frame.setAttribute("aria-label", "Keys");
    return frame;
  }

  /** A list that opens below its word, and closes when something else is pressed. */
  #menu(label, list) {
    const menu = element("details", { className: "menu" }, element("summary", { textContent: label }), list);
    document.addEventListener("pointerdown", (event) => { if (!menu.contains(event.target)) menu.open = false; });
    menu.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !menu.open) return;
      menu.open = false;
      menu.firstChild.focus();
      event.stopPropagation();
    });
    return menu;
  }

  /** What the section is set by. */
  #cutter() {
    const { player } = this;
    this.axes = AXES.map((name, axis) => {
      const node = element("button", { type: "button", textContent: name, title: `Cut across ${name} (${name})`, onclick: () => player.setSection({ axis }) });
      node.setAttribute("aria-label", `Cut across the ${name} axis`);
      return node;
    });
    this.place = element("input", { type: "range", min: 0, max: 1, step: 0.001, value: 0.5 });
    this.place.setAttribute("aria-label", "Place of the cut");
    this.place.addEventListener("input", () => player.setSection({ share: Number(this.place.value) }));
    this.placeWords = element("output");
    this.cutter = element("div", { id: "cutter", hidden: true }, ...this.axes, this.place, this.placeWords,
      element("button", { type: "button", textContent: "Flip", title: "Show the other side of the cut (V)", onclick: () => player.setSection({ flip: true }) }));
    this.cutter.setAttribute("role", "group");
    this.cutter.setAttribute("aria-label", "Section");
    return this.cutter;
  }

  showSection({ axis, share }, at) {
    this.axes.forEach((node, k) => node.setAttribute("aria-pressed", String(k === axis)));
    this.place.value = share;
    this.placeWords.textContent = `${AXES[axis].toLowerCase()} = ${(Math.round(1e5 * at) / 100 || 0).toFixed(2)} mm`;
    this.place.setAttribute("aria-valuetext", this.placeWords.textContent);
  }

  /** What was measured. */
  #gauge() {
    this.measured = element("dl");
    this.hint = element("p", { className: "note" });
    this.gauge = element("div", { id: "gauge", hidden: true }, this.hint, this.measured,
      element("button", { type: "button", textContent: "Clear", title: "Forget what was picked (Esc)", onclick: () => this.player.clearPicks() }));
    this.gauge.setAttribute("role", "group");
    this.gauge.setAttribute("aria-label", "Measure");
    this.hint.setAttribute("role", "status");
    return this.gauge;
  }

  showMeasure(rows, count) {
    this.hint.textContent = ["Pick a corner, an edge or a face.", "Pick another one.", "A third pick begins anew."][count];
    this.measured.replaceChildren(...rows.flatMap(([what, value]) => [element("dt", { textContent: what }), element("dd", { textContent: value })]));
  }

  /** Say which part is chosen, and what can be done with it; nothing is chosen with -1. */
  showChoice(part, hidden, alone) {
    this.choice.hidden = part < 0 && !hidden;
    const { player } = this;
    const act = (label, title, onclick) => element("button", { type: "button", textContent: label, title, onclick });
    this.choice.replaceChildren(...(part < 0 ? [] : [
      element("div", {}, element("b", {}, nameElement(this.plan.parts[part].name)),
        element("span", { textContent: player.bodies.extents(part).map(formatLength).join(" × "), title: "Size along x, y and z as assembled" })),
      act("Hide", "Hide this part (H)", () => player.hide(part)),
      act(alone ? "With others" : "Alone", "Show this part alone (I)", () => player.isolate(part)),
    ]), ...(hidden ? [act("Show all", "Show all parts again (Esc)", () => player.choose(-1))] : []));
  }

  /** Let the switches and the slider say what is shown. */
  showView(view) {
    this.explode.value = view.explode;
    for (const [key, node] of Object.entries(this.toggles)) node.setAttribute("aria-pressed", String(view[key]));
    this.cutter.hidden = !view.section;
    this.gauge.hidden = !view.measure;
  }

  update(t, k, phase, playing) {
    const { plan } = this;
    const step = plan.steps[k];
    const over = t >= plan.duration;
    const seconds = (x) => `${Math.floor(x / 60)}:${String(Math.floor(x % 60)).padStart(2, "0")}`;
    this.clock.textContent = `${seconds(t)} / ${seconds(plan.duration)}`;
    this.slider.value = t;
    if (this.playing !== playing) {
      setIcon(this.playButton, playing ? ICONS.pause : ICONS.play);
      this.playButton.title = playing ? "Pause (space)" : "Play (space)";
      this.playButton.setAttribute("aria-label", this.playButton.title);
      this.playing = playing;
    }
    const what = step && step.poses.length < 2 ? " · base part, stays in place" : PHASES[phase];
    const where = step && step.depth ? " · inside a subassembly" : "";
    this.caption.replaceChildren(
      element("b", {}, ...(step ? this.#titleNodes(step) : ["No step was found"])),
      element("span", { textContent: step ? `Step ${step.label} of ${plan.steps.at(-1).label}${where}${over ? " · done" : what}` : "All parts are shown in place" }));
    this.slider.setAttribute("aria-valuetext", step ? `step ${step.label}, ${this.#title(step)}, ${seconds(t)}` : seconds(t));
    if (this.current === k) return;
    this.current = k;
    this.rows.forEach((row, i) => {
      row.classList.toggle("done", i < k);
      if (i === k) row.setAttribute("aria-current", "step");
      else row.removeAttribute("aria-current");
      this.ticks[i].className = i === k ? "current" : i < k ? "done" : "";
    });
    const row = this.rows[k];
    if (!row) return;
    // on a narrow page the list scrolls together with what is above it
    const scroller = getComputedStyle(this.lists).overflowY === "visible" ? this.lists.parentElement : this.lists;
    const [view, here] = [scroller.getBoundingClientRect(), row.getBoundingClientRect()];
    if (here.top < view.top || here.bottom > view.bottom) scroller.scrollTop += here.top - view.top - view.height / 3;
  }

  /** The cross with which a keyboard aims; null for none. */
  showAim(place) {
    this.cross ??= document.getElementById("stage").appendChild(element("div", { id: "aim" }));
    this.cross.hidden = !place;
    if (place) Object.assign(this.cross.style, { left: `${place[0]}px`, top: `${place[1]}px` });
  }

  showTip(name, x, y) {
    this.tip.hidden = !name;
    this.tip.replaceChildren(nameElement(name));
    this.tip.style.left = `${x}px`;
    this.tip.style.top = `${y}px`;
  }
}
