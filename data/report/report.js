// The page of `graspmap report`: 3-D views of maps, looked-up places chosen in table or view, and
// pictures at full size. All that it adds is worked from what stands in the page.
(function () {
  'use strict';

  const palette = JSON.parse(document.getElementById('palette').textContent);
  const calm = window.matchMedia('(prefers-reduced-motion: reduce)');
  const dark = window.matchMedia('(prefers-color-scheme: dark)');
  const MAX_LIVE = 3; // views whose geometry is kept at a time
  const OBLIQUE = [-0.35, -0.75, 0.62]; // from the map's middle to the camera
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

  // A unit cube without its bottom. Tops have the legend's colour, sides darker ones; these end just
  // below the top, so that those between neighbours of one height do not shine through.
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

  class MapView {
    constructor(figure) {
      this.figure = figure;
      this.data = JSON.parse(figure.querySelector('.map-data').textContent);
      this.viewport = figure.querySelector('.viewport');
      this.canvas = figure.querySelector('canvas');
      this.context = this.canvas.getContext('2d');
      this.rows = Array.from(figure.querySelectorAll('tr[data-place]'));
      this.mode = 'score';
      this.labels = true;
      this.selected = -1;
      this.pending = false;
      const bytes = bytesOf(this.data.cells);
      this.count = bytes.length / 7;
      this.cells = new Uint16Array(bytes.buffer, 0, 3 * this.count);
      this.values = bytes.subarray(6 * this.count);
      this.measure();
      this.setUpCamera();
      this.setUpTools();
      this.setUpTable();
      this.setUpPicking();
      this.show();
    }

    // In cells: the box of the map and, from it, how far the camera stands.
    measure() {
      const high = [0, 0, 0];
      for (let n = 0; n < this.cells.length; n++)
        if (this.cells[n] > high[n % 3]) high[n % 3] = this.cells[n];
      this.size = new THREE.Vector3(high[0] + 1, high[1] + 1, high[2] + 1);
      this.middle = this.size.clone().multiplyScalar(0.5);
      this.reach = this.size.length();
      const cell = this.data.cell_size_m;
      this.places = this.data.markers.map(
        (marker) => new THREE.Vector3(...marker.at).divideScalar(cell));
    }

    setUpCamera() {
      this.camera = new THREE.PerspectiveCamera(32, 1, this.reach / 500, this.reach * 20);
      this.camera.up.set(0, 0, 1);
      this.controls = new THREE.OrbitControls(this.camera, this.canvas);
      this.controls.enableKeys = false;
      this.controls.enableZoom = false; // until the view is chosen: the wheel scrolls the page
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

    // Far enough that the whole map is in the picture, whatever its shape.
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
        const depth = point.z + this.reach; // towards the camera, from the middle
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

    setMode(mode) {
      this.mode = mode;
      this.figure.dataset.mode = mode;
      for (const button of this.figure.querySelectorAll('.tools [data-mode]'))
        button.setAttribute('aria-pressed', String(button.dataset.mode === mode));
      for (const legend of this.figure.querySelectorAll('.legend[data-mode]'))
        legend.hidden = legend.dataset.mode !== mode;
      if (this.geometry) this.paint();
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

    // A press that does not move picks the nearest place.
    setUpPicking() {
      let start = null;
      this.canvas.addEventListener('pointerdown', (event) => {
        start = event.isPrimary ? [event.clientX, event.clientY] : null;
      });
      this.canvas.addEventListener('pointerup', (event) => {
        if (!start || Math.hypot(event.clientX - start[0], event.clientY - start[1]) > 5) return;
        const box = this.canvas.getBoundingClientRect();
        const found = this.nearest(event.clientX - box.left, event.clientY - box.top,
                                   event.pointerType === 'touch' ? 28 : 16);
        if (found >= 0) this.choose(found, false);
      });
    }

    nearest(x, y, within) {
      let best = -1;
      this.places.forEach((place, n) => {
        const at = this.project(place);
        const distance = Math.hypot(at.x - x, at.y - y);
        if (!at.behind && distance < within) {
          within = distance;
          best = n;
        }
      });
      return best;
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
      if (turn) this.turnTo(this.places[place]);
      this.ask();
    }

    // Within its box alone: the page stays where it is.
    scrollTo(row) {
      const box = row.closest('.scroll');
      const inner = row.getBoundingClientRect();
      const outer = box.getBoundingClientRect();
      box.scrollTop += inner.top - outer.top - (outer.height - inner.height) / 2;
    }

    // Nearer, and from the outside of the map, so that nothing stands before the place.
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

    // The canvas in place of the picture.
    show() {
      this.viewport.classList.add('live');
      this.canvas.hidden = false;
      for (const part of this.figure.querySelectorAll('.tools, .hint')) part.hidden = false;
      this.figure.dataset.mode = this.mode;
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
      if (!this.geometry) this.makeGeometry();
      const width = this.canvas.width;
      const height = this.canvas.height;
      // As near and far as the map needs: depths stay fine enough for flush faces.
      const distance = this.camera.position.distanceTo(this.middle);
      this.camera.near = Math.max(distance - this.reach, this.reach / 200);
      this.camera.far = distance + this.reach;
      this.camera.updateProjectionMatrix();
      const shared = sharedRenderer();
      shared.setSize(width, height, false);
      shared.render(this.scene, this.camera);
      this.context.setTransform(1, 0, 0, 1, 0, 0);
      this.context.clearRect(0, 0, width, height);
      this.context.drawImage(shared.domElement, 0, 0);
      this.context.setTransform(scale, 0, 0, scale, 0, 0);
      this.drawMarkers();
      this.drawAxes();
      this.figure.dataset.drawn = String(Number(this.figure.dataset.drawn || 0) + 1);
    }

    // In CSS pixels of the canvas.
    project(place) {
      const at = place.clone().project(this.camera);
      return {
        x: (at.x + 1) / 2 * this.canvas.clientWidth,
        y: (1 - at.y) / 2 * this.canvas.clientHeight,
        depth: at.z,
        behind: at.z > 1,
      };
    }

    drawMarkers() {
      const order = this.places.map((place, n) => ({n, ...this.project(place)}))
        .filter((one) => !one.behind)
        .sort((a, b) => (b.n === this.selected) - (a.n === this.selected) || a.depth - b.depth);
      for (const one of order.slice().reverse()) this.drawMark(one);
      if (!this.labels && this.selected < 0) return;
      const taken = order.map((one) => [one.x - 5, one.y - 5, one.x + 5, one.y + 5]);
      for (const one of order)
        if (this.labels || one.n === this.selected) this.drawLabel(one, taken);
    }

    drawMark(one) {
      const verdict = this.data.markers[one.n].verdict;
      const chosen = one.n === this.selected;
      const radius = chosen ? 7 : 4.5;
      const c = this.context;
      c.beginPath();
      if (verdict === 0) {
        c.moveTo(one.x, one.y - radius * 1.2);
        c.lineTo(one.x + radius * 1.2, one.y);
        c.lineTo(one.x, one.y + radius * 1.2);
        c.lineTo(one.x - radius * 1.2, one.y);
        c.closePath();
      } else {
        c.arc(one.x, one.y, radius, 0, 2 * Math.PI);
      }
      c.fillStyle = verdict === 1 ? '#0b7a2c' : verdict === 0 ? '#c01616' : '#1c4f80';
      c.fill();
      c.lineWidth = 2;
      c.strokeStyle = '#fff';
      c.stroke();
      if (!chosen) return;
      c.beginPath();
      c.arc(one.x, one.y, radius + 6, 0, 2 * Math.PI);
      c.lineWidth = 3;
      c.strokeStyle = '#111';
      c.stroke();
      c.lineWidth = 1.5;
      c.strokeStyle = '#ffd84d';
      c.stroke();
    }

    // Where it covers no other label and no mark; the chosen one always.
    drawLabel(one, taken) {
      const c = this.context;
      const chosen = one.n === this.selected;
      const text = this.data.markers[one.n].label;
      c.font = (chosen ? 'bold 14px ' : '12px ') + 'system-ui, sans-serif';
      const width = c.measureText(text).width;
      const gap = chosen ? 16 : 8;
      const sides = [[gap, 4], [-gap - width, 4], [-width / 2, -gap - 2], [-width / 2, gap + 10]];
      for (const [dx, dy] of sides) {
        const box = [one.x + dx - 2, one.y + dy - 12, one.x + dx + width + 2, one.y + dy + 3];
        const free = taken.every((other) => box[2] < other[0] || other[2] < box[0] ||
                                            box[3] < other[1] || other[3] < box[1]);
        if (!free && !chosen) continue;
        taken.push(box);
        c.lineJoin = 'round';
        c.lineWidth = 3.5;
        c.strokeStyle = 'rgba(255,255,255,0.92)';
        c.strokeText(text, one.x + dx, one.y + dy);
        c.fillStyle = '#111';
        c.fillText(text, one.x + dx, one.y + dy);
        return;
      }
    }

    drawAxes() {
      const c = this.context;
      const x = 34;
      const y = this.canvas.clientHeight - 34;
      const toCamera = new THREE.Matrix4().getInverse(this.camera.matrixWorld);
      const axes = [['x', 1, 0, 0, '#c01616'], ['y', 0, 1, 0, '#0b7a2c'], ['z', 0, 0, 1, '#1f5fc0']];
      c.font = '11px system-ui, sans-serif';
      c.lineWidth = 2;
      for (const [name, ...rest] of axes) {
        const tip = new THREE.Vector3(rest[0], rest[1], rest[2]).transformDirection(toCamera);
        c.strokeStyle = c.fillStyle = dark.matches ? '#dfe5ea' : rest[3];
        c.beginPath();
        c.moveTo(x, y);
        c.lineTo(x + 22 * tip.x, y - 22 * tip.y);
        c.stroke();
        c.fillText(name, x + 29 * tip.x - 3, y - 29 * tip.y + 4);
      }
    }
  }

  // Views are made when they come into sight; the geometry of those longest out of it is dropped.
  function startViews() {
    const views = new Map();
    const recent = [];
    const watch = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const figure = entry.target;
        if (!entry.isIntersecting) {
          if (views.has(figure)) views.get(figure).visible = false;
          continue;
        }
        if (!views.has(figure)) views.set(figure, new MapView(figure));
        const view = views.get(figure);
        view.visible = true;
        view.ask();
        if (recent.includes(view)) recent.splice(recent.indexOf(view), 1);
        recent.push(view);
        while (recent.length > MAX_LIVE) recent.shift().dropGeometry();
      }
    }, {rootMargin: '100px'});
    for (const figure of document.querySelectorAll('figure.map'))
      if (figure.querySelector('.map-data')) watch.observe(figure);
  }

  function tellThatNoView(reason) {
    for (const viewport of document.querySelectorAll('.viewport')) {
      const text = document.createElement('p');
      text.className = 'still';
      text.textContent = 'The 3-D view needs WebGL, which this browser does not offer. ' + reason;
      viewport.append(text);
    }
  }

  // A picture at full size on a click.
  function startPictures() {
    const dialog = document.createElement('dialog');
    const large = document.createElement('img');
    dialog.append(large);
    document.body.append(dialog);
    dialog.addEventListener('click', () => dialog.close());
    for (const image of document.querySelectorAll('.picture img')) {
      image.tabIndex = 0;
      image.setAttribute('role', 'button');
      const open = () => {
        large.src = image.src;
        large.alt = image.alt;
        dialog.showModal();
      };
      image.addEventListener('click', open);
      image.addEventListener('keydown', (event) => {
        if (event.key !== 'Enter' && event.key !== ' ') return;
        event.preventDefault();
        open();
      });
    }
  }

  startPictures();
  if (document.querySelector('.map-data')) {
    try {
      sharedRenderer();
      startViews();
    } catch (error) {
      tellThatNoView('');
    }
  }
}());
