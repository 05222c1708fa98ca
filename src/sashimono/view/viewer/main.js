// The player: time, what is shown, keyboard and mouse; and the hook `window.sashimono` for tests and pictures.

const FLIGHT_MS = 700;
/** Of the parts that were found by name, so many are marked in the picture. */
const MOST_MARKED = 40;

class Player {
  constructor() {
    this.plan = readPlan();
    this.timeline = new Timeline(this.plan);
    this.bodies = new Bodies(this.plan, this.timeline, readBytes());
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.hovered = -1;
    this.view = { explode: 0, contacts: true, table: true, xray: false, cadColors: false, follow: false, section: false, measure: false };
    this.cut = { axis: 0, share: 0.5, keepUpper: true };
    this.matches = [];
    this.aim = null;
    this.chosen = -1;
    this.flight = null;
    this.hidden = new Set();
    this.alone = false;
    this.ready = false;
    this.panel = new Panel(this.plan, this);
    const host = document.getElementById("stage");
    const everywhere = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, part.assembled))
      .concat(this.#trayPoints());
    this.stage = new Stage(host, this.plan, this.bodies, everywhere);
    this.everywhere = everywhere;
    this.contacts = new Contacts(this.plan, this.bodies, this.stage.size);
    this.stage.world.add(this.contacts.group);
    this.outline = new Outline(this.stage.renderer);
    this.section = new Section(this.bodies, this.stage);
    this.measure = new Measure(this.bodies, this.stage);
    this.trails = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: "#4b6a8f" }));
    this.trails.frustumCulled = false;
    this.stage.world.add(this.trails);
    this.stage.controls.addEventListener("change", () => this.#invalidate(false));
    this.#listen(host);
    this.stage.resize();
    this.fit();
    this.#readLink();
  }

  #trayPoints() {
    const places = (k, step) => (step.turns ? [] : step.poses.length > 1 || step.depth > 0 ? [step.poses[0], this.timeline.restingPose(k)] : []);
    return this.plan.steps.flatMap((step, k) => places(k, step).flatMap((pose) => this.bodies.cornersOfStep(k, pose)));
  }

  #insertionPoints() {
    const seen = { insertion: (step, segment) => [step.poses[segment.start]], carry: (step, segment) => step.poses.slice(0, segment.stop) };
    return this.plan.steps.flatMap((step, k) => step.segments.flatMap((segment) => seen[segment.kind]?.(step, segment) ?? [])
      .flatMap((pose) => this.bodies.cornersOfStep(k, pose)));
  }

  #listen(host) {
    new ResizeObserver(() => {
      this.stage.resize();
      if (!this.stage.userMoved) this.#frame();
      this.#invalidate(false);
    }).observe(host);
    window.addEventListener("keydown", (event) => this.#key(event));
    const canvas = this.stage.renderer.domElement;
    canvas.addEventListener("pointermove", (event) => {
      this.pointer = event.buttons ? null : event;
      this.#invalidate(false);
    });
    canvas.addEventListener("pointerdown", (event) => (this.pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => {
      const [x, y] = this.pressed ?? [event.clientX, event.clientY];
      if (event.button === 0 && Math.hypot(event.clientX - x, event.clientY - y) < 5) this.#click(event);
    });
    window.addEventListener("hashchange", () => this.#readLink());
    window.addEventListener("beforeprint", () => this.#print(host));
    canvas.addEventListener("pointerleave", () => {
      this.pointer = null;
      this.panel.showTip("", 0, 0);
      this.hover(-1);
    });
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    // a control keeps the keys that are its own
    const control = event.target.closest?.("button, summary, select, input");
    const own = control?.matches("input[type=search]") || (control?.matches("select, input") ? event.key.length > 1 || event.key === " " : event.key === " " || event.key === "Enter");
    if (control && own && event.key !== "Escape") return;
    const turn = 0.15;
    const inPicture = this.view.measure && event.target === this.stage.renderer.domElement;
    const aims = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const actions = event.shiftKey && event.key in aims ? {
      ArrowLeft: () => this.stage.turn(turn, 0), ArrowRight: () => this.stage.turn(-turn, 0),
      ArrowUp: () => this.stage.turn(0, turn), ArrowDown: () => this.stage.turn(0, -turn),
    } : inPicture && event.key in aims ? {
      [event.key]: () => this.#moveAim(...aims[event.key]),
    } : {
      " ": () => this.toggle(), ArrowLeft: () => this.skip(-1), ArrowRight: () => this.skip(1),
      Home: () => this.setTime(0), End: () => this.setTime(this.plan.duration), f: () => this.fit(),
      c: () => this.setView({ follow: !this.view.follow }), Escape: () => this.#leave(),
      "/": () => this.panel.search.focus(), e: () => this.setView({ explode: this.view.explode > 0 ? 0 : 1 }),
      "+": () => this.stage.zoom(0.85), "=": () => this.stage.zoom(0.85), "-": () => this.stage.zoom(1 / 0.85),
      s: () => this.setView({ section: !this.view.section }), m: () => this.setView({ measure: !this.view.measure }),
      ...(inPicture && { Enter: () => this.#pickAtAim() }),
      ...(this.view.section && {
        x: () => this.setSection({ axis: 0 }), y: () => this.setSection({ axis: 1 }), z: () => this.setSection({ axis: 2 }),
        v: () => this.setSection({ flip: true }), ",": () => this.setSection({ share: this.cut.share - 0.02 }),
        ".": () => this.setSection({ share: this.cut.share + 0.02 }),
      }),
      ...(this.chosen >= 0 && { h: () => this.hide(this.chosen), i: () => this.isolate(this.chosen) }),
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  toggle() {
    if (this.playing) return this.pause();
    if (this.time >= this.plan.duration) this.time = 0;
    this.playing = true;
    this.before = performance.now();
    this.#invalidate(true);
  }

  pause() {
    this.playing = false;
    this.#invalidate(true);
  }

  setTime(t) {
    this.time = Math.min(Math.max(t, 0), this.plan.duration);
    this.#invalidate(true);
  }

  /** Go to the start of a step; the page's address names it from then on. */
  showStep(k) {
    const step = this.plan.steps[Math.max(k, 0)];
    this.setTime(step ? step.start : this.plan.duration);
    if (step) this.#writeLink(step.label);
  }

  #writeLink(label) {
    try {
      history.replaceState(null, "", `#step=${label}`);
    } catch {
      // a page inside another one may have no address of its own
    }
  }

  /** Go to the step that the page's address names: #step=12, or #step=3.1 inside a subassembly. */
  #readLink() {
    const label = new URLSearchParams(location.hash.slice(1)).get("step");
    const k = this.plan.steps.findIndex((step) => step.label === label);
    if (k < 0) return;
    this.pause();
    this.showStep(k);
  }

  /** Leave what was begun last: measuring, the search, the choice of a part. */
  #leave() {
    if (this.view.measure) {
      if (this.measure.picks.length) this.clearPicks();
      else this.setView({ measure: false });
    } else if (this.panel.search.value) this.find("");
    else this.choose(-1);
  }

  /** Show the rows of the parts whose names hold a text, and mark these parts; an empty text finds nothing. */
  find(text) {
    const wanted = text.trim().toLowerCase();
    this.matches = wanted ? this.plan.parts.flatMap((part, k) => (part.name.toLowerCase().includes(wanted) ? [k] : [])) : [];
    this.panel.showFound(wanted ? this.matches : null, text);
    this.#invalidate(false);
  }

  /** Choose the first part that was found, or the one after the chosen one, and go to its step. */
  chooseFound() {
    if (!this.matches.length) return;
    const part = this.matches[(this.matches.indexOf(this.chosen) + 1) % this.matches.length];
    this.#chooseAt(part);
  }

  /** Cut across axis `axis`, at `share` of the way through what is drawn, or with `flip` show the other side. */
  setSection({ axis = this.cut.axis, share = this.cut.share, flip = false }) {
    const turned = axis !== this.cut.axis;
    this.cut = { axis, share: Math.min(Math.max(share, 0), 1), keepUpper: this.cut.keepUpper !== flip };
    if (turned) this.#keepFarSide();
    this.#cutAgain();
  }

  /** What lies towards the camera is left out. */
  #keepFarSide() {
    const along = [0, 1, 2].map((k) => Number(k === this.cut.axis));
    const { camera, controls } = this.stage;
    this.cut.keepUpper = camera.position.clone().sub(controls.target).dot(this.stage.directionOf(along)) < 0;
  }

  #cutAgain() {
    const { axis, share, keepUpper } = this.cut;
    const drawn = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, this.bodies.drawnPose(k, this.plan.duration, this.view.explode)));
    const along = drawn.map((p) => p[axis]);
    const [low, high] = [Math.min(...along), Math.max(...along)];
    const at = low + share * (high - low);
    this.section.set(this.view.section, axis, at, keepUpper);
    this.outline.clip(this.view.section ? [this.section.plane] : null);
    this.panel.showSection(this.cut, at);
    this.#invalidate(true);
  }

  #moveAim(x, y) {
    const canvas = this.stage.renderer.domElement;
    const { clientWidth: width, clientHeight: height } = canvas;
    this.aim ??= [width / 2, height / 2];
    this.aim = [Math.min(Math.max(this.aim[0] + 6 * x, 0), width), Math.min(Math.max(this.aim[1] + 6 * y, 0), height)];
    this.panel.showAim(this.aim);
    const box = canvas.getBoundingClientRect();
    this.pointer = { clientX: box.left + this.aim[0], clientY: box.top + this.aim[1] };
    this.#invalidate(false);
  }

  #pickAtAim() {
    if (!this.aim) return this.#moveAim(0, 0);
    const box = this.stage.renderer.domElement.getBoundingClientRect();
    this.pickAt({ clientX: box.left + this.aim[0], clientY: box.top + this.aim[1] });
  }

  /** Take what is under a place of the window as the next pick of the measurement. */
  pickAt(event) {
    const hit = this.#hitAt(event);
    if (hit) this.measure.pick(hit, this.bodies.drawnPose(hit.part, this.time, this.view.explode));
    this.#tellMeasure();
  }

  nameAt(event) {
    const hit = this.#hitAt(event);
    return hit ? this.plan.parts[hit.part].name : null;
  }

  clearPicks() {
    this.measure.picks = [];
    this.#tellMeasure();
  }

  #tellMeasure() {
    this.panel.showMeasure(this.measure.tell(), this.measure.picks.length);
    this.#invalidate(false);
  }

  /** Paper gets the picture as it is drawn now. */
  #print(host) {
    const { domElement: picture } = this.stage.renderer;
    this.printed ??= host.appendChild(Object.assign(document.createElement("canvas"), { id: "printed" }));
    this.printed.setAttribute("role", "img");
    this.printed.setAttribute("aria-label", "The product at the chosen step");
    Object.assign(this.printed, { width: picture.width, height: picture.height });
    this.draw();
    this.printed.getContext("2d").drawImage(picture, 0, 0);
  }

  /** Choose the part that was clicked, and go to its step; a click beside all parts chooses none. */
  #click(event) {
    if (this.view.measure) return this.pickAt(event);
    this.#chooseAt(this.#hitAt(event)?.part ?? -1);
  }

  #chooseAt(part) {
    if (part < 0 && this.chosen < 0) return;
    this.chosen = part;
    if (part < 0) this.alone = false;
    const k = part < 0 ? -1 : this.timeline.lastStepOf(part);
    if (k >= 0) {
      this.pause();
      this.showStep(k);
    }
    this.#showChoice();
  }

  /** Choose a part, or none with -1: then all parts are shown again. */
  choose(part) {
    this.chosen = part;
    if (part < 0) {
      this.hidden.clear();
      this.alone = false;
    }
    this.#showChoice();
  }

  hide(part) {
    this.hidden.add(part);
    this.chosen = -1;
    this.alone = false;
    this.#showChoice();
  }

  /** Show one part alone, or together with the others again. */
  isolate(part) {
    this.alone = this.chosen !== part || !this.alone;
    this.chosen = part;
    this.hidden.delete(part);
    this.#showChoice();
  }

  isShown(part) {
    return this.alone ? part === this.chosen : !this.hidden.has(part);
  }

  #showChoice() {
    this.panel.showChoice(this.chosen, this.hidden.size > 0 || this.alone, this.alone);
    this.#invalidate(true);
  }

  /** To the next step, or to the start of this one and then the one before. */
  skip(direction) {
    const k = this.timeline.stepAt(this.time);
    if (k < 0) return;
    if (direction > 0) this.showStep(k + 1);
    else this.showStep(this.time > this.plan.steps[k].start + 0.4 ? k : k - 1);
  }

  setView(changes) {
    const began = changes.section && !this.view.section;
    Object.assign(this.view, changes);
    this.panel.showView(this.view);
    if (began) this.#keepFarSide();
    if ("section" in changes || ("explode" in changes && this.view.section)) this.#cutAgain();
    if ("measure" in changes) {
      this.clearPicks();
      this.aim = null;
      this.panel.showAim(null);
    }
    if (changes.follow) this.stage.userMoved = false;
    if (("explode" in changes || "follow" in changes) && !this.stage.userMoved) this.#frame();
    this.#invalidate(true);
  }

  hover(part) {
    if (this.hovered === part) return;
    this.hovered = part;
    this.#invalidate(false);
  }

  /** Show everything from the first viewpoint. */
  fit() {
    this.stage.userMoved = false;
    this.flight = null;
    this.#frame();
    this.#invalidate(false);
  }

  #frame() {
    const step = this.view.follow && this.plan.steps[this.timeline.stepAt(this.time)];
    this.framed = this.#scene();
    if (step && step.look) {
      this.#frameStep(step);
      return;
    }
    const assembled = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, part.assembled));
    const { explode } = this.view;
    const exploded = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, this.bodies.drawnPose(k, this.time, explode)));
    const direction = this.stage.firstDirection(this.#trayPoints(), assembled, explode > 0 ? 0.4 : 0.62);
    if (explode > 0) this.stage.fit(exploded, [], direction);
    else this.stage.fit(this.everywhere, this.#insertionPoints(), direction);
  }

  /** Look at what comes and where it goes in; on its way there, at all of its way too. */
  #frameStep(step) {
    const k = this.plan.steps.indexOf(step);
    const insertion = step.segments.find((segment) => segment.kind === "insertion");
    const near = this.timeline.phase(k, this.time) === "insertion" || this.time >= step.times.at(-1);
    const poses = [step.poses.at(-1), ...(insertion ? [step.poses[insertion.start]] : []), ...(near ? [] : step.poses)];
    const points = poses.flatMap((pose) => this.bodies.cornersOfStep(k, pose));
    // some of what is around it, so that a small part is not alone
    const product = this.plan.parts.flatMap((part, i) => (this.timeline.state(i, this.time) === "placed" ? this.bodies.corners(i, this.bodies.drawnPose(i, this.time, 0)) : []));
    this.stage.fit(this.stage.widened(points, product, near ? 0.35 : 1), [], this.stage.directionOf(step.look));
  }

  /** Go to where this step is seen from; on the way there while it plays, at once otherwise. */
  #fly() {
    this.flight = null;
    const { camera, controls } = this.stage;
    const from = [camera.position.clone(), controls.target.clone()];
    this.#frame();
    if (!this.playing || matchMedia("(prefers-reduced-motion: reduce)").matches) return;
    this.flight = { from, to: [camera.position.clone(), controls.target.clone()], began: performance.now() };
    this.#alongFlight(this.flight.began);
  }

  #alongFlight(now) {
    const { from, to, began } = this.flight;
    const u = Math.min(Math.max(now - began, 0) / FLIGHT_MS, 1);
    const share = u * u * (3 - 2 * u);
    this.stage.camera.position.lerpVectors(from[0], to[0], share);
    this.stage.controls.target.lerpVectors(from[1], to[1], share);
    this.stage.controls.update();
    if (u >= 1) this.flight = null;
  }

  /** What a view is framed for: while it stays the same, the camera need not move. */
  #scene() {
    if (!this.view.follow) return "all";
    const k = this.timeline.stepAt(this.time);
    return k < 0 ? "all" : `${k} ${this.timeline.phase(k, this.time) === "insertion" || this.time >= this.plan.steps[k].times.at(-1)}`;
  }

  #invalidate(moved) {
    this.moved = this.moved || moved;
    if (!this.pending) this.pending = requestAnimationFrame((now) => this.#frameNow(now));
  }

  #frameNow(now) {
    this.pending = 0;
    if (this.playing) {
      this.time = Math.min(this.time + (Math.max(now - this.before, 0) / 1000) * this.speed, this.plan.duration);
      this.before = now;
      if (this.time >= this.plan.duration) this.playing = false;
      this.moved = true;
    }
    if (this.flight && this.stage.userMoved) this.flight = null;
    if (this.flight) this.#alongFlight(now);
    this.draw();
    if (this.playing || this.flight) this.#invalidate(this.playing);
  }

  draw() {
    const { stage, view, time } = this;
    const k = this.timeline.stepAt(time);
    if (this.moved || !this.ready) {
      const step = this.plan.steps[k];
      if (view.follow && !stage.userMoved && this.framed !== this.#scene()) this.#fly();
      this.bodies.update(time, view, view.follow && step ? step.hiding : [], (part) => this.isShown(part));
      this.contacts.update(time, k, view.contacts, view.explode);
      const trails = view.explode > 0 ? this.bodies.trails(time, view.explode, (part) => this.isShown(part)) : [];
      this.trails.geometry.setAttribute("position", new THREE.Float32BufferAttribute(trails.flat(), 3));
      this.trails.visible = trails.length > 0;
      if (this.measure.keep((part) => this.bodies.drawnPose(part, time, view.explode))) this.panel.showMeasure(this.measure.tell(), 0);
      this.panel.update(time, k, k < 0 ? "hold" : this.timeline.phase(k, time), this.playing);
      stage.table.visible = view.table;
      stage.renderer.shadowMap.needsUpdate = true;
      this.moved = false;
    }
    stage.scene.updateMatrixWorld();
    this.section.update();
    this.#pick();
    stage.renderer.clear();
    stage.renderer.render(stage.scene, stage.camera);
    const meshesOf = (parts) => parts.map((part) => this.bodies.items[part].mesh);
    const current = this.plan.steps[k];
    const moving = current && this.timeline.state(current.part, time) === "moving" ? current.moving : [];
    const marked = [...new Set([this.hovered, this.chosen, ...this.matches.slice(0, MOST_MARKED)])].filter((part) => part >= 0 && this.isShown(part));
    this.outline.render(stage.camera, meshesOf(moving.filter((part) => this.isShown(part))), meshesOf(marked));
    this.ready = true;
  }

  /** The part under the mouse. */
  #pick() {
    const event = this.pointer;
    if (!event) return;
    this.pointer = null;
    const box = this.stage.renderer.domElement.getBoundingClientRect();
    const hit = this.#hitAt(event);
    this.hovered = hit?.part ?? -1;
    const feature = this.view.measure && this.measure.featureOf(hit);
    const what = feature ? `${featureWords(feature)} · ` : "";
    this.panel.showTip(hit ? what + this.plan.parts[hit.part].name : "", event.clientX - box.left, event.clientY - box.top);
  }

  #hitAt(event) {
    const box = this.stage.renderer.domElement.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    this.raycaster ??= new THREE.Raycaster();
    this.raycaster.setFromCamera(new THREE.Vector2((2 * x) / box.width - 1, 1 - (2 * y) / box.height), this.stage.camera);
    return firstHit(this.raycaster, this.bodies.items.filter((item, part) => this.isShown(part)), this.section);
  }
}

