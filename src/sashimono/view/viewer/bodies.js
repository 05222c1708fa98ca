// The parts as they are drawn.

const EDGE_COLOR = "#18222d";
const GHOST_OPACITY = 0.45;
const XRAY_OPACITY = 0.25;
/** How far the pulls of the exploded view follow one another: 0 for all at once. */
const STAGGER = 2;

function matrixOf(pose) {
  const [a, b, c, x, d, e, f, y, g, h, i, z] = pose;
  return new THREE.Matrix4().set(a, b, c, x, d, e, f, y, g, h, i, z, 0, 0, 0, 1);
}

class Bodies {
  constructor(plan, timeline, buffer) {
    this.plan = plan;
    this.timeline = timeline;
    this.group = new THREE.Group();
    const shapes = plan.shapes.map((shape) => unpackShape(shape, buffer));
    this.items = plan.parts.map((part, index) => this.#makeItem(part, index, shapes[part.shape]));
  }

  #makeItem(part, index, { surface, lines }) {
    const material = new THREE.MeshStandardMaterial({
      color: part.color, roughness: 0.55, metalness: 0.08, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    });
    const edgeMaterial = new THREE.LineBasicMaterial({ color: EDGE_COLOR, transparent: true, opacity: 0.55 });
    const mesh = new THREE.Mesh(surface, material);
    const edges = new THREE.LineSegments(lines, edgeMaterial);
    mesh.userData.part = index;
    const node = new THREE.Group();
    node.add(mesh, edges);
    node.matrixAutoUpdate = false;
    this.group.add(node);
    return { node, mesh, edges, material, edgeMaterial, shapePose: part.shapePose };
  }

  /** How much of a pull is done: the last step's comes first; a part takes part in it once it is placed. */
  #share(turn, t, amount) {
    const last = Math.max(this.plan.steps.length - 1, 1);
    const begun = amount * (1 + STAGGER) - (STAGGER * (last - turn)) / last;
    return Math.min(Math.max(begun, 0), 1) * this.timeline.progress(turn, t);
  }

  /** Displacement of a part in the exploded view, `amount` in [0, 1]; without its own pull, where it sits then. */
  explosion(index, t, amount, withOwn = true) {
    const { explode, assembled } = this.plan.parts[index];
    const sum = [0, 0, 0];
    let latest = -1;
    for (const { turn, by } of withOwn ? explode : explode.slice(0, -1)) {
      const share = this.#share(turn, t, amount);
      // pulls inside a subassembly, which are those of earlier steps than its own, turn with it
      const way = turn < latest ? this.#turned(this.timeline.pose(index, t), assembled, by) : by;
      for (let i = 0; i < 3; i++) sum[i] += way[i] * share;
      latest = Math.max(latest, turn);
    }
    return sum;
  }

  /** A direction that goes with a part from its assembled pose to another one. */
  #turned(pose, assembled, vector) {
    const displacement = compose(pose, inverse(assembled));
    return [0, 4, 8].map((i) => displacement[i] * vector[0] + displacement[i + 1] * vector[1] + displacement[i + 2] * vector[2]);
  }

  /** Lines along which parts are drawn out, from where each sits to where it is drawn: pairs of points [m]. */
  trails(t, amount, isShown) {
    return this.plan.parts.flatMap((part, index) => {
      if (!part.explode.length || !isShown(index)) return [];
      const { min, max } = this.items[index].mesh.geometry.boundingBox;
      const middle = [(min.x + max.x) / 2, (min.y + max.y) / 2, (min.z + max.z) / 2];
      const at = transformPoint(compose(this.timeline.pose(index, t), this.items[index].shapePose), middle);
      const ends = [false, true].map((withOwn) => this.explosion(index, t, amount, withOwn).map((x, i) => x + at[i]));
      return ends[0].some((x, i) => x !== ends[1][i]) ? ends : [];
    });
  }

  /** Edges of a part's box along the axes of the world as it is assembled [m]. */
  extents(index) {
    const item = this.items[index];
    const { array } = item.mesh.geometry.attributes.position;
    const pose = compose(this.plan.parts[index].assembled, item.shapePose);
    const box = new THREE.Box3();
    for (let i = 0; i < array.length; i += 3) box.expandByPoint(new THREE.Vector3(...transformPoint(pose, [array[i], array[i + 1], array[i + 2]])));
    return box.getSize(new THREE.Vector3()).toArray();
  }

  /** The pose in which a part is drawn: its planned one, displaced in the exploded view. */
  drawnPose(index, t, amount) {
    const pose = Float64Array.from(this.timeline.pose(index, t));
    const offset = this.explosion(index, t, amount);
    for (let i = 0; i < 3; i++) pose[4 * i + 3] += offset[i];
    return pose;
  }

  /** Draw all at time t; `hiding` parts are made transparent, and those that `isShown` denies are left out. */
  update(t, { explode, xray, cadColors }, hiding = [], isShown = () => true) {
    this.items.forEach((item, index) => {
      const part = this.plan.parts[index];
      const state = this.timeline.state(index, t);
      item.node.visible = isShown(index);
      item.node.matrix.copy(matrixOf(compose(this.drawnPose(index, t, explode), item.shapePose)));
      item.node.matrixWorldNeedsUpdate = true;
      const opacity = state === "unsolved" ? GHOST_OPACITY : state === "placed" && (xray || hiding.includes(index)) ? XRAY_OPACITY : 1;
      const { material } = item;
      if (material.transparent !== opacity < 1) {
        material.transparent = opacity < 1;
        material.depthWrite = opacity === 1;
        material.needsUpdate = true;
      }
      material.opacity = opacity;
      material.color.set(cadColors && part.cadColor && state !== "unsolved" ? part.cadColor : part.color);
      item.mesh.castShadow = opacity === 1;
      item.mesh.receiveShadow = opacity === 1;
      item.edgeMaterial.color.set(state === "unsolved" ? part.color : EDGE_COLOR);
      item.edgeMaterial.opacity = state === "unsolved" ? 0.9 : opacity === 1 ? 0.55 : 0.4;
    });
  }

  /** Corners of the boxes of all parts that move in step k, when the step's own part is at a pose. */
  cornersOfStep(k, pose) {
    return this.plan.steps[k].moving.flatMap((part) => this.corners(part, this.timeline.carried(k, part, pose)));
  }

  /** Corners of the part's box at a pose, in plan coordinates [m]. */
  corners(index, pose) {
    const item = this.items[index];
    const { min, max } = item.mesh.geometry.boundingBox;
    const placed = compose(pose, item.shapePose);
    const points = [];
    for (const x of [min.x, max.x]) {
      for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) points.push(transformPoint(placed, [x, y, z]));
    }
    return points;
  }
}
