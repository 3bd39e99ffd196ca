// The figures beside the image.

const NONE = '–';
const element = name => document.getElementById(name);
const STATES = {
  '': 'no word from the tracker', idle: 'no target', disabled: 'tracker is stopped',
  tracking: 'tracking', uncertain: 'uncertain', lost: 'lost', absent: 'no target here',
  unmarked: 'not marked',
};

const fixed = (value, digits, unit = '') => (
  value === null || value === undefined ? NONE : `${value.toFixed(digits)}${unit}`);

function write(name, text) {
  if (element(name).textContent !== text) element(name).textContent = text;
}

/** Show the state of a frame; `pick` is called with the number of a target that is chosen. */
export function show(state, pick) {
  const target = state.targets.find(each => each.id === state.selected);
  const name = target ? `target ${target.id} ${target.state}` : STATES[state.state];
  write('state', name === undefined ? `${state.state}: ${state.message}` : name);
  element('state').dataset.state = state.state;
  const box = target && target.box;
  write('score', target ? fixed(target.score, 2) : NONE);
  write('size', box ? `${box[2].toFixed(0)} × ${box[3].toFixed(0)} px` : NONE);
  write('position', position(box, target && target.expected));
  write('speed', fixed(target && target.expected && target.expected.speed, 0, ' px/s'));
  heat(target);
  health(state.health);
  list(state, pick);
}

/** Where a target is, or about where it is expected while it is not seen. */
function position(box, expected) {
  if (box) return `${(box[0] + box[2] / 2).toFixed(0)}, ${(box[1] + box[3] / 2).toFixed(0)} px`;
  if (!expected) return NONE;
  const [x, y] = expected.center;
  return `about ${x.toFixed(0)}, ${y.toFixed(0)} ± ${expected.axes[0].toFixed(0)} px`;
}

function heat(target) {
  const celsius = target && target.celsius;
  const reading = celsius || (target && target.counts);
  if (reading) write('heat-name', celsius ? 'Temperature' : 'Value');
  const digits = celsius ? 1 : 0;
  write('heat', reading ? `${reading.mean.toFixed(digits)}${celsius ? ' °C' : ''} (${
    reading.minimum.toFixed(digits)} to ${reading.maximum.toFixed(digits)})` : NONE);
}

function health(figures) {
  write('image-rate', fixed(figures.image_rate, 1, ' images/s'));
  write('answer-rate', fixed(figures.answer_rate, 1, ' frames/s'));
  write('latency', fixed(figures.latency_ms, 0, ' ms'));
  write('delay', fixed(figures.delay_ms, 0, ' ms'));
  write('dropped', fixed(figures.dropped, 0));
}

/** A button for each of several targets. The buttons stay, so that the focus does. */
function list(state, pick) {
  const several = state.targets.length > 1 ? state.targets : [];
  const holder = element('targets');
  while (holder.children.length > several.length) holder.lastChild.remove();
  while (holder.children.length < several.length) {
    const row = document.createElement('li');
    const button = document.createElement('button');
    button.append(document.createElement('span'), document.createElement('span'));
    button.addEventListener('click', () => pick(Number(button.dataset.id)));
    row.append(button);
    holder.append(row);
  }
  const ordered = [...several].sort((one, other) => one.id - other.id);
  ordered.forEach((target, index) => {
    const button = holder.children[index].firstChild;
    button.dataset.id = target.id;
    button.setAttribute('aria-pressed', String(target.id === state.selected));
    button.children[0].textContent = `target ${target.id}`;
    button.children[1].textContent = `${target.state} ${fixed(target.score, 2)}`;
  });
}
