// How the moving part is held: pads and arrows at the contacts, a schematic gripper where its pose is known.

const CONTACT_COLOR = "#1467e0";
const Y_AXIS = new THREE.Vector3(0, 1, 0);

function contactMaterials(color, opacity) {
  // drawn twice: solid where visible, faint where the part hides it
  const solid = new THREE.MeshBasicMaterial({ color, transparent: opacity < 1, opacity, depthWrite: opacity === 1 });
  const hidden = new THREE.MeshBasicMaterial({
    color, transparent: true, opacity: 0.4 * opacity, depthTest: false, depthWrite: false,
  });
  return [solid, hidden];
}

function addTwice(group, geometry, materials, place) {
  materials.forEach((material, k) => {
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = 10 + k;
    place(mesh);
    group.add(mesh);
  });
}

/** A ball about the origin; the bundle of three.js has no sphere. */
function ball(radius, around = 32, along = 20) {
  const normals = [], indices = [];
  for (let row = 0; row <= along; row++) {
    for (let column = 0; column <= around; column++) {
      const polar = Math.PI * row / along, turn = 2 * Math.PI * column / around;
      normals.push(Math.sin(polar) * Math.cos(turn), Math.cos(polar), -Math.sin(polar) * Math.sin(turn));
      if (row === along || column === around) continue;
      const a = row * (around + 1) + column, b = a + around + 1;
      indices.push(a, b, a + 1, a + 1, b, b + 1);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(normals.map((value) => value * radius)), 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(normals), 3));
  geometry.setIndex(indices);
  return geometry;
}

class Contacts {
  constructor(plan, bodies, sceneSize) {
    this.plan = plan;
    this.bodies = bodies;
    this.sceneSize = sceneSize;
    this.group = new THREE.Group();
    this.group.matrixAutoUpdate = false;
    this.materials = contactMaterials(CONTACT_COLOR, 1);
    this.gripperMaterials = contactMaterials("#46525f", 0.5);
    this.forceMaterials = contactMaterials("#d9480f", 1);
    this.supportMaterials = contactMaterials("#d9480f", 0.55);
    this.shown = null;
  }

  update(t, k, visible, explode) {
    const step = this.plan.steps[k];
    const contact = step && this.#acting(step, t);
    this.group.visible = Boolean(visible && contact && t < step.stop && t >= this.bodies.timeline.plannedFrom(k));
    if (!this.group.visible) return;
    if (this.shown !== contact) this.#build(step, contact);
    this.shown = contact;
    this.group.matrix.copy(matrixOf(this.bodies.drawnPose(step.part, t, explode)));
    this.group.matrixWorldNeedsUpdate = true;
  }

  /** What acts at this time: the contact of the end of the way, or the grasp that brings the part there. */
  #acting(step, t) {
    if (!step.contact) return null;
    return step.carry && t < step.contact.from ? step.carry : t >= step.contact.from ? step.contact : null;
  }

  #build(step, contact) {
    for (const mesh of this.group.children) mesh.geometry.dispose();
    this.group.clear();
    const { kind, points, normals, gripper, tipRadius, force, supports } = contact;
    const { boundingSphere } = this.bodies.items[step.part].mesh.geometry;
    const scale = Math.min(Math.max(boundingSphere.radius, 0.03 * this.sceneSize), 0.075 * this.sceneSize);
    if (kind === "push" && force) {
      this.#arrow(points[0], force[0], 1.6 * scale, this.forceMaterials);
      const most = Math.max(...supports.forces.map((f) => Math.hypot(...f)), 1e-12);
      supports.forces.forEach((f, i) => {
        const share = Math.hypot(...f) / most;
        if (share > 0.02) this.#arrow(supports.points[i], f, scale * (0.3 + 0.5 * share), this.supportMaterials);
      });
    } else {
      points.forEach((point, i) => this.#arrow(point, normals[i], scale));
    }
    if (tipRadius) points.forEach((point, i) => this.#tip(point, normals[i], tipRadius));
    if (gripper && points.length >= 2) this.#gripper(gripper, points, scale);
  }

  /** A fingertip in its true size: a ball that touches the surface from outside. */
  #tip(point, normal, radius) {
    const center = new THREE.Vector3(...point).addScaledVector(new THREE.Vector3(...normal).normalize(), -radius);
    addTwice(this.group, ball(radius), this.gripperMaterials, (mesh) => mesh.position.copy(center));
  }

  #arrow(point, normal, scale, materials = this.materials) {
    const inward = new THREE.Vector3(...normal).normalize();
    const turn = new THREE.Quaternion().setFromUnitVectors(Y_AXIS, inward);
    const put = (back) => (mesh) => {
      mesh.quaternion.copy(turn);
      mesh.position.set(...point).addScaledVector(inward, -back);
    };
    const pad = new THREE.CylinderGeometry(0.2 * scale, 0.2 * scale, 0.05 * scale, 24);
    const head = new THREE.ConeGeometry(0.13 * scale, 0.36 * scale, 24);
    const shaft = new THREE.CylinderGeometry(0.048 * scale, 0.048 * scale, 0.55 * scale, 16);
    addTwice(this.group, pad, materials, put(0.025 * scale));
    addTwice(this.group, head, materials, put(0.23 * scale));
    addTwice(this.group, shaft, materials, put(0.68 * scale));
  }

  #gripper(pose, points, scale) {
    const local = points.map((p) => transformPoint(inverse(pose), p)[0]);
    const reach = Math.max(...local.map(Math.abs));
    const thick = 0.16 * scale;
    const finger = 2.4 * scale;
    const part = new THREE.Group();
    for (const side of [-1, 1]) {
      addTwice(part, new THREE.BoxGeometry(thick, 0.34 * scale, finger), this.gripperMaterials, (mesh) =>
        mesh.position.set(side * (reach + 0.06 * scale + thick / 2), 0, 0.2 * scale - finger / 2));
    }
    const palm = 2 * (reach + thick + 0.06 * scale);
    addTwice(part, new THREE.BoxGeometry(palm, 0.42 * scale, 0.3 * scale), this.gripperMaterials, (mesh) =>
      mesh.position.set(0, 0, 0.2 * scale - finger - 0.15 * scale));
    const turned = matrixOf(pose);
    for (const mesh of [...part.children]) {
      mesh.updateMatrix();
      mesh.matrixAutoUpdate = false;
      mesh.matrix.premultiply(turned);
      this.group.add(mesh);
    }
  }
}
