// What lies under the mouse, as a person names it: a corner, an edge, a circle, a flat or a round face. Found on the
// drawn meshes, in the frame of the shape. Faces with common vertices are one smooth stretch of surface (the page's
// meshes are split along sharp edges), and lines lie on sharp edges only.

const STRAIGHT = Math.cos((30 * Math.PI) / 180);
const FLAT = Math.cos((1 * Math.PI) / 180);

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit3 = (a) => { const size = length3(a) || 1; return [a[0] / size, a[1] / size, a[2] / size]; };

/** Neighbours on the surface and along the sharp edges of one shape, made when it is first asked for. */
class ShapeGraph {
  constructor(surface, lines) {
    const { array } = surface.attributes.position;
    this.point = (i) => [array[3 * i], array[3 * i + 1], array[3 * i + 2]];
    const index = surface.index.array;
    this.triangle = (f) => [index[3 * f], index[3 * f + 1], index[3 * f + 2]];
    this.size = surface.boundingSphere.radius;
    this.facesOf = new Map();
    for (let f = 0; f < index.length / 3; f++) {
      const corners = this.triangle(f);
      corners.forEach((a, k) => this.#note(this.facesOf, this.#key(a, corners[(k + 1) % 3]), f));
    }
    this.#chains(lines.index.array);
  }

  #key(a, b) {
    return a < b ? a * 0x4000000 + b : b * 0x4000000 + a;
  }

