// Draws the voxels of a map as cubes with WebGL.
'use strict';

const palette = JSON.parse(document.getElementById('palette').textContent);
const FLAGS = {convex: 16, graspable: 32, obstacle: 64};

// One WebGL context for all views, because browsers allow few. Each view copies the image to a separate
// canvas, which is also used for printing.
let renderer = null;
let pickTarget = null;
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
  uniform bool picking;
  attribute vec3 position, cell, tint, number;
  attribute float shade;
  varying vec3 color;
  void main() {
    color = picking ? number : tint * shade;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(cell + position, 1.0);
  }`;
const FRAGMENT = `
  precision mediump float;
  varying vec3 color;
  void main() { gl_FragColor = vec4(color, 1.0); }`;

// Unit cube without bottom. Tops have the color of the legend, sides are darker. Sides end just below the
// top, so that they are not visible between neighbors of equal height.
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

// Normal distribution with an error of 2e-4 (Bowling et al. 2009), and its quantiles with 4e-3 (Tukey).
const normal = (z) => 1 / (1 + Math.exp(-1.5976 * z - 0.07056 * z * z * z));
const quantile = (p) => 4.91 * (p ** 0.14 - (1 - p) ** 0.14);
const TAIL = 1.645; // quantile of 0.95
const TYPICAL_SPREAD = 0.7; // spread of ln(force) if only one quantile is known

const lnForce = (byte) => (byte - 1) * 0.04 - 3;
const inNewtons = (force) => Number(force.toPrecision(2)) + ' N';

// Holding forces of the cells: bytes of medians, quantiles 0.05 and 0.95, probabilities of the load.
class CellForces {
  constructor(data, count) {
    const bytes = bytesOf(data.forces);
    [this.median, this.low, this.high, this.known] =
      [0, 1, 2, 3].map((n) => bytes.subarray(n * count, (n + 1) * count));
    this.knownLoad = this.load = data.load_n;
    this.most = data.max_force_n;
  }

  // ln(force) and normal quantile of the probability to reach it, ascending.
  knots(n) {
    const knots = [[this.low[n], TAIL], [this.median[n], 0], [this.high[n], -TAIL]]
      .filter(([byte]) => byte > 0).map(([byte, z]) => [lnForce(byte), z]);
    const [x, z] = [Math.log(this.knownLoad), quantile(this.known[n] / 255)];
    if (Math.abs(z) < 2.3 && knots.every((knot) => (x - knot[0]) * (knot[1] - z) > 0.01))
      knots.push([x, z]);
    return knots.sort((a, b) => a[0] - b[0]);
  }

  // Piecewise linear in ln(load), also outside of the knots.
  probability(n, load) {
    const knots = this.knots(n);
    if (!this.high[n]) return 0;
    if (knots.length === 1) knots.push([knots[0][0] + TYPICAL_SPREAD, knots[0][1] - 1]);
    const x = Math.log(load);
    let k = 0;
    while (k + 2 < knots.length && knots[k + 1][0] < x) k++;
    const [[x0, z0], [x1, z1]] = [knots[k], knots[k + 1]];
    const z = z0 + (z1 - z0) * (x - x0) / Math.max(x1 - x0, 1e-3);
    return normal(Math.min(z, this.median[n] ? this.low[n] ? 9 : TAIL : 0));
  }

  colorByForce(n) {
    const force = this.median[n] ? Math.exp(lnForce(this.median[n])) : 0;
    const last = palette.scale.length - 1;
    return palette.scale[Math.min(last, Math.round(last * force / this.most))];
  }

  colorByProbability(n) {
    const probability = this.probability(n, this.load);
    return palette['c' + palette.bounds.findIndex((bound) => probability >= bound - 1e-6)];
  }

  text(n) {
    const force = (bytes) => inNewtons(bytes[n] ? Math.exp(lnForce(bytes[n])) : 0);
    const share = this.load === this.knownLoad ? this.known[n] / 255
                                               : this.probability(n, this.load);
    return `Holding force ${force(this.median)}, from ${force(this.low)} (5 %) to ` +
      `${force(this.high)} (95 %); probability to hold ${inNewtons(this.load)}: ${share.toFixed(2)}`;
  }
}

class MapCells {
  constructor(data) {
    const bytes = bytesOf(data.cells);
    this.count = bytes.length / 7;
    this.cells = new Uint16Array(bytes.buffer, 0, 3 * this.count);
    this.values = bytes.subarray(6 * this.count);
    if (data.forces) this.forces = new CellForces(data, this.count);
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
    const numbers = new Uint8Array(3 * this.count);
    for (let n = 0; n < this.count; n++)
      for (let byte = 0; byte < 3; byte++) numbers[3 * n + byte] = n >> (8 * byte);
    this.geometry.setAttribute('number', new THREE.InstancedBufferAttribute(numbers, 3, true));
    this.geometry.maxInstancedCount = this.count;
    this.material = new THREE.RawShaderMaterial(
      {vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.FrontSide,
       uniforms: {picking: {value: false}}});
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
    const forces = this.forces;
    const byForce = this.mode === 'force';
    const byLoad = forces && this.mode === 'score' && forces.load !== forces.knownLoad;
    for (let n = 0; n < this.count; n++) {
      const above = (this.values[n] & 15) !== 8;
      const color = above && byForce ? forces.colorByForce(n)
        : above && byLoad ? forces.colorByProbability(n) : colors[this.values[n] & 127];
      tint[3 * n] = color[0];
      tint[3 * n + 1] = color[1];
      tint[3 * n + 2] = color[2];
    }
    this.tint.needsUpdate = true;
  }

  // Returns the index of the cell that `camera` shows at a pixel; -1 if there is none.
  pick(camera, width, height, x, y) {
    if (!this.geometry) return -1;
    if (!pickTarget) pickTarget = new THREE.WebGLRenderTarget(1, 1);
    const shared = sharedRenderer();
    const pixel = new Uint8Array(4);
    camera.setViewOffset(width, height, x, y, 1, 1);
    this.material.uniforms.picking.value = true;
    shared.setRenderTarget(pickTarget);
    shared.render(this.scene, camera);
    shared.readRenderTargetPixels(pickTarget, 0, 0, 1, 1, pixel);
    shared.setRenderTarget(null);
    this.material.uniforms.picking.value = false;
    camera.clearViewOffset();
    return pixel[3] === 0 ? -1 : pixel[0] + 256 * pixel[1] + 65536 * pixel[2];
  }

  // Returns the image of `camera`: the shared canvas, valid until the next view is drawn.
  draw(camera, width, height) {
    if (!this.geometry) this.makeGeometry();
    const shared = sharedRenderer();
    shared.setSize(width, height, false);
    shared.render(this.scene, camera);
    return shared.domElement;
  }
}
