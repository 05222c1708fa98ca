// Rigid motions. A pose is 12 numbers: the upper three rows of the 4x4 matrix. The same formulas as
// sashimono.geometry.se3, in double precision.

function compose(a, b) {
  const c = new Float64Array(12);
  for (let i = 0; i < 12; i += 4) {
    for (let j = 0; j < 4; j++) {
      c[i + j] = a[i] * b[j] + a[i + 1] * b[4 + j] + a[i + 2] * b[8 + j] + (j === 3 ? a[i + 3] : 0);
    }
  }
  return c;
}

function inverse(a) {
  const c = new Float64Array(12);
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) c[4 * i + j] = a[4 * j + i];
    c[4 * i + 3] = -(a[i] * a[3] + a[4 + i] * a[7] + a[8 + i] * a[11]);
  }
  return c;
}

function transformPoint(a, p) {
  return [0, 4, 8].map((i) => a[i] * p[0] + a[i + 1] * p[1] + a[i + 2] * p[2] + a[i + 3]);
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length3 = (a) => Math.hypot(a[0], a[1], a[2]);

/** Rotation vector of a pose, of length in [0, pi]. */
function rotationVector(a) {
  const skew = [a[9] - a[6], a[2] - a[8], a[4] - a[1]];
  const sine2 = length3(skew);
  const angle = Math.atan2(sine2, a[0] + a[5] + a[10] - 1);
  if (Math.PI - angle > 1e-5) return skew.map((s) => s * (angle < 1e-7 ? 0.5 : angle / sine2));
  // near pi the skew part vanishes: the axis comes from the symmetric part, its sign from the skew part
  const diagonal = [a[0], a[5], a[10]];
  const column = diagonal.indexOf(Math.max(...diagonal));
  const axis = [0, 1, 2].map((i) => 0.5 * (a[4 * i + column] + a[4 * column + i]) - (i === column ? Math.cos(angle) : 0));
  const sign = axis[0] * skew[0] + axis[1] * skew[1] + axis[2] * skew[2] < 0 ? -1 : 1;
  const size = length3(axis);
  return axis.map((x) => (sign * angle * x) / size);
}

/** Twist [v, w] whose exponential is the pose. */
function logPose(a) {
  const w = rotationVector(a);
  const angle = length3(w);
  const p = [a[3], a[7], a[11]];
  const half = 0.5 * angle;
  const k = angle < 1e-4 ? 1 / 12 : (1 - half / Math.tan(half)) / (angle * angle);
  const wp = cross(w, p);
  const wwp = cross(w, wp);
  return [p.map((x, i) => x - 0.5 * wp[i] + k * wwp[i]), w];
}

/** Pose reached by following the twist [v, w] for time u. */
function expTwist([v, w], u) {
  const angle = length3(w) * u;
  const small = angle < 1e-4;
  const s1 = small ? 1 - (angle * angle) / 6 : Math.sin(angle) / angle;
  const s2 = small ? 0.5 - (angle * angle) / 24 : (1 - Math.cos(angle)) / (angle * angle);
  const s3 = small ? 1 / 6 : (angle - Math.sin(angle)) / (angle * angle * angle);
  const [x, y, z] = w.map((c) => c * u);
  const vu = v.map((c) => c * u);
  const wv = cross([x, y, z], vu);
  const wwv = cross([x, y, z], wv);
  const n = x * x + y * y + z * z;
  const t = vu.map((c, i) => c + s2 * wv[i] + s3 * wwv[i]);
  return Float64Array.of(
    1 + s2 * (x * x - n), s2 * x * y - s1 * z, s2 * x * z + s1 * y, t[0],
    s2 * x * y + s1 * z, 1 + s2 * (y * y - n), s2 * y * z - s1 * x, t[1],
    s2 * x * z - s1 * y, s2 * y * z + s1 * x, 1 + s2 * (z * z - n), t[2],
  );
}

/** Pose at u in [0, 1] on the geodesic a exp(u log(a^-1 b)), a screw motion. */
function interpolatePose(a, b, u) {
  if (u <= 0) return Float64Array.from(a);
  if (u >= 1) return Float64Array.from(b);
  return compose(a, expTwist(logPose(compose(inverse(a), b)), u));
}
