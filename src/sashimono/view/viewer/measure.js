// Distances and angles between what was picked, and the line that shows them.

const MEASURE_COLOR = "#c2255c";
const MOST_PAIRS = 3e6;
/** Below this, two directions are parallel [rad]. */
const PARALLEL = 0.003;

function nearestOnTriangle(p, [a, b, c]) {
  // Ericson, Real-Time Collision Detection, 5.1.5
  const [ab, ac, ap] = [minus(b, a), minus(c, a), minus(p, a)];
  const [d1, d2] = [dot3(ab, ap), dot3(ac, ap)];
  if (d1 <= 0 && d2 <= 0) return a;
  const bp = minus(p, b);
  const [d3, d4] = [dot3(ab, bp), dot3(ac, bp)];
  if (d3 >= 0 && d4 <= d3) return b;
  const vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return plus(a, ab, d1 / (d1 - d3 || 1));
  const cp = minus(p, c);
  const [d5, d6] = [dot3(ab, cp), dot3(ac, cp)];
  if (d6 >= 0 && d5 <= d6) return c;
  const vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return plus(a, ac, d2 / (d2 - d6 || 1));
  const va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return plus(b, minus(c, b), (d4 - d3) / (d4 - d3 + (d5 - d6) || 1));
  const share = 1 / (va + vb + vc);
  return plus(plus(a, ab, vb * share), ac, vc * share);
}

/** The nearest points of two segments. */
function nearestOfSegments([p, q], [r, s]) {
  const [d, e, w] = [minus(q, p), minus(s, r), minus(p, r)];
  const [a, b, c] = [dot3(d, d), dot3(d, e), dot3(e, e)];
  const clamp = (x) => Math.min(Math.max(x, 0), 1);
  const det = a * c - b * b;
  let u = det > 1e-18 * a * c ? clamp((b * dot3(e, w) - c * dot3(d, w)) / det) : 0;
  const v = c > 0 ? clamp((b * u + dot3(e, w)) / c) : 0;
  if (a > 0) u = clamp((b * v - dot3(d, w)) / a);
  return [plus(p, d, u), plus(r, e, v)];
}

/** The nearest points of two features, and whether some were left out because there are too many. */
function nearestPoints(a, b) {
  let best = null;
  const offer = (p, q) => {
    const distance = length3(minus(q, p));
    if (!best || distance < best.distance) best = { distance, from: p, to: q };
  };
  const work = (x, y) => x.points.length * y.triangles.length + x.segments.length * y.triangles.length;
  const pairs = work(a, b) + work(b, a) + a.segments.length * b.segments.length;
  const stride = Math.max(1, Math.ceil(Math.sqrt(pairs / MOST_PAIRS)));
  const some = (list) => (stride === 1 ? list : list.filter((_, k) => k % stride === 0));
  const against = (x, y, tell) => {
    for (const triangle of some(y.triangles)) {
      for (const p of some(x.points)) tell(p, nearestOnTriangle(p, triangle));
      const n = cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0]));
      for (const [p, q] of some(x.segments)) {
        const [h, k] = [dot3(minus(p, triangle[0]), n), dot3(minus(q, triangle[0]), n)];
        if (h * k >= 0) continue;
        const through = plus(p, minus(q, p), h / (h - k));
        tell(through, nearestOnTriangle(through, triangle));
      }
    }
  };
  against(a, b, offer);
  against(b, a, (p, q) => offer(q, p));
  const asSegments = (x) => (x.segments.length ? x.segments : x.points.map((p) => [p, p]));
  for (const s of some(asSegments(a))) for (const t of some(asSegments(b))) offer(...nearestOfSegments(s, t));
  return { ...best, about: stride > 1 };
}

/** Angle of two lines, of two planes, or of a line and a plane, in [0, pi/2]; null if either has no direction. */
function angleBetween(a, b) {
  const line = (x) => x.line ?? x.axis ?? null;
  const [u, v] = [line(a) ?? a.plane, line(b) ?? b.plane];
  if (!u || !v) return null;
  const acute = Math.atan2(length3(cross(u, v)), Math.abs(dot3(u, v)));
  return Boolean(line(a)) === Boolean(line(b)) ? acute : Math.PI / 2 - acute;
}

/** What two features measure: lines of words, and the two points between which a line is drawn. */
function measureBetween(a, b) {
  const near = nearestPoints(a, b);
  const angle = angleBetween(a, b);
  const parallel = angle !== null && angle < PARALLEL;
  const about = near.about ? "about " : "";
  const rows = [];
  let [from, to] = [near.from, near.to];
  if (a.plane && b.plane && parallel) {
    const gap = dot3(minus(b.points[0], a.points[0]), a.plane);
    rows.push(["Distance of the planes", formatLength(Math.abs(gap))]);
    [from, to] = [near.from, plus(near.from, a.plane, gap)];
  }
  if (a.center && b.center) {
    const apart = minus(b.center, a.center);
    if (parallel) {
      const aside = plus(apart, a.axis, -dot3(apart, a.axis));
      rows.push(["Distance of the axes", formatLength(length3(aside))]);
      [from, to] = [a.center, plus(a.center, aside)];
    }
    if (a.kind === "circle" && b.kind === "circle") {
      rows.push(["Distance of the centres", formatLength(length3(apart))]);
      [from, to] = [a.center, b.center];
    }
  }
  rows.push(["Shortest distance", about + formatLength(near.distance)]);
  if (a.points.length === 1 && b.points.length === 1) {
    rows.push(["Along x, y, z", minus(near.to, near.from).map(formatLength).join(", ")]);
  }
  if (angle !== null) rows.push(["Angle", `${+((angle * 180) / Math.PI).toFixed(2)}°`]);
  return { rows, from, to };
}

