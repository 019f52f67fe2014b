// 3-D view of a map: an orbiting camera, tools, and locations selected in the table or in the view.
'use strict';

const calm = window.matchMedia('(prefers-reduced-motion: reduce)');
const OBLIQUE = [-0.35, -0.75, 0.62]; // direction from the center of the map to the camera

class MapView {
  constructor(figure) {
    this.figure = figure;
    this.data = JSON.parse(figure.querySelector('.map-data').textContent);
    this.viewport = figure.querySelector('.viewport');
    this.canvas = figure.querySelector('canvas');
    this.rows = Array.from(figure.querySelectorAll('tr[data-place]'));
    this.labels = true;
    this.selected = -1;
    this.pending = false;
    this.cells = this.data.mesh ? new SceneMesh(this.data) : new MapCells(this.data);
    this.marks = new MapMarks(this.canvas, this.data.markers, this.data.cell_size_m);
    this.size = this.cells.size;
    this.middle = this.size.clone().multiplyScalar(0.5);
    this.reach = this.size.length(); // distance of the camera, in cells
    this.setUpCamera();
    this.setUpTools();
    this.setUpTable();
    this.setUpPicking();
    if (this.cells.forces) this.setUpForces();
    this.show();
  }

  setUpCamera() {
    this.camera = new THREE.PerspectiveCamera(32, 1, this.reach / 500, this.reach * 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.enableKeys = false;
    this.controls.enableZoom = false; // the wheel scrolls the page until the view is selected
    this.controls.screenSpacePanning = true;
    this.controls.minDistance = this.reach / 30;
    this.controls.maxDistance = this.reach * 6;
    this.controls.addEventListener('change', () => this.ask());
    this.canvas.addEventListener('pointerdown', () => {
      this.moving = null;
      this.controls.enableZoom = true;
      this.canvas.focus({preventScroll: true});
    });
    this.canvas.addEventListener('pointerleave', () => { this.controls.enableZoom = false; });
    this.canvas.addEventListener('touchstart', () => { this.controls.enableZoom = true; });
    this.canvas.addEventListener('keydown', (event) => this.onKey(event));
    this.resetCamera('oblique');
  }

  // Distance at which the whole map is in the image.
  resetCamera(name) {
    const direction = name === 'top' ? new THREE.Vector3(0, -1e-3, 1)
                                     : new THREE.Vector3(...OBLIQUE);
    direction.normalize();
    this.controls.target.copy(this.middle);
    this.camera.position.copy(this.middle).addScaledVector(direction, this.reach);
    this.camera.lookAt(this.middle);
    this.camera.updateMatrixWorld();
    this.camera.position.copy(this.middle).addScaledVector(direction, this.fittingDistance());
    this.controls.update();
    this.ask();
  }

  fittingDistance() {
    const toCamera = new THREE.Matrix4().getInverse(this.camera.matrixWorld);
    const up = Math.tan(THREE.Math.degToRad(this.camera.fov / 2)) * 0.94;
    const side = up * this.camera.aspect;
    let distance = 0;
    for (let corner = 0; corner < 8; corner++) {
      const point = new THREE.Vector3(
        corner & 1 ? this.size.x : 0, corner & 2 ? this.size.y : 0, corner & 4 ? this.size.z : 0);
      point.applyMatrix4(toCamera);
      const depth = point.z + this.reach; // from the center towards the camera
      distance = Math.max(distance, Math.abs(point.x) / side + depth, Math.abs(point.y) / up + depth);
    }
    return distance;
  }

  onKey(event) {
    const step = Math.PI / 24;
    const turns = {ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, -step],
                   ArrowDown: [0, step]};
    const offset = this.camera.position.clone().sub(this.controls.target);
    if (turns[event.key]) {
      const round = new THREE.Spherical().setFromVector3(
        new THREE.Vector3(offset.x, offset.z, -offset.y));
      round.theta += turns[event.key][0];
      round.phi = Math.min(Math.PI - 0.01, Math.max(0.01, round.phi + turns[event.key][1]));
      const turned = new THREE.Vector3().setFromSpherical(round);
      offset.set(turned.x, -turned.z, turned.y);
    } else if (event.key === '+' || event.key === '=') {
      offset.multiplyScalar(0.85);
    } else if (event.key === '-') {
      offset.multiplyScalar(1 / 0.85);
    } else {
      return;
    }
    event.preventDefault();
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.ask();
  }

  setUpTools() {
    const tools = this.figure.querySelector('.tools');
    for (const button of tools.querySelectorAll('[data-mode]'))
      button.addEventListener('click', () => this.setMode(button.dataset.mode));
    for (const button of tools.querySelectorAll('[data-camera]'))
      button.addEventListener('click', () => {
        this.moving = null;
        this.resetCamera(button.dataset.camera);
      });
    const labels = tools.querySelector('[data-labels]');
    if (labels)
      labels.addEventListener('click', () => {
        this.labels = !this.labels;
        labels.setAttribute('aria-pressed', String(this.labels));
        this.ask();
      });
  }

