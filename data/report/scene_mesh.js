// Draws a colored mesh instead of the voxels of a map with WebGL.
'use strict';

// Lighting as in `graspmap render`: from the upper left behind the camera, on both sides.
const SCENE_VERTEX = `
  precision highp float;
  uniform mat4 projectionMatrix, modelViewMatrix;
  uniform mat3 normalMatrix;
  attribute vec3 position, normal, tint;
  varying vec3 color, toward;
  void main() {
    color = tint;
    toward = normalMatrix * normal;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;
const SCENE_FRAGMENT = `
  precision highp float;
  varying vec3 color, toward;
  void main() {
    vec3 n = normalize(toward) * (gl_FrontFacing ? 1.0 : -1.0);
    float light = max(0.0, dot(n, normalize(vec3(-0.5, 0.7, 1.0))));
    gl_FragColor = vec4(color * (0.35 + 0.65 * light), 1.0);
  }`;

class SceneMesh extends MapCells {
  constructor(data) {
    super({cells: ''});
    const buffer = bytesOf(data.mesh).buffer;
    const vertices = data.vertices;
    const Index = vertices > 65536 ? Uint32Array : Uint16Array;
    const places = buffer.byteLength - 9 * vertices;
    this.corners = new Index(buffer, 0, places / Index.BYTES_PER_ELEMENT);
    this.places = Float32Array.from(new Uint16Array(buffer, places, 3 * vertices));
    this.colors = new Uint8Array(buffer, places + 6 * vertices);
    const high = [0, 0, 0];
    for (let n = 0; n < this.places.length; n++)
      if (this.places[n] > high[n % 3]) high[n % 3] = this.places[n];
    this.size = new THREE.Vector3(...high);
  }

  makeGeometry() {
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setIndex(new THREE.BufferAttribute(this.corners, 1));
    this.geometry.setAttribute('position', new THREE.BufferAttribute(this.places, 3));
    this.geometry.setAttribute('tint', new THREE.BufferAttribute(this.colors, 3, true));
    this.geometry.computeVertexNormals();
    this.material = new THREE.RawShaderMaterial(
      {vertexShader: SCENE_VERTEX, fragmentShader: SCENE_FRAGMENT, side: THREE.DoubleSide});
    const mesh = new THREE.Mesh(this.geometry, this.material);
    mesh.frustumCulled = false;
    this.scene = new THREE.Scene();
    this.scene.add(mesh);
  }
}