function featureWords(feature) {
  const across = () => `Ø ${formatLength(2 * feature.radius)}`;
  return {
    corner: () => "corner", point: () => "point", plane: () => "flat face", edge: () => `edge, ${formatLength(feature.length)}`,
    curve: () => `curved edge, ${formatLength(feature.length)}`, circle: () => `circle, ${across()}`,
    cylinder: () => `cylinder, ${across()}, ${formatLength(feature.height)} long`,
    hole: () => `hole, ${across()}, ${formatLength(feature.height)} long`,
  }[feature.kind]();
}

class Measure {
  constructor(bodies, stage) {
    this.bodies = bodies;
    this.stage = stage;
    this.graphs = new Map();
    this.picks = [];
    this.group = new THREE.Group();
    stage.world.add(this.group);
    this.material = new THREE.LineBasicMaterial({ color: MEASURE_COLOR, depthTest: false, transparent: true });
    this.faint = new THREE.LineBasicMaterial({ color: MEASURE_COLOR, depthTest: false, transparent: true, opacity: 0.55 });
    this.dot = new THREE.MeshBasicMaterial({ color: MEASURE_COLOR, depthTest: false, transparent: true });
  }

  #graph(mesh) {
    const { geometry } = mesh;
    if (!this.graphs.has(geometry)) {
      const item = this.bodies.items[mesh.userData.part];
      this.graphs.set(geometry, new ShapeGraph(geometry, item.edges.geometry));
    }
    return this.graphs.get(geometry);
  }

  /** The feature of a hit, in the frame of the part's shape; `pixels` is how near an edge must be. Null if none. */
  featureOf(hit, pixels = 9) {
    if (!hit) return null;
    const { camera, renderer, size } = this.stage;
    const height = renderer.domElement.clientHeight;
    const pixel = (2 * Math.tan((camera.fov * Math.PI) / 360) * camera.position.distanceTo(hit.point) * size) / height;
    const local = hit.mesh.worldToLocal(hit.point.clone()).toArray();
    if (hit.cut) return { kind: "point", points: [local], segments: [], triangles: [] };
    return featureAt(this.#graph(hit.mesh), hit.face, local, pixels * pixel);
  }

  /** Take a hit as the next pick; the third one begins anew. */
  pick(hit, pose) {
    const feature = this.featureOf(hit);
    if (!feature) return;
    if (this.picks.length === 2) this.picks = [];
    this.picks.push({ part: hit.part, feature, pose: compose(pose, this.bodies.items[hit.part].shapePose) });
  }

  /** Forget what was picked if a part has moved since. */
  keep(poseOf) {
    const moved = this.picks.some(({ part, pose }) => {
      const now = compose(poseOf(part), this.bodies.items[part].shapePose);
      return now.some((x, i) => Math.abs(x - pose[i]) > 1e-9);
    });
    if (moved) this.picks = [];
    return moved;
  }

  /** A picked feature where its part is drawn. */
  #placed({ feature, pose }) {
    const turn = (v) => v && minus(transformPoint(pose, v), transformPoint(pose, [0, 0, 0]));
    const put = (p) => transformPoint(pose, p);
    return {
      ...feature, points: feature.points.map(put), segments: feature.segments.map((s) => s.map(put)),
      triangles: feature.triangles.map((t) => t.map(put)), center: feature.center && put(feature.center),
      axis: turn(feature.axis), line: turn(feature.line), plane: turn(feature.plane),
    };
  }

  /** What there is to say, as pairs of words; draws it too. */
  tell() {
    for (const node of this.group.children) node.geometry.dispose();
    this.group.clear();
    const placed = this.picks.map((pick) => this.#placed(pick));
    for (const feature of placed) {
      if (feature.segments.length) this.#lines(feature.segments.flat(), this.faint);
      else this.#point(feature.points[0]);
    }
    const rows = this.picks.map(({ part, feature }, k) => [`${k + 1}. ${featureWords(feature)}`, this.bodies.plan.parts[part].name]);
    if (placed.length < 2) return rows;
    const { rows: found, from, to } = measureBetween(...placed);
    this.#lines([from, to], this.material);
    this.#point(from);
    this.#point(to);
    return [...rows, ...found];
  }

  #lines(points, material) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
    const lines = new THREE.LineSegments(geometry, material);
    lines.renderOrder = 5000;
    this.group.add(lines);
  }

  #point(at) {
    const mesh = new THREE.Mesh(ball(0.005 * this.stage.size, 16, 10), this.dot);
    mesh.position.set(...at);
    mesh.renderOrder = 5001;
    this.group.add(mesh);
  }
}
