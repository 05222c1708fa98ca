// Camera, light, table and tray. Everything of the plan hangs below `world`, which centres it, turns up to +Y
// and scales it to unit size, so that light, shadow and camera need no other numbers.

const FIELD_OF_VIEW = 30;

class Stage {
  constructor(host, plan, bodies, framed) {
    this.host = host;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, stencil: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.renderer.autoClear = false;
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", "Picture of the product. Drag to turn it; with the keyboard, Shift and an arrow key turn it, plus and minus come nearer and go away.");
    host.prepend(canvas);

    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 50);
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.userMoved = false;
    this.controls.addEventListener("start", () => (this.userMoved = true));

    this.world = new THREE.Group();
    this.world.matrixAutoUpdate = false;
    const box = new THREE.Box3();
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(...plan.up).normalize(), Y_AXIS);
    for (const p of framed) box.expandByPoint(new THREE.Vector3(...p).applyQuaternion(turn));
    this.size = Math.max(box.min.distanceTo(box.max), 1e-9);
    const centre = box.getCenter(new THREE.Vector3());
    const scale = 1 / this.size;
    this.world.matrix.compose(centre.clone().multiplyScalar(-scale), turn, new THREE.Vector3(scale, scale, scale));
    this.world.matrixWorldNeedsUpdate = true;
    this.world.add(bodies.group);
    this.scene.add(this.world);
    this.#light();
    this.#table(plan, bodies, box.max.y - box.min.y);
  }

  /** A point of the plan in the coordinates of the scene. */
  toScene(point) {
    return new THREE.Vector3(...point).applyMatrix4(this.world.matrix);
  }

  /** A direction of the plan in the coordinates of the scene. */
  directionOf(vector) {
    return this.toScene(vector).sub(this.toScene([0, 0, 0])).normalize();
  }

  /** Points, and the corners of their box grown until it is `share` of the box of others, where that is larger. */
  widened(points, others, share) {
    const boxOf = (corners) => new THREE.Box3().setFromPoints(corners.map((p) => new THREE.Vector3(...p)));
    const [box, around] = [boxOf(points), boxOf(others.length ? others : points)];
    const short = share * around.getSize(new THREE.Vector3()).length() - box.getSize(new THREE.Vector3()).length();
    const grown = box.clone().expandByScalar(Math.max(0, 0.25 * short)).intersect(box.clone().union(around));
    const [a, b] = [grown.min, grown.max];
    return [...points, ...[a.x, b.x].flatMap((x) => [a.y, b.y].flatMap((y) => [a.z, b.z].map((z) => [x, y, z])))];
  }

  #light() {
    // no environment map: making one takes seconds where there is no graphics hardware
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#7f8b9a", 1.8));
    const fill = new THREE.DirectionalLight("#e8f0ff", 0.45);
    fill.position.set(0.3, 0.2, 1);
    this.camera.add(fill, fill.target);
    this.scene.add(this.camera);
    const sun = new THREE.DirectionalLight("#fffaf2", 1.9);
    sun.position.set(0.9, 2.2, 0.8);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    Object.assign(sun.shadow.camera, { left: -0.8, right: 0.8, top: 0.8, bottom: -0.8, near: 0.5, far: 5 });
    sun.shadow.bias = -0.0004;
    sun.shadow.normalBias = 0.002;
    sun.shadow.radius = 5;
    this.scene.add(sun);
    this.sun = sun;
  }

  #table(plan, bodies, height) {
    this.table = new THREE.Group();
    this.scene.add(this.table);
    if (plan.table === null) return;
    const n = new THREE.Vector3(...plan.up);
    const level = this.toScene(n.clone().multiplyScalar(plan.table / n.lengthSq()).toArray()).y;
    const flat = (mesh, lift) => {
      mesh.rotation.x = -Math.PI / 2;
      mesh.position.y = level + lift;
      this.table.add(mesh);
      return mesh;
    };
    this.grid = flat(new THREE.Mesh(new THREE.PlaneGeometry(4, 4), gridMaterial()), -0.002);
    const shade = flat(new THREE.Mesh(new THREE.PlaneGeometry(4, 4), new THREE.ShadowMaterial({ opacity: 0.17 })), -0.001);
    shade.receiveShadow = true;
    shade.material.depthWrite = false;
    this.grid.renderOrder = -3;
    shade.renderOrder = -1;
    this.#tray(plan, bodies, level);
  }

  /** A pocket on the table under each part that starts there. */
  #tray(plan, bodies, level) {
    const fill = new THREE.MeshBasicMaterial({ color: "#7d90a5", transparent: true, opacity: 0.13, depthWrite: false });
    const rim = new THREE.LineBasicMaterial({ color: "#7d90a5", transparent: true, opacity: 0.55 });
    for (const [k, step] of plan.steps.entries()) {
      if (step.poses.length < 2) continue;
      const box = new THREE.Box3().setFromPoints(bodies.cornersOfStep(k, bodies.timeline.restingPose(k)).map((p) => this.toScene(p)));
      if (box.min.y > level + 0.05) continue;
      const [x0, x1, z0, z1] = [box.min.x - 0.008, box.max.x + 0.008, box.min.z - 0.008, box.max.z + 0.008];
      const pocket = new THREE.Mesh(new THREE.PlaneGeometry(x1 - x0, z1 - z0), fill);
      pocket.rotation.x = -Math.PI / 2;
      pocket.position.set((x0 + x1) / 2, level - 0.0015, (z0 + z1) / 2);
      pocket.renderOrder = -2;
      const corners = [x0, z0, x1, z0, x1, z0, x1, z1, x1, z1, x0, z1, x0, z1, x0, z0];
      const line = new THREE.BufferGeometry();
      const points = [];
      for (let i = 0; i < corners.length; i += 2) points.push(corners[i], level - 0.0012, corners[i + 1]);
      line.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
      this.table.add(pocket, new THREE.LineSegments(line, rim));
    }
  }

  /** Turn the view about what it looks at, by angles to the side and upwards [rad]. */
  turn(aside, upwards) {
    const { camera, controls } = this;
    const arm = new THREE.Spherical().setFromVector3(camera.position.clone().sub(controls.target));
    arm.theta += aside;
    arm.phi -= upwards;
    arm.makeSafe();
    camera.position.setFromSpherical(arm).add(controls.target);
    this.userMoved = true;
    controls.update();
  }

  /** Come nearer (below 1) or go away. */
  zoom(factor) {
    const { camera, controls } = this;
    camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
    this.userMoved = true;
    controls.update();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /**
   * Look from `direction` (scene coordinates, towards the camera) so that all points are well in view, the
   * `loose` ones at least inside. Room stays above and below, where the buttons and the caption are.
   */
  fit(points, loose, direction) {
    const toCamera = direction.clone().normalize();
    const right = new THREE.Vector3().crossVectors(Y_AXIS, toCamera).normalize();
    const up = new THREE.Vector3().crossVectors(toCamera, right);
    const tanY = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    const tanX = tanY * this.camera.aspect;
    const locate = (weight) => (point) => {
      const p = this.toScene(point);
      return [p.dot(right), p.dot(up), p.dot(toCamera), weight];
    };
    const located = points.map(locate(1)).concat(loose.map(locate(0.86)));
    const target = [0, 1, 2].map((i) => {
      const values = located.map((p) => p[i]);
      return (Math.min(...values) + Math.max(...values)) / 2;
    });
    let distance = 2;
    for (let round = 0; round < 24; round++) {
      const range = [[Infinity, -Infinity], [Infinity, -Infinity]];
      for (const p of located) {
        const depth = Math.max(distance + target[2] - p[2], 0.05);
        [(p[0] - target[0]) / (depth * tanX), (1.05 * (p[1] - target[1])) / (depth * tanY)].forEach((x, i) => {
          range[i] = [Math.min(range[i][0], x * p[3]), Math.max(range[i][1], x * p[3])];
        });
      }
      const spread = Math.max(range[0][1] - range[0][0], range[1][1] - range[1][0]) / 2;
      target[0] += ((range[0][0] + range[0][1]) / 2) * distance * tanX * 0.8;
      target[1] += ((range[1][0] + range[1][1]) / 2) * distance * tanY * 0.8;
      distance = Math.max(distance * (1 + 0.8 * (spread / 0.86 - 1)), 0.08);
    }
    this.controls.target.set(0, 0, 0)
      .addScaledVector(right, target[0]).addScaledVector(up, target[1]).addScaledVector(toCamera, target[2]);
    this.camera.position.copy(this.controls.target).addScaledVector(toCamera, distance);
    this.controls.update();
  }

  /** Where a viewer stands at first: the tray to the left and in front, the product behind it. */
  firstDirection(trayPoints, productPoints, height) {
    const mean = (points) => points.reduce((sum, p) => sum.add(this.toScene(p)), new THREE.Vector3())
      .divideScalar(Math.max(points.length, 1));
    const side = trayPoints.length ? mean(trayPoints).sub(mean(productPoints)).setY(0) : new THREE.Vector3();
    if (side.length() < 0.08) return new THREE.Vector3(0.53, height, 0.85);
    side.normalize();
    return new THREE.Vector3().crossVectors(Y_AXIS, side).multiplyScalar(0.85).addScaledVector(side, 0.53).setY(height);
  }
}

function gridMaterial() {
  return new THREE.ShaderMaterial({
    transparent: true, depthWrite: false, side: THREE.DoubleSide,
    uniforms: { ink: { value: new THREE.Color("#7d90a5").convertLinearToSRGB() } },
    vertexShader: "varying vec2 at; void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: `
      uniform vec3 ink; varying vec2 at;
      float lines(vec2 p) { vec2 d = abs(fract(p - 0.5) - 0.5) / fwidth(p); return 1.0 - min(min(d.x, d.y), 1.0); }
      void main() {
        float fade = 1.0 - smoothstep(0.45, 1.15, length(at));
        gl_FragColor = vec4(ink, fade * (0.07 + 0.16 * lines(at * 10.0)));
      }`,
  });
}