function rows(pose) {
  return [0, 4, 8].map((i) => Array.from(pose).slice(i, i + 4)).concat([[0, 0, 0, 1]]);
}

function start() {
  let player;
  try {
    player = new Player();
  } catch (error) {
    document.getElementById("caption").textContent = `The 3D view could not start: ${error.message}`;
    throw error;
  }
  const indexOf = new Map(player.plan.parts.map((part, k) => [part.name, k]));
  window.sashimono = {
    get ready() { return player.ready; },
    get time() { return player.time; },
    get playing() { return player.playing; },
    duration: player.plan.duration,
    names: player.plan.parts.map((part) => part.name),
    steps: player.plan.steps.map((step) => ({ label: step.label, part: player.plan.parts[step.part].name, start: step.start, stop: step.stop })),
    /** Show time t, drawn at once. */
    setTime(t) { player.pause(); player.setTime(t); player.draw(); },
    /** Set any of explode, contacts, table, xray, cadColors, follow, section, measure; drawn at once. */
    setView(changes) { player.setView(changes); player.draw(); },
    /** Set any of the section's axis, share and flip; drawn at once. */
    setSection(changes) { player.setSection(changes); player.draw(); },
    /** Where the section is, and how many parts it cuts. */
    get section() { player.draw(); return { ...player.cut, on: player.view.section, parts: player.section.cut }; },
    find(text) { player.find(text); player.draw(); },
    get found() { return player.matches.map((part) => player.plan.parts[part].name); },
    /** Pick what is under a place of the window, and say what was measured. */
    pick(x, y) { player.pickAt({ clientX: x, clientY: y }); player.draw(); return player.measure.tell(); },
    /** Name of the part under a place of the window; null if none. */
    partAt(x, y) { return player.nameAt({ clientX: x, clientY: y }); },
    play() { if (!player.playing) player.toggle(); },
    pause() { player.pause(); },
    get chosen() { return player.chosen < 0 ? null : player.plan.parts[player.chosen].name; },
    choose(name) { player.choose(name === null ? -1 : indexOf.get(name)); player.draw(); },
    isShown(name) { return player.isShown(indexOf.get(name)); },
    /** Where a point of the world is in the picture [pixels]. */
    pixelOf(point) {
      player.stage.scene.updateMatrixWorld();
      const p = player.stage.toScene(point).project(player.stage.camera);
      const box = player.stage.renderer.domElement.getBoundingClientRect();
      return [box.left + (0.5 + 0.5 * p.x) * box.width, box.top + (0.5 - 0.5 * p.y) * box.height];
    },
    hover(name) { player.hover(name === null ? -1 : indexOf.get(name)); player.draw(); },
    /** T_world_part of the part at the time shown, 4x4; the exploded view does not count. */
    poseOf(name) { return rows(player.timeline.pose(indexOf.get(name), player.time)); },
    /** The pose in which it is drawn. */
    drawnPoseOf(name) { return rows(player.bodies.drawnPose(indexOf.get(name), player.time, player.view.explode)); },
    interpolate(a, b, u) { return rows(interpolatePose(a.flat().slice(0, 12), b.flat().slice(0, 12), u)); },
  };
}

start();
