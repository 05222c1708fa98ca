// What an input is like: a list of findings, and the parts that the chosen line is about.

const ROLES = {
  plain: { color: "#a9b4c1", opacity: 1 },
  shown: { color: "#e88a2e", opacity: 1 },
  other: { color: "#6f94bd", opacity: 0.5 },
  wrong: { color: "#d6303c", opacity: 1 },
  faint: { color: "#98a2b3", opacity: 0.1 },
};
const MARK_COLOR = "#d6303c";
const SEVERITIES = { error: ["#d6303c", "In the way"], warning: ["#e88a2e", "Warnings"], note: ["#6f94bd", "Notes"] };

function formatShare(share) {
  return `${share < 0.1 ? (100 * share).toPrecision(2) : Math.round(100 * share)} %`;
}

class Doctor {
  constructor() {
    this.plan = readPlan();
    this.buffer = readBytes();
    this.bodies = new Bodies(this.plan, null, this.buffer);
    this.bodies.items.forEach((item, k) => {
      item.node.matrix.copy(matrixOf(compose(this.plan.parts[k].assembled, item.shapePose)));
      item.node.matrixWorldNeedsUpdate = true;
      item.material.side = THREE.DoubleSide; // an open surface is seen from inside too
    });
    const host = document.getElementById("stage");
    this.everywhere = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, part.assembled));
    this.stage = new Stage(host, this.plan, this.bodies, this.everywhere);
    this.marks = new THREE.Group();
    this.stage.world.add(this.marks);
    this.material = contactMaterials(MARK_COLOR, 0.85);
    for (const material of this.material) {
      Object.assign(material, { side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2 });
    }
    document.getElementById("bar").remove();
    const tool = (text, title, onclick) => element("button", { type: "button", textContent: text, title, onclick });
    document.getElementById("tools").append(
      tool("Fit", "Show everything", () => this.fit()),
      tool("Near", "Look at the parts of the chosen line", () => this.approach()),
      tool("All", "Choose no line: every part as it is", () => this.show(null)));
    this.lines = new Map();
    this.#side();
    this.stage.controls.addEventListener("change", () => this.#invalidate());
    new ResizeObserver(() => this.fit()).observe(host);
    const first = this.plan.findings.findIndex((finding) => finding.severity !== "note");
    this.show(first < 0 ? null : `finding ${first}`);
    this.fit();
  }

  #side() {
    const { plan } = this;
    const facts = plan.facts.flatMap(([label, value]) => [element("dt", { textContent: label }), element("dd", { textContent: value })]);
    const header = element("header", {}, element("h1", { textContent: plan.title }),
      element("span", { className: plan.ok ? "badge" : "badge partial", textContent: plan.verdict }), element("dl", {}, ...facts));
    const lists = element("div", { id: "lists" });
    for (const [severity, [color, title]] of Object.entries(SEVERITIES)) {
      const chosen = plan.findings.map((finding, k) => [finding, k]).filter(([finding]) => finding.severity === severity);
      this.#section(lists, title, chosen.map(([finding, k]) => ({
        key: `finding ${k}`, color, name: finding.message, tag: finding.kind, more: finding.wayOut, parts: finding.parts,
        marks: severity === "note" ? [] : this.#marksOf(finding.parts), wrong: severity === "error", wrap: true,
      })));
    }
    this.#section(lists, "Overlaps", plan.overlaps.map((pair, k) => ({
      key: `overlap ${k}`, color: MARK_COLOR, name: pair.parts.map((part) => plan.parts[part].name).join(" and "), tag: pair.guess,
      more: `${pair.depth === null ? "" : `${formatLength(pair.depth)} deep, `}${formatShare(pair.fraction)} of the smaller`,
      parts: pair.parts, marks: pair.mark ? [pair.mark] : [],
    })));
    this.#section(lists, "Tiny clearances", plan.clearances.map((pair, k) => ({
      key: `clearance ${k}`, color: ROLES.other.color, name: pair.parts.map((part) => plan.parts[part].name).join(" and "),
      tag: formatLength(pair.gap), more: "", parts: pair.parts, marks: [],
    })));
    this.#section(lists, "What planning does with each part", plan.treatments.map(({ part, planned, how }) => ({
      key: `part ${part}`, color: planned ? "#62a883" : MARK_COLOR, name: plan.parts[part].name, tag: planned ? "" : "no", more: how,
      parts: [part], marks: [], wrong: !planned, always: true,
    })));
    document.getElementById("side").replaceChildren(header, lists);
  }

  #marksOf(parts) {
    return this.plan.overlaps.filter((pair) => pair.mark && pair.parts.every((part) => parts.includes(part))).map((pair) => pair.mark);
  }

  #section(lists, title, lines) {
    if (!lines.length) return;
    const rows = lines.map((line) => {
      const swatch = element("span", { className: "swatch" });
      swatch.style.background = line.color;
      const name = line.wrap ? element("span", { className: "name", textContent: line.name }) : nameElement(line.name);
      if (line.wrap) Object.assign(name.style, { whiteSpace: "normal", overflowWrap: "anywhere" });
      const row = element("button", { type: "button", className: "row", title: line.name, onclick: () => this.show(line.key) },
        swatch, name, element("span", { className: "tag", textContent: line.tag }),
        element("span", { className: line.always || line.wrap ? "more" : "more when-current", textContent: line.more }));
      row.style.gridTemplateColumns = "12px minmax(0, 1fr) auto";
      row.lastChild.style.gridColumn = "2 / 4";
      this.lines.set(line.key, { ...line, row });
      return element("li", {}, row);
    });
    lists.append(element("h2", { textContent: `${title} · ${lines.length}` }), element("ol", {}, ...rows));
  }

  /** Show the parts of one line, or all as they are. */
  show(key) {
    const line = this.lines.get(key);
    this.shown = line ? key : null;
    for (const { row } of this.lines.values()) row.removeAttribute("aria-current");
    line?.row.setAttribute("aria-current", "step");
    this.bodies.items.forEach((item, part) => this.#paint(item, this.role(part)));
    for (const mesh of this.marks.children) mesh.geometry.dispose();
    this.marks.clear();
    this.highlighted = 0;
    for (const { at, count } of line?.marks ?? []) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(this.buffer, at, 3 * count), 3));
      addTwice(this.marks, geometry, this.material, () => {});
      this.highlighted += count / 3;
    }
    const caption = line?.name ?? this.plan.verdict;
    document.getElementById("caption").replaceChildren(
      element("b", { textContent: caption }), element("span", { textContent: line?.more ?? "Choose a line to see its parts" }));
    this.#invalidate();
  }

  /** "plain", "shown", "other", "wrong" or "faint". */
  role(part) {
    const line = this.lines.get(this.shown);
    if (!line || !line.parts.length) return "plain";
    const place = line.parts.indexOf(part);
    if (place < 0) return "faint";
    if (line.wrong && place === 0) return "wrong";
    return line.parts.length === 2 && place === 1 ? "other" : "shown";
  }

  #paint(item, role) {
    const { color } = ROLES[role];
    const opacity = this.lines.get(this.shown)?.marks.length && role !== "faint" ? 0.42 : ROLES[role].opacity;
    item.material.color.set(color);
    Object.assign(item.material, { opacity, transparent: opacity < 1, depthWrite: opacity === 1, needsUpdate: true });
    item.mesh.castShadow = item.mesh.receiveShadow = opacity === 1;
    item.edgeMaterial.opacity = role === "faint" ? 0.16 : 0.6;
  }

  fit() {
    this.stage.resize();
    this.stage.fit(this.everywhere, [], this.stage.firstDirection([], this.everywhere, 0.62));
    this.#invalidate();
  }

  /** Look at the chosen parts from where the camera is. */
  approach() {
    const parts = this.lines.get(this.shown)?.parts ?? [];
    if (!parts.length) return this.fit();
    const { stage } = this;
    const towards = stage.camera.position.clone().sub(stage.controls.target);
    stage.fit(parts.flatMap((part) => this.bodies.corners(part, this.plan.parts[part].assembled)), [], towards);
    this.#invalidate();
  }

  #invalidate() {
    this.pending ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.pending = undefined;
    const { stage } = this;
    stage.scene.updateMatrixWorld();
    stage.renderer.shadowMap.needsUpdate = true;
    stage.renderer.clear();
    stage.renderer.render(stage.scene, stage.camera);
    this.ready = true;
  }
}

function startDoctor() {
  const page = new Doctor();
  window.sashimono = {
    get ready() { return Boolean(page.ready); },
    get shown() { return page.shown; },
    get highlighted() { return page.highlighted; },
    names: page.plan.parts.map((part) => part.name),
    keys: [...page.lines.keys()],
    show(key) { page.show(key); page.draw(); },
    roleOf(name) { return page.role(page.plan.parts.findIndex((part) => part.name === name)); },
  };
}

startDoctor();
