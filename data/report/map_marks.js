// Draws looked-up locations and axes over the image of a map.
'use strict';

const dark = window.matchMedia('(prefers-color-scheme: dark)');

class MapMarks {
  constructor(canvas, markers, cellSize) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.markers = markers;
    this.places = markers.map((marker) => new THREE.Vector3(...marker.at).divideScalar(cellSize));
    this.selected = -1;
  }

  // Position in CSS pixels of the canvas.
  project(place, camera) {
    const at = place.clone().project(camera);
    return {
      x: (at.x + 1) / 2 * this.canvas.clientWidth,
      y: (1 - at.y) / 2 * this.canvas.clientHeight,
      depth: at.z,
      behind: at.z > 1,
    };
  }

  nearest(x, y, within, camera) {
    let best = -1;
    this.places.forEach((place, n) => {
      const at = this.project(place, camera);
      const distance = Math.hypot(at.x - x, at.y - y);
      if (!at.behind && distance < within) {
        within = distance;
        best = n;
      }
    });
    return best;
  }

  draw(camera, labels, selected) {
    this.selected = selected;
    const order = this.places.map((place, n) => ({n, ...this.project(place, camera)}))
      .filter((one) => !one.behind)
      .sort((a, b) => (b.n === selected) - (a.n === selected) || a.depth - b.depth);
    for (const one of order.slice().reverse()) this.drawMark(one);
    if (!labels && selected < 0) return;
    const taken = order.map((one) => [one.x - 5, one.y - 5, one.x + 5, one.y + 5]);
    for (const one of order)
      if (labels || one.n === selected) this.drawLabel(one, taken);
  }

  drawMark(one) {
    const verdict = this.markers[one.n].verdict;
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

  // Labels that would cover another label or mark are omitted, except the selected one.
  drawLabel(one, taken) {
    const c = this.context;
    const chosen = one.n === this.selected;
    const text = this.markers[one.n].label;
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

  drawAxes(camera) {
    const c = this.context;
    const x = 34;
    const y = this.canvas.clientHeight - 34;
    const toCamera = new THREE.Matrix4().getInverse(camera.matrixWorld);
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
