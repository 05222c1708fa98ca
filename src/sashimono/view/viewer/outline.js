// A line around the moving part and the one under the mouse, also where other parts hide them: their masks are
// drawn to a texture, and a screen-filling pass colours the pixels just outside.

class Outline {
  constructor(renderer) {
    this.renderer = renderer;
    this.target = new THREE.WebGLRenderTarget(1, 1, { samples: 4 });
    this.masks = new THREE.Scene();
    this.slots = ["#ff0000", "#00ff00"].map((color) => {
      const mesh = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide, depthTest: false }));
      mesh.matrixAutoUpdate = false;
      this.masks.add(mesh);
      return mesh;
    });
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

  /** Draw the outlines of up to two meshes, over the picture that is there; either may be null. */
  render(camera, moving, hovered) {
    if (!moving && !hovered) return;
    const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    if (this.target.width !== size.x || this.target.height !== size.y) this.target.setSize(size.x, size.y);
    this.material.uniforms.pixel.value.set(1 / size.x, 1 / size.y);
    this.material.uniforms.width.value = 2.4 * this.renderer.getPixelRatio();
    [moving, hovered === moving ? null : hovered].forEach((mesh, k) => {
      this.slots[k].visible = Boolean(mesh);
      if (!mesh) return;
      this.slots[k].geometry = mesh.geometry;
      this.slots[k].matrix.copy(mesh.matrixWorld);
    });
    this.renderer.setRenderTarget(this.target);
    this.renderer.clear();
    this.renderer.render(this.masks, camera);
    this.renderer.setRenderTarget(null);
    this.renderer.render(this.screen, this.flatCamera);
  }
}