  #note(map, key, value) {
    const known = map.get(key);
    if (known) known.push(value);
    else map.set(key, [value]);
  }

  /** Sharp edges joined at places: vertices that are split along an edge lie in one place. */
  #chains(index) {
    const places = new Map();
    this.places = [];
    const placeOf = (i) => {
      const p = this.point(i);
      const key = p.join(" ");
      if (!places.has(key)) {
        places.set(key, this.places.length);
        this.places.push(p);
      }
      return places.get(key);
    };
    const seen = new Set();
    this.edges = [];
    this.edgesAt = new Map();
    for (let e = 0; e < index.length; e += 2) {
      const [a, b] = [placeOf(index[e]), placeOf(index[e + 1])];
      if (a === b || seen.has(this.#key(a, b))) continue;
      seen.add(this.#key(a, b));
      this.#note(this.edgesAt, a, this.edges.length);
      this.#note(this.edgesAt, b, this.edges.length);
      this.edges.push([a, b]);
    }
  }

  /** The edge that goes on smoothly behind `place`, -1 where the line ends or turns. */
  #after(edge, place) {
    const others = this.edgesAt.get(place).filter((other) => other !== edge);
    if (others.length !== 1) return -1;
    const here = this.places[place];
    const far = (e) => this.places[this.edges[e][0] === place ? this.edges[e][1] : this.edges[e][0]];
    return dot3(unit3(minus(here, far(edge))), unit3(minus(far(others[0]), here))) > STRAIGHT ? others[0] : -1;
  }

  isCorner(place) {
    return this.edgesAt.get(place).some((edge) => this.#after(edge, place) < 0);
  }

  /** Places along the line that an edge is part of, and whether it comes back to where it began. */
  chain(edge) {
    const used = new Set([edge]);
    const walk = (from, place) => {
      const found = [];
      let [current, at] = [from, place];
      for (;;) {
        found.push(at);
        const next = this.#after(current, at);
        if (next < 0) return [found, false];
        if (used.has(next)) return [found, true];
        used.add(next);
        at = this.edges[next][0] === at ? this.edges[next][1] : this.edges[next][0];
        current = next;
      }
    };
    const [a, b] = this.edges[edge];
    const [ahead, closed] = walk(edge, b);
    const behind = closed ? [a] : walk(edge, a)[0];
    const places = [...behind.reverse(), ...ahead];
    if (closed && places[0] === places.at(-1)) places.pop();
    return { points: places.map((place) => this.places[place]), closed };
  }

  normal(f) {
    const [a, b, c] = this.triangle(f).map(this.point);
    return cross(minus(b, a), minus(c, a));
  }

  /** Faces that hang together with one, each passing the test. */
  region(face, passes) {
    const found = [face];
    const seen = new Set(found);
    for (let k = 0; k < found.length; k++) {
      const corners = this.triangle(found[k]);
      for (let i = 0; i < 3; i++) {
        for (const next of this.facesOf.get(this.#key(corners[i], corners[(i + 1) % 3]))) {
          if (seen.has(next)) continue;
          seen.add(next);
          if (passes(next)) found.push(next);
        }
      }
    }
    return found;
  }

  /** Edges that only one face of a region has. */
  border(faces) {
    const count = new Map();
    const ends = new Map();
    for (const f of faces) {
      const corners = this.triangle(f);
      corners.forEach((a, k) => {
        const key = this.#key(a, corners[(k + 1) % 3]);
        count.set(key, (count.get(key) ?? 0) + 1);
        ends.set(key, [a, corners[(k + 1) % 3]]);
      });
    }
    return [...ends].filter(([key]) => count.get(key) === 1).map(([, [a, b]]) => [this.point(a), this.point(b)]);
  }

  /** How much of the border of a region other faces of the same smooth surface have too. */
  smoothShare(faces) {
    const inside = new Set(faces);
    let [smooth, all] = [0, 0];
    for (const f of faces) {
      const corners = this.triangle(f);
      corners.forEach((a, k) => {
        const b = corners[(k + 1) % 3];
        const others = this.facesOf.get(this.#key(a, b)).filter((other) => other !== f);
        if (others.some((other) => inside.has(other))) return;
        const length = length3(minus(this.point(b), this.point(a)));
        all += length;
        if (others.length) smooth += length;
      });
    }
    return all > 0 ? smooth / all : 0;
  }
}

/** Centre, axis and radius of the circle through points in turn; null if they lie on none. */
function circleThrough(points, slack) {
  const n = points.length;
  if (n < 4) return null;
  const [a, b, c] = [points[0], points[Math.floor(n / 3)], points[Math.floor((2 * n) / 3)]];
  const [u, v] = [minus(b, a), minus(c, a)];
  const w = cross(u, v);
  const area = dot3(w, w);
  if (area <= 1e-12 * dot3(u, u) * dot3(v, v)) return null;
  // circumcentre: a + (|u|^2 v - |v|^2 u) x (u x v) / 2 |u x v|^2
  const to = cross(minus(v.map((x) => x * dot3(u, u)), u.map((x) => x * dot3(v, v))), w);
  const center = plus(a, to, 1 / (2 * area));
  const radius = length3(minus(a, center));
  const axis = unit3(w);
  const off = (p) => Math.max(Math.abs(length3(minus(p, center)) - radius), Math.abs(dot3(minus(p, center), axis)));
  return radius > 0 && points.every((p) => off(p) < slack + 0.01 * radius) ? { center, axis, radius } : null;
}

/** The corner, edge or circle within reach of a point, or the face that it is on; all in the frame of the shape. */
function featureAt(graph, face, point, reach) {
  const slack = 2e-4 * graph.size;
  let best = null;
  graph.edges.forEach((edge, k) => {
    const [a, b] = edge.map((place) => graph.places[place]);
    const along = minus(b, a);
    const u = Math.min(Math.max(dot3(minus(point, a), along) / dot3(along, along), 0), 1);
    const distance = length3(minus(point, plus(a, along, u)));
    if (distance < reach && (!best || distance < best.distance)) best = { k, distance };
  });
  if (best) {
    for (const place of graph.edges[best.k]) {
      const at = graph.places[place];
      if (length3(minus(point, at)) < 1.25 * reach && graph.isCorner(place)) return { kind: "corner", points: [at], segments: [], triangles: [] };
    }
    return edgeFeature(graph.chain(best.k), slack);
  }
  return face === null ? null : faceFeature(graph, face, slack) ?? { kind: "point", points: [point], segments: [], triangles: [] };
}

function edgeFeature({ points, closed }, slack) {
  const ring = closed ? [...points, points[0]] : points;
  const segments = ring.slice(1).map((p, k) => [ring[k], p]);
  const base = { points, segments, triangles: [], length: segments.reduce((sum, [a, b]) => sum + length3(minus(b, a)), 0) };
  const along = unit3(minus(points.at(-1), points[0]));
  const straight = !closed && points.every((p) => length3(cross(minus(p, points[0]), along)) < slack);
  if (straight) return { ...base, kind: "edge", line: along };
  const circle = circleThrough(points, slack);
  return circle ? { ...base, kind: "circle", ...circle } : { ...base, kind: "curve" };
}

function faceFeature(graph, face, slack) {
  const normal = unit3(graph.normal(face));
  const origin = graph.point(graph.triangle(face)[0]);
  const thin = (f) => length3(graph.normal(f)) < 1e-6 * graph.size * graph.size;
  const inPlane = (f) => (thin(f) || dot3(unit3(graph.normal(f)), normal) > FLAT)
    && graph.triangle(f).every((i) => Math.abs(dot3(minus(graph.point(i), origin), normal)) < slack);
  const flat = graph.region(face, inPlane);
  const round = roundFeature(graph, face, normal, slack);
  if (round && round.faces > flat.length) return round;
  // two facets that most of their border joins smoothly to others are a piece of a curved face
  if (flat.length <= 2 && graph.smoothShare(flat) > 0.5) return null;
  return withFaces(graph, flat, { kind: "plane", plane: normal });
}

function withFaces(graph, faces, feature) {
  const segments = graph.border(faces);
  const places = new Set(faces.flatMap((f) => graph.triangle(f)));
  return {
    ...feature, faces: faces.length, segments, points: [...places].map(graph.point),
    triangles: faces.map((f) => graph.triangle(f).map(graph.point)),
  };
}

/** The cylinder that a face is on: its neighbours turn about one axis, and all lie as far from it. */
function roundFeature(graph, face, normal, slack) {
  const near = graph.region(face, (f) => dot3(unit3(graph.normal(f)), normal) > 0.8);
  const turned = near.map((f) => cross(normal, unit3(graph.normal(f)))).filter((axis) => length3(axis) > 0.02);
  if (!turned.length) return null;
  const axis = unit3(turned.reduce((a, b) => (length3(b) > length3(a) ? b : a)));
  const faces = graph.region(face, (f) => Math.abs(dot3(unit3(graph.normal(f)), axis)) < 0.02);
  const points = [...new Set(faces.flatMap((f) => graph.triangle(f)))].map(graph.point);
  const low = Math.min(...points.map((p) => dot3(p, axis)));
  const ring = points.map((p) => plus(p, axis, low - dot3(p, axis)));
  // in turn about the axis, so that three of them lie well apart
  const middle = ring.reduce((sum, p) => plus(sum, p), [0, 0, 0]).map((x) => x / ring.length);
  const [e1, e2] = [normal, cross(axis, normal)];
  const turn = (p) => Math.atan2(dot3(minus(p, middle), e2), dot3(minus(p, middle), e1));
  const distinct = new Map(ring.map((p) => [turn(p).toFixed(3), p]));
  const circle = circleThrough([...distinct].sort((a, b) => a[0] - b[0]).map(([, p]) => p), slack);
  if (!circle) return null;
  const high = Math.max(...points.map((p) => dot3(p, axis)));
  const center = plus(circle.center, axis, (high - low) / 2);
  const outside = dot3(minus(graph.point(graph.triangle(face)[0]), circle.center), normal) > 0;
  return withFaces(graph, faces, { kind: outside ? "cylinder" : "hole", axis, center, radius: circle.radius, height: high - low });
}
