// A plane that cuts what is drawn: what lies before it is left out, and cut faces are closed where a part is cut.
// How often a ray to the camera leaves and enters a part behind the plane is counted in the stencil buffer; where
// the count is not zero, the plane is inside the part, and a hatched face is drawn there.

const AXES = ["X", "Y", "Z"];

function hatchMaterial(color) {
  return new THREE.ShaderMaterial({
    side: THREE.DoubleSide,
    uniforms: { color: { value: new THREE.Color(color) }, period: { value: 9 } },
    vertexShader: "void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: `
      uniform vec3 color; uniform float period;
      void main() {
        float across = fract((gl_FragCoord.x + gl_FragCoord.y) / period);
        gl_FragColor = vec4(color * mix(0.95, 0.62, smoothstep(0.68, 0.78, across) - smoothstep(0.92, 1.0, across)), 1.0);
        #include <colorspace_fragment>
      }`,
    stencilWrite: true, stencilRef: 0, stencilFunc: THREE.NotEqualStencilFunc,
    stencilFail: THREE.ZeroStencilOp, stencilZFail: THREE.ZeroStencilOp, stencilZPass: THREE.ZeroStencilOp,
  });
}

function countMaterial(side, operation, plane) {
  return new THREE.MeshBasicMaterial({
    side, clippingPlanes: [plane], depthWrite: false, depthTest: false, colorWrite: false, stencilWrite: true,
    stencilFunc: THREE.AlwaysStencilFunc, stencilFail: operation, stencilZFail: operation, stencilZPass: operation,
  });
}

class Section {
  constructor(bodies, stage) {
    this.bodies = bodies;
    this.stage = stage;
    this.plane = new THREE.Plane();
    this.counts = [countMaterial(THREE.BackSide, THREE.IncrementWrapStencilOp, this.plane), countMaterial(THREE.FrontSide, THREE.DecrementWrapStencilOp, this.plane)];
    this.group = new THREE.Group();
    this.group.visible = false;
    stage.scene.add(this.group);
    this.caps = null;
    this.on = false;
    stage.renderer.localClippingEnabled = true;
  }

  /** Cut along axis 0, 1 or 2 of the world at a place [m]; `keepUpper` keeps what lies beyond it. */
  set(on, axis, at, keepUpper) {
    this.on = on;
    this.group.visible = on;
    if (on) {
      const point = [0, 0, 0];
      const normal = [0, 0, 0];
      point[axis] = at;
      normal[axis] = keepUpper ? 1 : -1;
      this.plane.setFromNormalAndCoplanarPoint(this.stage.directionOf(normal), this.stage.toScene(point));
      this.caps ??= this.bodies.items.map((item, index) => this.#cap(item, index));
    }
    const planes = on ? [this.plane] : null;
    for (const { material, edgeMaterial } of this.bodies.items) {
      material.clippingPlanes = edgeMaterial.clippingPlanes = planes;
      material.clipShadows = true;
    }
  }

  #cap(item, index) {
    const order = 1 + 2 * index;
    const counters = this.counts.map((material) => {
      const mesh = new THREE.Mesh(item.mesh.geometry, material);
      mesh.renderOrder = order;
      item.node.add(mesh);
      return mesh;
    });
    const face = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), hatchMaterial(item.material.color));
    face.renderOrder = order + 1;
    // the whole of the stencil, not only what this face covers
    face.onAfterRender = (renderer) => renderer.clearStencil();
    this.group.add(face);
    return { counters, face };
  }

  /** Lay a face over each part that the plane cuts. Call it when parts or the plane have moved. */
  update() {
    this.cut = 0;
    this.caps?.forEach(({ counters, face }, index) => {
      const item = this.bodies.items[index];
      const shown = this.on && item.node.visible;
      let cuts = false;
      if (shown) {
        item.node.updateWorldMatrix(true, false);
        const { min, max } = item.mesh.geometry.boundingBox;
        const box = [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new THREE.Vector3(x, y, z).applyMatrix4(item.node.matrixWorld))));
        const heights = box.map((corner) => this.plane.distanceToPoint(corner));
        cuts = Math.min(...heights) < 0 && Math.max(...heights) > 0;
        const center = box[0].clone().add(box[7]).multiplyScalar(0.5);
        this.plane.projectPoint(center, face.position);
        face.scale.setScalar(1.05 * box[0].distanceTo(box[7]));
        face.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), this.plane.normal);
        face.material.uniforms.color.value.copy(item.material.color);
      }
      for (const mesh of counters) mesh.visible = cuts;
      face.visible = cuts;
      this.cut += Number(cuts);
    });
  }

  /** Whether a point of the scene is left out. */
  hides(point) {
    return this.on && this.plane.distanceToPoint(point) < -1e-6;
  }
}

/**
 * What a ray meets first: { part, point, normal, face, cut }, the point and normal in the scene; null if nothing. With a
 * section, a part whose inside comes first behind the plane is met on its cut face, and `face` is then null.
 */
function firstHit(raycaster, items, section) {
  const meshes = items.map((item) => item.mesh);
  const sides = items.map((item) => item.material.side);
  if (section.on) items.forEach((item) => (item.material.side = THREE.DoubleSide));
  const hits = raycaster.intersectObjects(meshes, false);
  items.forEach((item, k) => (item.material.side = sides[k]));
  const seen = new Set();
  let best = null;
  for (const hit of hits) {
    const { part } = hit.object.userData;
    if (seen.has(part) || section.hides(hit.point)) continue;
    seen.add(part);
    const normal = hit.face.normal.clone().transformDirection(hit.object.matrixWorld);
    const inside = section.on && normal.dot(raycaster.ray.direction) > 0;
    const onPlane = inside ? raycaster.ray.intersectPlane(section.plane, new THREE.Vector3()) : null;
    const point = onPlane ?? hit.point;
    const distance = point.distanceTo(raycaster.ray.origin);
    if (best && best.distance <= distance) continue;
    best = { part, point, normal, distance, mesh: hit.object, face: onPlane ? null : hit.faceIndex, cut: Boolean(onPlane) };
  }
  return best;
}
