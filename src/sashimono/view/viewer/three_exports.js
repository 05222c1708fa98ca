// What the viewer uses of three.js; README.md says how this becomes three.bundle.min.js.
export {
  AlwaysStencilFunc, BackSide, Box3, BoxGeometry, BufferAttribute, BufferGeometry, Color, ConeGeometry, CylinderGeometry,
  DecrementWrapStencilOp, DirectionalLight, DoubleSide, Float32BufferAttribute, FrontSide, Group, HemisphereLight,
  IncrementWrapStencilOp, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshStandardMaterial,
  NotEqualStencilFunc, OrthographicCamera, PCFSoftShadowMap, PerspectiveCamera, Plane, PlaneGeometry, Quaternion,
  Raycaster, Scene, ShaderMaterial, ShadowMaterial, Spherical, Vector2, Vector3, WebGLRenderTarget, WebGLRenderer,
  ZeroStencilOp,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
