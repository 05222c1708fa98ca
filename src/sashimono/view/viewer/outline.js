// A line around the moving parts and the one under the mouse, also where other parts hide them: their masks are
// drawn to a texture, and a screen-filling pass colours the pixels just outside.

class Outline {
  constructor(renderer) {
    this.renderer = renderer;
    this.target = new THREE.WebGLRenderTarget(1, 1, { samples: 4 });
    this.masks = new THREE.Scene();
    this.maskMaterials = ["#ff0000", "#00ff00"].map((color) => new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide, depthTest: false }));
    this.empty = new THREE.BufferGeometry();
    this.material = new THREE.ShaderMaterial({
      transparent: true, depthTest: false, depthWrite: false,
      uniforms: {
        mask: { value: this.target.texture }, pixel: { value: new THREE.Vector2() }, width: { value: 2.6 },
      },
      vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
      fragmentShader: `
        uniform sampler2D mask; uniform vec2 pixel; uniform float width; varying vec2 at;
        void main() {
          vec2 here = texture2D(mask, at).rg, near = vec2(0.0);
          for (int i = 0; i < 16; i++) {
            float a = float(i) * 0.3926991;
            near = max(near, texture2D(mask, at + width * pixel * vec2(cos(a), sin(a))).rg);
          }
          vec2 edge = near * (1.0 - here);
          vec3 color = mix(vec3(0.08, 0.40, 0.88), vec3(1.0, 0.48, 0.05), step(edge.g, edge.r));
          gl_FragColor = vec4(color, max(edge.r, edge.g));
        }`,
    });
    this.screen = new THREE.Scene();
    this.screen.add(new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.material));
    this.flatCamera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 1);
  }

  /** A mesh of the mask scene, made when it is first needed. */
  #mask(index) {
    const known = this.masks.children[index];
    if (known) return known;
    const mesh = new THREE.Mesh(this.empty, this.maskMaterials[0]);
    mesh.matrixAutoUpdate = false;
    this.masks.add(mesh);
    return mesh;
  }

  /** Leave out what lies before these planes. */
  clip(planes) {
    for (const material of this.maskMaterials) material.clippingPlanes = planes;
  }

  /** Draw one outline around the moving meshes and one around the hovered, over the picture that is there. */
  render(camera, moving, hovered) {
    if (!moving.length && !hovered.length) return;
    const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    if (this.target.width !== size.x || this.target.height !== size.y) this.target.setSize(size.x, size.y);
    this.material.uniforms.pixel.value.set(1 / size.x, 1 / size.y);
    this.material.uniforms.width.value = 2.4 * this.renderer.getPixelRatio();
    const shown = [...moving.map((mesh) => [mesh, 0]), ...hovered.filter((mesh) => !moving.includes(mesh)).map((mesh) => [mesh, 1])];
    this.masks.children.forEach((mask, k) => (mask.visible = k < shown.length));
    shown.forEach(([mesh, which], k) => {
      const mask = this.#mask(k);
      mask.geometry = mesh.geometry;
      mask.material = this.maskMaterials[which];
      mask.matrix.copy(mesh.matrixWorld);
    });
    this.renderer.setRenderTarget(this.target);
    this.renderer.clear();
    this.renderer.render(this.masks, camera);
    this.renderer.setRenderTarget(null);
    this.renderer.render(this.screen, this.flatCamera);
  }
}
