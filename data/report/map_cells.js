// The voxels of a map as cubes, drawn by WebGL.
'use strict';

const palette = JSON.parse(document.getElementById('palette').textContent);
const FLAGS = {convex: 16, graspable: 32, obstacle: 64};

// One WebGL context for all views: browsers allow few. Each view copies the picture to a canvas of
// its own, which also keeps it for the printer.
let renderer = null;
function sharedRenderer() {
  if (!renderer) {
    renderer = new THREE.WebGLRenderer({antialias: true, alpha: true});
    renderer.setClearColor(0x000000, 0);
  }
  return renderer;
}

const VERTEX = `
  precision highp float;
  uniform mat4 projectionMatrix, modelViewMatrix;
  attribute vec3 position, cell, tint;
  attribute float shade;
  varying vec3 color;
  void main() {
    color = tint * shade;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(cell + position, 1.0);
  }`;
const FRAGMENT = `
  precision mediump float;
  varying vec3 color;
  void main() { gl_FragColor = vec4(color, 1.0); }`;

// A unit cube without its bottom. Tops have the legend's color, sides darker ones; these end just
// below the top, so that those between neighbors of one height do not shine through.
function cubeFaces() {
  const t = 0.96;
  const faces = [
    [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], 1.0],
    [[0, 0, 0], [1, 0, 0], [1, 0, t], [0, 0, t], 0.82],
    [[1, 0, 0], [1, 1, 0], [1, 1, t], [1, 0, t], 0.72],
    [[1, 1, 0], [0, 1, 0], [0, 1, t], [1, 1, t], 0.62],
    [[0, 1, 0], [0, 0, 0], [0, 0, t], [0, 1, t], 0.76],
  ];
  const position = [];
  const shade = [];
  const index = [];
  faces.forEach((face, n) => {
    for (let corner = 0; corner < 4; corner++) {
      position.push(...face[corner]);
      shade.push(face[4]);
    }
    index.push(4 * n, 4 * n + 1, 4 * n + 2, 4 * n, 4 * n + 2, 4 * n + 3);
  });
  return {position, shade, index};
}

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let n = 0; n < text.length; n++) bytes[n] = text.charCodeAt(n);
  return bytes;
}

class MapCells {
  constructor(base64) {
    const bytes = bytesOf(base64);
    this.count = bytes.length / 7;
    this.cells = new Uint16Array(bytes.buffer, 0, 3 * this.count);
    this.values = bytes.subarray(6 * this.count);
    const high = [0, 0, 0];
    for (let n = 0; n < this.cells.length; n++)
      if (this.cells[n] > high[n % 3]) high[n % 3] = this.cells[n];
    this.size = new THREE.Vector3(high[0] + 1, high[1] + 1, high[2] + 1);
    this.mode = 'score';
  }

  setMode(mode) {
    this.mode = mode;
    if (this.geometry) this.paint();
  }

  makeGeometry() {
    const cube = cubeFaces();
    this.geometry = new THREE.InstancedBufferGeometry();
    this.geometry.setIndex(cube.index);
    this.geometry.setAttribute('position', new THREE.Float32BufferAttribute(cube.position, 3));
    this.geometry.setAttribute('shade', new THREE.Float32BufferAttribute(cube.shade, 1));
    this.geometry.setAttribute('cell', new THREE.InstancedBufferAttribute(this.cells, 3));
    this.tint = new THREE.InstancedBufferAttribute(new Uint8Array(3 * this.count), 3, true);
    this.geometry.setAttribute('tint', this.tint);
    this.geometry.maxInstancedCount = this.count;
    this.material = new THREE.RawShaderMaterial(
      {vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.FrontSide});
    const mesh = new THREE.Mesh(this.geometry, this.material);
    mesh.frustumCulled = false;
    this.scene = new THREE.Scene();
    this.scene.add(mesh);
    this.paint();
  }

  dropGeometry() {
    if (!this.geometry) return;
    this.geometry.dispose();
    this.material.dispose();
    this.geometry = this.material = this.scene = this.tint = null;
  }

  colorOf(value) {
    if ((value & 15) === 8) return palette.c8;
    if (this.mode === 'score') return palette['c' + (value & 15)];
    if (value & FLAGS[this.mode]) return palette[this.mode];
    if (this.mode === 'graspable' && value & FLAGS.convex) return palette.convex;
    return palette.rest;
  }

  paint() {
    const colors = [];
    for (let value = 0; value < 128; value++)
      colors.push((value & 15) < 9 ? this.colorOf(value) : palette.rest);
    const tint = this.tint.array;
    for (let n = 0; n < this.count; n++) {
      const color = colors[this.values[n] & 127];
      tint[3 * n] = color[0];
      tint[3 * n + 1] = color[1];
      tint[3 * n + 2] = color[2];
    }
    this.tint.needsUpdate = true;
  }

  // The picture of `camera`: the canvas that all views share, until the next one draws.
  draw(camera, width, height) {
    if (!this.geometry) this.makeGeometry();
    const shared = sharedRenderer();
    shared.setSize(width, height, false);
    shared.render(this.scene, camera);
    return shared.domElement;
  }
}
