// Reading the page's own data: the plan as JSON, the geometry as bytes.

function readPlan() {
  return JSON.parse(document.getElementById("plan").textContent);
}

function readBytes() {
  const text = atob(document.getElementById("geometry").textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

/** Unit vectors from octahedral pairs of int16. */
function unpackNormals(pairs) {
  const count = pairs.length / 2;
  const normals = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    let x = pairs[2 * i] / 32767;
    let y = pairs[2 * i + 1] / 32767;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) {
      const fx = (1 - Math.abs(y)) * (x < 0 ? -1 : 1);
      y = (1 - Math.abs(x)) * (y < 0 ? -1 : 1);
      x = fx;
    }
    const size = Math.hypot(x, y, z);
    normals.set([x / size, y / size, z / size], 3 * i);
  }
  return normals;
}

/** The surface and the edge lines of one shape; they share their vertices. */
function unpackShape(shape, buffer) {
  const cells = new Uint16Array(buffer, shape.positionAt, 3 * shape.vertices);
  const positions = new Float32Array(cells.length);
  for (let i = 0; i < cells.length; i++) positions[i] = shape.origin[i % 3] + cells[i] * shape.cell[i % 3];
  const Index = shape.wide ? Uint32Array : Uint16Array;
  const position = new THREE.BufferAttribute(positions, 3);
  const surface = new THREE.BufferGeometry();
  surface.setAttribute("position", position);
  const pairs = new Int16Array(buffer, shape.normalAt, 2 * shape.vertices);
  surface.setAttribute("normal", new THREE.BufferAttribute(unpackNormals(pairs), 3));
  surface.setIndex(new THREE.BufferAttribute(new Index(buffer, shape.faceAt, 3 * shape.faces), 1));
  surface.computeBoundingBox();
  surface.computeBoundingSphere();
  const lines = new THREE.BufferGeometry();
  lines.setAttribute("position", position);
  lines.setIndex(new THREE.BufferAttribute(new Index(buffer, shape.edgeAt, 2 * shape.edges), 1));
  return { surface, lines };
}