  // Slider of the load, on a logarithmic scale around the map's load, and values at the pointer.
  setUpForces() {
    const slider = this.figure.querySelector('.tools input');
    const reading = this.figure.querySelector('.reading');
    slider.addEventListener('input', () => {
      const load = Number((this.data.load_n * 10 ** (slider.value / 40)).toPrecision(2));
      this.cells.forces.load = slider.value === '0' ? this.data.load_n : load;
      this.cells.setMode(this.cells.mode);
      slider.setAttribute('aria-valuetext', inNewtons(load));
      for (const output of this.figure.querySelectorAll('output')) output.value = inNewtons(load);
      reading.hidden = true;
      this.ask();
    });
    this.canvas.addEventListener('pointermove', (event) => {
      const box = this.canvas.getBoundingClientRect();
      const scale = this.canvas.width / box.width;
      const cell = this.cells.pick(
        this.camera, this.canvas.width, this.canvas.height,
        Math.floor((event.clientX - box.left) * scale), Math.floor((event.clientY - box.top) * scale));
      reading.hidden = cell < 0;
      if (cell >= 0) reading.textContent = this.cells.forces.text(cell);
    });
    this.canvas.addEventListener('pointerleave', () => { reading.hidden = true; });
  }

  setMode(mode) {
    this.cells.setMode(mode);
    this.figure.dataset.mode = mode;
    for (const button of this.figure.querySelectorAll('.tools [data-mode]'))
      button.setAttribute('aria-pressed', String(button.dataset.mode === mode));
    for (const legend of this.figure.querySelectorAll('.legend[data-mode]'))
      legend.hidden = legend.dataset.mode !== mode;
    this.ask();
  }

  setUpTable() {
    for (const row of this.rows) {
      const place = Number(row.dataset.place);
      const head = row.querySelector('th');
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = head.textContent;
      button.setAttribute('aria-label', 'Show ' + head.textContent + ' in the view');
      head.replaceChildren(button);
      row.addEventListener('click', () => this.choose(place, true));
    }
  }

  // A click selects the nearest location.
  setUpPicking() {
    let start = null;
    this.canvas.addEventListener('pointerdown', (event) => {
      start = event.isPrimary ? [event.clientX, event.clientY] : null;
    });
    this.canvas.addEventListener('pointerup', (event) => {
      if (!start || Math.hypot(event.clientX - start[0], event.clientY - start[1]) > 5) return;
      const box = this.canvas.getBoundingClientRect();
      const found = this.marks.nearest(event.clientX - box.left, event.clientY - box.top,
                                       event.pointerType === 'touch' ? 28 : 16, this.camera);
      if (found >= 0) this.choose(found, false);
    });
  }

  choose(place, turn) {
    this.selected = place;
    this.figure.dataset.selected = this.data.markers[place].label;
    for (const row of this.rows) {
      const chosen = Number(row.dataset.place) === place;
      row.classList.toggle('selected', chosen);
      row.querySelector('button').setAttribute('aria-pressed', String(chosen));
      if (chosen && !turn) this.scrollTo(row);
    }
    if (turn) this.turnTo(this.marks.places[place]);
    this.ask();
  }

  // Scrolls only the table, not the page.
  scrollTo(row) {
    const box = row.closest('.scroll');
    const inner = row.getBoundingClientRect();
    const outer = box.getBoundingClientRect();
    box.scrollTop += inner.top - outer.top - (outer.height - inner.height) / 2;
  }

  // Moves closer, on the outer side of the map, so that nothing occludes the location.
  turnTo(place) {
    const direction = place.clone().sub(this.middle).setZ(0);
    if (direction.length() < 0.05 * this.reach)
      direction.copy(this.camera.position).sub(this.controls.target).setZ(0);
    if (direction.length() === 0) direction.set(0, -1, 0);
    direction.normalize().setZ(0.85).normalize();
    const end = place.clone().add(direction.multiplyScalar(0.6 * this.reach));
    const from = {target: this.controls.target.clone(), position: this.camera.position.clone()};
    const move = {
      begin: performance.now(),
      last: calm.matches ? 0 : 450,
      at: (share) => {
        const s = share * share * (3 - 2 * share);
        this.controls.target.lerpVectors(from.target, place, s);
        this.camera.position.lerpVectors(from.position, end, s);
        this.controls.update();
      },
    };
    this.moving = move;
    this.ask();
  }

  // Replaces the image by the canvas.
  show() {
    this.viewport.classList.add('live');
    this.canvas.hidden = false;
    for (const part of this.figure.querySelectorAll('.tools, .hint')) part.hidden = false;
    this.figure.dataset.mode = this.cells.mode;
    new ResizeObserver(() => this.ask()).observe(this.canvas);
  }

  ask() {
    if (this.pending || !this.visible) return;
    this.pending = true;
    this.figure.dataset.busy = 'true';
    requestAnimationFrame((now) => {
      this.pending = false;
      if (this.moving) {
        const move = this.moving;
        const share = move.last === 0 ? 1 : Math.min(1, Math.max(0, (now - move.begin) / move.last));
        move.at(share);
        if (share < 1) this.ask();
        else this.moving = null;
      }
      this.draw();
      if (!this.pending) delete this.figure.dataset.busy;
    });
  }

  fit() {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * scale));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * scale));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      const first = !this.fitted;
      this.canvas.width = width;
      this.canvas.height = height;
      this.camera.aspect = width / height;
      this.fitted = true;
      if (first && !this.moving) this.resetCamera('oblique');
    }
    return scale;
  }

  draw() {
    const scale = this.fit();
    // The narrowest depth range of the map, for sufficient depth resolution of adjacent faces.
    const distance = this.camera.position.distanceTo(this.middle);
    this.camera.near = Math.max(distance - this.reach, this.reach / 200);
    this.camera.far = distance + this.reach;
    this.camera.updateProjectionMatrix();
    const context = this.marks.context;
    const picture = this.cells.draw(this.camera, this.canvas.width, this.canvas.height);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.drawImage(picture, 0, 0);
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this.marks.draw(this.camera, this.labels, this.selected);
    this.marks.drawAxes(this.camera);
    this.figure.dataset.drawn = String(Number(this.figure.dataset.drawn || 0) + 1);
  }
}
