// The player: time, what is shown, keyboard and mouse; and the hook `window.sashimono` for tests and pictures.

class Player {
  constructor() {
    this.plan = readPlan();
    this.timeline = new Timeline(this.plan);
    this.bodies = new Bodies(this.plan, this.timeline, readBytes());
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.hovered = -1;
    this.view = { explode: 0, contacts: true, table: true, xray: false, cadColors: false };
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
    this.stage.controls.addEventListener("change", () => this.#invalidate(false));
    this.#listen(host);
    this.stage.resize();
    this.fit();
  }

  #trayPoints() {
    const places = (k, step) => (step.poses.length > 1 || step.depth > 0 ? [step.poses[0], this.timeline.restingPose(k)] : []);
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
      if (!this.stage.userMoved) this.fit();
      this.#invalidate(false);
    }).observe(host);
    window.addEventListener("keydown", (event) => this.#key(event));
    const canvas = this.stage.renderer.domElement;
    canvas.addEventListener("pointermove", (event) => {
      this.pointer = event.buttons ? null : event;
      this.#invalidate(false);
    });
    canvas.addEventListener("pointerleave", () => {
      this.pointer = null;
      this.panel.showTip("", 0, 0);
      this.hover(-1);
    });
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    const actions = {
      " ": () => this.toggle(), ArrowLeft: () => this.skip(-1), ArrowRight: () => this.skip(1),
      Home: () => this.setTime(0), End: () => this.setTime(this.plan.duration), f: () => this.fit(),
    };
    const action = actions[event.key];
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

  /** Go to the start of a step. */
  showStep(k) {
    if (k < this.plan.steps.length) this.setTime(this.plan.steps[Math.max(k, 0)].start);
    else this.setTime(this.plan.duration);
  }

  /** To the next step, or to the start of this one and then the one before. */
  skip(direction) {
    const k = this.timeline.stepAt(this.time);
    if (k < 0) return;
    if (direction > 0) this.showStep(k + 1);
    else this.showStep(this.time > this.plan.steps[k].start + 0.4 ? k : k - 1);
  }

  setView(changes) {
    Object.assign(this.view, changes);
    this.panel.showView(this.view);
    if ("explode" in changes && !this.stage.userMoved) this.#frame();
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
    this.#frame();
    this.#invalidate(false);
  }

  #frame() {
    const assembled = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, part.assembled));
    const { explode } = this.view;
    const exploded = this.plan.parts.flatMap((part, k) => this.bodies.corners(k, this.bodies.drawnPose(k, this.time, explode)));
    const direction = this.stage.firstDirection(this.#trayPoints(), assembled, explode > 0 ? 0.4 : 0.62);
    if (explode > 0) this.stage.fit(exploded, [], direction);
    else this.stage.fit(this.everywhere, this.#insertionPoints(), direction);
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
    this.draw();
    if (this.playing) this.#invalidate(true);
  }

  draw() {
    const { stage, view, time } = this;
    const k = this.timeline.stepAt(time);
    if (this.moved || !this.ready) {
      this.bodies.update(time, view);
      this.contacts.update(time, k, view.contacts, view.explode);
      this.panel.update(time, k, k < 0 ? "hold" : this.timeline.phase(k, time), this.playing);
      stage.table.visible = view.table;
      stage.renderer.shadowMap.needsUpdate = true;
      this.moved = false;
    }
    stage.scene.updateMatrixWorld();
    this.#pick();
    stage.renderer.clear();
    stage.renderer.render(stage.scene, stage.camera);
    const meshesOf = (parts) => parts.map((part) => this.bodies.items[part].mesh);
    const current = this.plan.steps[k];
    const moving = current && this.timeline.state(current.part, time) === "moving" ? current.moving : [];
    this.outline.render(stage.camera, meshesOf(moving), meshesOf(this.hovered >= 0 ? [this.hovered] : []));
    this.ready = true;
  }

  /** The part under the mouse. */
  #pick() {
    const event = this.pointer;
    if (!event) return;
    this.pointer = null;
    const box = this.stage.renderer.domElement.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    this.raycaster ??= new THREE.Raycaster();
    this.raycaster.setFromCamera(new THREE.Vector2((2 * x) / box.width - 1, 1 - (2 * y) / box.height), this.stage.camera);
    const hit = this.raycaster.intersectObjects(this.bodies.items.map((item) => item.mesh), false)[0];
    this.hovered = hit ? hit.object.userData.part : -1;
    this.panel.showTip(hit ? this.plan.parts[this.hovered].name : "", x, y);
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
    /** Set any of explode, contacts, table, xray, cadColors; drawn at once. */
    setView(changes) { player.setView(changes); player.draw(); },
    play() { if (!player.playing) player.toggle(); },
    pause() { player.pause(); },
    hover(name) { player.hover(name === null ? -1 : indexOf.get(name)); player.draw(); },
    /** T_world_part of the part at the time shown, 4x4; the exploded view does not count. */
    poseOf(name) { return rows(player.timeline.pose(indexOf.get(name), player.time)); },
    /** The pose in which it is drawn. */
    drawnPoseOf(name) { return rows(player.bodies.drawnPose(indexOf.get(name), player.time, player.view.explode)); },
    interpolate(a, b, u) { return rows(interpolatePose(a.flat().slice(0, 12), b.flat().slice(0, 12), u)); },
  };
}

start();
