// Why a part cannot leave: one explanation and one of its directions at a time.

const ROLES = {
  part: { color: "#e88a2e", opacity: 1 },
  blocker: { color: "#6f94bd", opacity: 0.34 },
  other: { color: "#98a2b3", opacity: 0.1 },
  absent: { color: "#98a2b3", opacity: 0 },
};
const FACE_COLORS = { blocker: "#d6303c", part: "#f5c400" };
const ARROW_COLOR = "#d6303c";
const OTHER_ARROW_COLOR = "#5c6b7c";

class Explainer {
  constructor() {
    this.plan = readPlan();
    this.buffer = readBytes();
    this.bodies = new Bodies(this.plan, null, this.buffer);
    this.bodies.items.forEach((item, k) => {
      item.node.matrix.copy(matrixOf(compose(this.plan.parts[k].assembled, item.shapePose)));
      item.node.matrixWorldNeedsUpdate = true;
    });
    const host = document.getElementById("stage");
    const everywhere = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, part.assembled));
    this.everywhere = everywhere;
    this.stage = new Stage(host, this.plan, this.bodies, everywhere);
    this.marks = new THREE.Group();
    this.stage.world.add(this.marks);
    this.labels = element("div");
    host.append(this.labels);
    this.materials = {
      part: contactMaterials(FACE_COLORS.part, 0.92), blocker: contactMaterials(FACE_COLORS.blocker, 0.3),
      patch: contactMaterials(FACE_COLORS.blocker, 0.9),
      arrow: contactMaterials(ARROW_COLOR, 1), otherArrow: contactMaterials(OTHER_ARROW_COLOR, 0.75),
    };
    ["part", "blocker", "patch"].forEach((kind, k) => {
      for (const material of this.materials[kind]) {
        Object.assign(material, { side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: -1 - k, polygonOffsetUnits: -1 - k });
      }
    });
    document.getElementById("bar").remove();
    document.getElementById("tools").append(
      element("button", { type: "button", textContent: "Fit", title: "Show everything", onclick: () => this.fit() }));
    this.#side();
    this.stage.controls.addEventListener("change", () => this.#invalidate());
    new ResizeObserver(() => this.fit()).observe(host);
    this.shown = [0, 0];
    this.show(0, 0);
    this.fit();
  }

  #side() {
    const { plan } = this;
    const stuck = plan.explanations.filter((entry) => entry.answer !== "FREE").length;
    const badge = stuck ? `${stuck} ${stuck === 1 ? "part" : "parts"} cannot leave` : "Nothing is stuck";
    const legend = [[ROLES.part.color, "the part"], [FACE_COLORS.part, "its faces that would meet it"],
      [ROLES.blocker.color, "in its way"], [FACE_COLORS.blocker, "where they would meet"]];
    const header = element("header", {}, element("h1", { textContent: plan.title }),
      element("span", { className: stuck ? "badge partial" : "badge", textContent: badge }),
      element("dl", {}, ...legend.flatMap(([color, text]) => [element("dt", {}, this.#swatch(color)), element("dd", { textContent: text })])));
    const lists = element("div", { id: "lists" });
    this.rows = plan.explanations.map((entry, k) => this.#section(entry, k, lists));
    document.getElementById("side").replaceChildren(header, lists);
  }

  #swatch(color) {
    const swatch = element("span", { className: "swatch" });
    Object.assign(swatch.style, { background: color, display: "inline-block", width: "12px", height: "12px", borderRadius: "3px" });
    return swatch;
  }

  #section(entry, k, lists) {
    const nameOf = (part) => this.plan.parts[part].name;
    lists.append(element("h2", { textContent: nameOf(entry.part) }), element("p", { className: "note", textContent: entry.verdict }));
    const rows = entry.directions.map((direction, d) => {
      const names = direction.blockers.map((blocker) => nameOf(blocker.part)).join(", ");
      const words = direction.blockers.map((b) => `${nameOf(b.part)} after ${b.travel === null ? "?" : formatLength(b.travel)}`).join("; ");
      return element("button", { type: "button", className: "row", title: `${direction.name}: ${names}`, onclick: () => this.show(k, d) },
        element("span", { className: "number", textContent: direction.travel === null ? "?" : String(d + 1) }), this.#swatch(ARROW_COLOR),
        nameElement(`${direction.name}: ${names}`),
        element("span", { className: "tag", textContent: direction.travel === null ? "" : formatLength(direction.travel) }),
        element("span", { className: "more when-current", textContent: words }));
    });
    lists.append(element("ol", {}, ...rows.map((row) => element("li", {}, row))));
    const sets = entry.removeFirst.slice(0, 4).map((set) => set.map(nameOf).join(" and ")).join("; or ");
    if (sets) lists.append(element("p", { className: "note", textContent: `Remove first: ${sets}.` }));
    if (entry.change) lists.append(element("p", { className: "note", textContent: `Change: ${entry.change}.` }));
    return rows;
  }

  /** Show one direction of one explanation. */
  show(k, d) {
    const entry = this.plan.explanations[k];
    this.shown = [k, d];
    this.rows.flat().forEach((row) => row.removeAttribute("aria-current"));
    this.rows[k]?.[d]?.setAttribute("aria-current", "step");
    const direction = entry?.directions[d];
    this.bodies.items.forEach((item, part) => this.#paint(item, this.role(part)));
    for (const mesh of this.marks.children) mesh.geometry.dispose();
    this.marks.clear();
    this.labels.replaceChildren();
    this.highlighted = 0;
    const caption = direction ? `Along ${direction.name}` : entry?.verdict ?? "Every part can leave";
    const facts = direction ? `${this.plan.parts[entry.part].name} gets ${direction.travel === null ? "an unknown way" : formatLength(direction.travel)}` : "";
    document.getElementById("caption").replaceChildren(element("b", { textContent: caption }), element("span", { textContent: facts }));
    direction?.blockers.forEach((blocker) => {
      for (const [kind, triangles] of Object.entries(blocker.marks)) this.#mark(triangles, this.materials[kind], kind);
    });
    this.tips = entry ? entry.directions.map((other, i) => this.#arrow(other, i === d)) : [];
    this.#invalidate();
  }

  /** "part", "blocker", "other" or, if it is taken as removed, "absent". */
  role(part) {
    const entry = this.plan.explanations[this.shown[0]];
    if (!entry || part === entry.part) return "part";
    if (entry.directions[this.shown[1]]?.blockers.some((blocker) => blocker.part === part)) return "blocker";
    return entry.fixed.includes(part) ? "other" : "absent";
  }

  #paint(item, role) {
    const { color, opacity } = ROLES[role];
    item.node.visible = opacity > 0;
    item.material.color.set(color);
    Object.assign(item.material, { opacity, transparent: opacity < 1, depthWrite: opacity === 1, needsUpdate: true });
    item.mesh.castShadow = item.mesh.receiveShadow = opacity === 1;
    item.edgeMaterial.opacity = role === "other" ? 0.16 : 0.6;
  }

  #mark({ at, count }, materials, kind) {
    if (!count) return;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(this.buffer, at, 3 * count), 3));
    addTwice(this.marks, geometry, materials, () => {});
    if (kind !== "patch") this.highlighted += count / 3;
  }

  /** An arrow as long as the free travel, within bounds that keep it in view; returns where its label goes. */
  #arrow(direction, current) {
    const size = this.stage.size;
    const length = Math.min(Math.max(direction.travel ?? 0, 0.07 * size), 0.4 * size);
    const thick = (current ? 0.006 : 0.0035) * size;
    const along = new THREE.Vector3(...direction.vector);
    const turn = new THREE.Quaternion().setFromUnitVectors(Y_AXIS, along);
    const put = (distance) => (mesh) => {
      mesh.quaternion.copy(turn);
      mesh.position.set(...direction.start).addScaledVector(along, distance);
    };
    const materials = current ? this.materials.arrow : this.materials.otherArrow;
    const head = Math.min(5 * thick, 0.5 * length);
    addTwice(this.marks, new THREE.CylinderGeometry(thick, thick, length - head, 20), materials, put((length - head) / 2));
    addTwice(this.marks, new THREE.ConeGeometry(2.4 * thick, head, 24), materials, put(length - head / 2));
    addTwice(this.marks, new THREE.CylinderGeometry(4 * thick, 4 * thick, 0.5 * thick, 28), materials, put(length));
    const tip = new THREE.Vector3(...direction.start).addScaledVector(along, length + 3 * thick);
    const travel = direction.travel === null ? "" : ` ${formatLength(direction.travel)}`;
    const label = element("div", { textContent: `${direction.name}${travel}` });
    Object.assign(label.style, {
      position: "absolute", padding: "1px 6px", borderRadius: "6px", background: "var(--glass)", pointerEvents: "none",
      transform: "translate(-50%, -50%)", fontWeight: current ? "650" : "400", color: current ? "var(--warn)" : "var(--soft)",
    });
    this.labels.append(label);
    return { tip, label };
  }

  fit() {
    this.stage.resize();
    this.stage.fit(this.everywhere, [], this.stage.firstDirection([], this.everywhere, 0.62));
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
    const { clientWidth: width, clientHeight: height } = stage.host;
    for (const { tip, label } of this.tips) {
      const at = stage.toScene(tip.toArray()).project(stage.camera);
      label.style.left = `${((at.x + 1) / 2) * width}px`;
      label.style.top = `${((1 - at.y) / 2) * height}px`;
    }
    this.ready = true;
  }
}

function startExplainer() {
  const page = new Explainer();
  window.sashimono = {
    get ready() { return Boolean(page.ready); },
    get shown() { return page.shown; },
    get highlighted() { return page.highlighted; },
    names: page.plan.parts.map((part) => part.name),
    show(k, d) { page.show(k, d); page.draw(); },
    roleOf(name) { return page.role(page.plan.parts.findIndex((part) => part.name === name)); },
  };
}

startExplainer();
