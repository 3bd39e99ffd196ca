// Score and size of the selected target in the last two minutes.

const SECONDS = 120;
const SAMPLE_SECONDS = 0.1;
const REDRAW_MS = 250;

export class Strip {
  constructor(canvas) {
    this.canvas = canvas;
    this.samples = [];
    this.offset = 0;
    new ResizeObserver(() => this.draw()).observe(canvas);
    setInterval(() => this.draw(), REDRAW_MS);
  }

  /** Begin with what the server has kept; its clock may be another one. */
  load(samples) {
    const newest = samples.length ? samples[samples.length - 1].at : 0;
    const offset = samples.length ? Date.now() / 1000 - newest : 0;
    this.samples = samples.map(each => ({ ...each, at: each.at + offset }));
  }

  add(state) {
    const now = Date.now() / 1000;
    const last = this.samples[this.samples.length - 1];
    if (last && now - last.at < SAMPLE_SECONDS) return;
    const target = state.targets.find(each => each.id === state.selected);
    this.samples.push({
      at: now, state: state.state, score: target ? target.score : null,
      size: target && target.box ? Math.sqrt(target.box[2] * target.box[3]) : null,
    });
    while (now - this.samples[0].at > SECONDS) this.samples.shift();
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    Object.assign(this.canvas, { width: Math.round(ratio * width), height: Math.round(ratio * height) });
    const pen = this.canvas.getContext('2d');
    pen.scale(ratio, ratio);
    const style = getComputedStyle(document.documentElement);
    const color = name => style.getPropertyValue(name).trim();
    pen.strokeStyle = color('--line');
    for (const y of [0.5, height / 2, height - 0.5]) this.line(pen, [[0, y], [width, y]]);
    const now = Date.now() / 1000;
    const x = at => width * (1 - (now - at) / SECONDS);
    this.hatch(pen, color('--bad'), x, height);
    const largest = Math.max(1, ...this.samples.map(each => each.size || 0));
    pen.lineWidth = 2;
    pen.strokeStyle = color('--score');
    this.curve(pen, x, each => each.score, value => 2 + (height - 4) * (1 - value));
    pen.strokeStyle = color('--size');
    pen.setLineDash([5, 4]);
    this.curve(pen, x, each => each.size, value => 2 + (height - 4) * (1 - value / largest));
    pen.setLineDash([]);
  }

  curve(pen, x, value, y) {
    let points = [];
    for (const sample of this.samples) {
      if (value(sample) === null) {
        this.line(pen, points);
        points = [];
      } else {
        points.push([x(sample.at), y(value(sample))]);
      }
    }
    this.line(pen, points);
  }

  line(pen, points) {
    pen.beginPath();
    points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  }

  /** Stripes where the target was lost. */
  hatch(pen, color, x, height) {
    pen.strokeStyle = color;
    pen.lineWidth = 1;
    let end = -Infinity;
    for (const sample of this.samples) {
      if (sample.state !== 'lost' || x(sample.at) < end) continue;
      end = x(sample.at) + 5;
      this.line(pen, [[x(sample.at), height], [end, 0]]);
    }
  }
}
