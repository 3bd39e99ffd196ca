// The camera image with its boxes, and what a pointer does on it.

const DRAG_PIXELS = 6;
const COLORS = {
  tracking: '#3ee6d6', uncertain: '#ffc457', marked: '#3ee6d6', interpolated: '#ffc457',
};
const DASHES = { uncertain: [8, 5], interpolated: [8, 5] };

export class Stage {
  /** `on` has drag(box), click(x, y) and pick(id), in pixels of the image. */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.on = on;
    this.image = null;
    this.state = null;
    this.start = null;
    this.end = null;
    this.locked = false;
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener('pointerdown', event => this.press(event));
    canvas.addEventListener('pointermove', event => this.move(event));
    canvas.addEventListener('pointerup', event => this.release(event));
    canvas.addEventListener('pointercancel', () => this.cancel());
  }

  show(image, state) {
    if (this.image) this.image.close();
    this.image = image;
    this.state = state;
    this.canvas.parentElement.style.setProperty('--aspect', `${state.width} / ${state.height}`);
    this.draw();
    this.describe();
  }

  /** Tell what is seen to those who do not see it. */
  describe() {
    const targets = this.state.targets.map(each => `target ${each.id} ${each.state}`);
    this.canvas.setAttribute('aria-label', `Camera image; ${targets.join(', ') || 'no target'}`);
    this.canvas.dataset.number = this.state.number;
    this.canvas.dataset.state = JSON.stringify(this.state);
    const { left, top, scale } = this.place();
    this.canvas.dataset.place = JSON.stringify({ left, top, scale });
  }

  /** Where the image lies on the canvas, in CSS pixels. */
  place() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = Math.min(width / this.state.width, height / this.state.height);
    return {
      scale,
      left: (width - scale * this.state.width) / 2,
      top: (height - scale * this.state.height) / 2,
    };
  }

  draw() {
    if (!this.image) return;
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(ratio * this.canvas.clientWidth);
    const height = Math.round(ratio * this.canvas.clientHeight);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      Object.assign(this.canvas, { width, height });
    }
    const { left, top, scale } = this.place();
    const pen = this.context;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = scale < 3;
    pen.drawImage(this.image, left, top, scale * this.state.width, scale * this.state.height);
    for (const target of this.state.targets) {
      if (target.expected && target.state !== 'tracking') this.drawExpected(target, left, top, scale);
      if (target.box) this.drawTarget(target, left, top, scale);
    }
    if (this.start && this.end) this.drawDrag(left, top, scale);
  }

  drawTarget(target, left, top, scale) {
    const pen = this.context;
    const [x, y, width, height] = target.box.map(value => value * scale);
    const chosen = target.id === this.state.selected;
    pen.save();
    pen.setLineDash(DASHES[target.state] || []);
    // A dark rim keeps the line visible on white, too.
    for (const [color, extra] of [['rgba(0, 0, 0, .75)', 2], [COLORS[target.state] || '#fff', 0]]) {
      pen.strokeStyle = color;
      pen.lineWidth = (chosen ? 2.5 : 1.5) + extra;
      pen.strokeRect(left + x, top + y, width, height);
    }
    pen.restore();
    const score = target.score === null ? '' : ` ${target.score.toFixed(2)}`;
    this.label(`${target.id} ${target.state}${score}`, left + x, top + y, height);
  }

  /** The ellipse in which a target is expected that is not seen well. */
  drawExpected({ id, box, expected }, left, top, scale) {
    const pen = this.context;
    const [x, y] = [left + scale * expected.center[0], top + scale * expected.center[1]];
    const [long, short] = expected.axes.map(axis => Math.max(3, scale * axis));
    pen.save();
    pen.beginPath();
    pen.rect(left, top, scale * this.state.width, scale * this.state.height);
    pen.clip();
    pen.beginPath();
    pen.ellipse(x, y, long, short, expected.turn, 0, 2 * Math.PI);
    pen.moveTo(x - 8, y);
    pen.lineTo(x + 8, y);
    pen.moveTo(x, y - 8);
    pen.lineTo(x, y + 8);
    for (const [color, width] of [['rgba(0, 0, 0, .75)', 3.5], ['#fff', 1.5]]) {
      pen.strokeStyle = color;
      pen.lineWidth = width;
      pen.setLineDash([2, 4]);
      pen.stroke();
    }
    pen.restore();
    if (!box) this.label(`${id} expected about here`, x, y, 0);
  }

  label(text, x, y, height) {
    const pen = this.context;
    pen.font = '600 13px system-ui, "DejaVu Sans", sans-serif';
    const width = pen.measureText(text).width + 10;
    const left = Math.max(0, Math.min(x - 1, this.canvas.clientWidth - width));
    const beside = y >= 24 ? y - 23 : y + height + 4;
    const top = Math.max(0, Math.min(beside, this.canvas.clientHeight - 19));
    pen.fillStyle = 'rgba(0, 0, 0, .78)';
    pen.fillRect(left, top, width, 19);
    pen.fillStyle = '#fff';
    pen.fillText(text, left + 5, top + 14);
  }

  drawDrag(left, top, scale) {
    const box = this.dragged();
    const pen = this.context;
    const at = [left + scale * box[0], top + scale * box[1], scale * box[2], scale * box[3]];
    pen.strokeStyle = '#000';
    pen.lineWidth = 3;
    pen.strokeRect(...at);
    pen.strokeStyle = '#fff';
    pen.lineWidth = 1.5;
    pen.setLineDash([4, 4]);
    pen.strokeRect(...at);
    pen.setLineDash([]);
  }

  dragged() {
    const [[x0, y0], [x1, y1]] = [this.start, this.end];
    return [Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0)];
  }

  /** The pixel of the image under a pointer, kept inside the image. */
  pixel(event) {
    const frame = this.canvas.getBoundingClientRect();
    const { left, top, scale } = this.place();
    const inside = (value, limit) => Math.max(0, Math.min(value, limit));
    return [inside((event.clientX - frame.left - left) / scale, this.state.width),
      inside((event.clientY - frame.top - top) / scale, this.state.height)];
  }

  press(event) {
    if (!this.state || event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.start = this.pixel(event);
    this.end = null;
    // The box is for the frame that was seen when it was begun.
    this.pressed = this.state;
  }

  move(event) {
    if (!this.start || this.locked) return;
    const end = this.pixel(event);
    const { scale } = this.place();
    const far = Math.hypot(end[0] - this.start[0], end[1] - this.start[1]) * scale;
    if (this.end || far >= DRAG_PIXELS) {
      this.end = end;
      this.draw();
    }
  }

  release(event) {
    if (!this.start) return;
    const [start, seen] = [this.start, this.pressed];
    const box = this.end && this.dragged();
    this.cancel();
    if (box && box[2] > 0 && box[3] > 0) this.on.drag(box, seen);
    else if (!box) this.click(start, seen);
  }

  click([x, y], seen) {
    const hit = seen.targets.filter(({ box }) => box && x >= box[0] && y >= box[1]
      && x <= box[0] + box[2] && y <= box[1] + box[3]);
    hit.sort((one, other) => one.box[2] * one.box[3] - other.box[2] * other.box[3]);
    if (hit.length) this.on.pick(hit[0].id);
    else this.on.click(x, y, seen);
  }

  /** Give up a drag; tell whether there was one. */
  cancel() {
    const was = Boolean(this.start);
    this.start = this.end = null;
    this.draw();
    return was;
  }
}
