// The page: puts together the link, the stage, the strip, the history and the controls.

import { Answer } from './answer.js';
import { History } from './history.js';
import { Link } from './link.js';
import { Stage } from './stage.js';
import { Strip } from './strip.js';
import { beep } from './sound.js';
import { show } from './readings.js';

const element = name => document.getElementById(name);
const page = { paused: false, enabled: true, readOnly: false, recording: false, state: null, wasLost: false, stepping: false };

const strip = new Strip(element('strip'));
const history = new History(element('history'));
const answer = new Answer(element('answer'), () => page.paused && step(0));
const stage = new Stage(element('stage'), {
  drag: (box, seen) => start(box, seen),
  click: (x, y, seen) => page.recording || wish({ type: 'point', stamp: seen.stamp, x, y }),
  pick: id => page.recording || command({ type: 'select', id }),
});
const link = new Link({ up: isUp, frame: takeFrame, message: takeMessage });

function command(message) {
  if (page.readOnly) return;
  answer.say('');
  link.send(message);
}

/** Ask for a start, which the tracker accepts or refuses when it gets to it. */
function wish(message) {
  command(message);
  if (!page.readOnly && !page.recording) answer.expect();
}

/** Start in the frame that was seen; in a recording, mark it and look at the mark. */
function start(box, seen) {
  wish({ type: 'start', stamp: seen.stamp, box });
  step(0);
}

/** Change what is known of the frame that is shown. */
function mark(type) {
  if (!page.state) return;
  command({ type, stamp: page.state.stamp });
  step(0);
}

function isUp(up) {
  element('link').textContent = up ? 'connected' : 'not connected';
  element('link').dataset.up = up;
  if (up) {
    page.stepping = false;
    page.later = null;
    history.clear();
    answer.begin();
    look();
    if (!page.paused) ask();
  } else {
    warn('The console does not answer. It is tried again.');
  }
}

function ask() {
  link.send({ type: 'next', drawn: page.state ? page.state.number : 0 });
}

function note(events) {
  history.add(events);
  answer.hear(events);
}

async function takeFrame(state, picture) {
  note(state.events);
  try {
    const image = await createImageBitmap(picture);
    // A view that stands still moves by steps alone.
    if (state.asked === 'step' || !page.paused) present(image, state);
    else image.close();
  } finally {
    if (state.asked === 'step') stepped();
    // The frame after this one is asked for when this one has been painted.
    else if (!page.paused) requestAnimationFrame(ask);
  }
}

function present(image, state) {
  if (page.recording) place(state.number);
  page.state = state;
  stage.show(image, state);
  element('empty').hidden = true;
  strip.add(state);
  tell(state);
}

function takeMessage(message) {
  if (message.type === 'hello') {
    page.readOnly = message.read_only;
    record(message);
    element('recorder').hidden = !message.can_record;
    document.body.classList.toggle('looks', message.read_only);
    stage.locked = message.read_only;
    element('read-only').hidden = !message.read_only;
    element('topic').textContent = message.topic;
    choices(message.palettes);
    strip.load(message.strip);
  } else if (message.type === 'answer') {
    answer.told(message.done, message.text);
    // A step that cannot be made has no frame that would end it.
    if (!message.done) stepped();
  } else if (message.type === 'silence') {
    note(message.events);
    if (page.recording) {
      // It is at its end.
      if (!page.paused) pause();
      return;
    }
    silent(message);
    if (!page.paused) ask();
  }
}

function silent({ seconds, topic }) {
  const since = seconds === null ? 'No image has come yet' : `No image for ${Math.round(seconds)} s`;
  // Where images come and none is complete, the next one is awaited.
  if (seconds !== null && seconds < 1) return;
  warn(`${since} on ${topic}. Is the camera running?`);
  if (!page.state) element('empty').textContent = `Waiting for images on ${topic}`;
}

/** A recording begins at rest. */
function record({ is_recording: recorded, length }) {
  page.recording = recorded;
  document.body.classList.toggle('records', recorded);
  if (!recorded) return;
  element('place').max = length;
  if (!page.state && !page.paused) pause();
}

function place(number) {
  element('place').value = number;
  element('frame-number').textContent = `${number} of ${element('place').max}`;
}

/** Show what is said of a frame, and warn of a loss. */
function tell(state) {
  show(state, id => command({ type: 'select', id }));
  if (page.recording) {
    warn('');
    return;
  }
  page.enabled = state.state !== 'disabled';
  element('enable').textContent = page.enabled ? 'Stop tracker' : 'Resume tracker';
  element('enable').setAttribute('aria-pressed', String(!page.enabled));
  const count = state.health.recorded;
  element('record').textContent = count === null ? 'Record' : `Stop recording (${count} messages)`;
  element('record').setAttribute('aria-pressed', String(count !== null));
  const lost = state.targets.filter(each => each.state === 'lost').map(each => each.id);
  const silence = state.health.tracker_silence;
  if (lost.length) warn(`Target ${lost.join(', ')} lost. It is searched for.`);
  else if (silence === null || silence > 2) warn('The tracker says nothing. Is it running?');
  else warn('');
  if (lost.length && !page.wasLost && element('sound').checked) beep();
  page.wasLost = Boolean(lost.length);
}

function warn(text) {
  const banner = element('banner');
  if (banner.textContent !== text) banner.textContent = text;
  banner.hidden = !text;
}

function choices(palettes) {
  const chosen = element('palette').value;
  element('palette').replaceChildren(...palettes.map(name => new Option(name.replace('_', ' '), name)));
  if (chosen) element('palette').value = chosen;
}

function look() {
  link.send({
    type: 'look', palette: element('palette').value || 'white_hot',
    confidence: element('confidence').checked,
  });
  // A view that stands still is drawn anew.
  if (page.paused) step(0);
}

function pause() {
  page.paused = !page.paused;
  element('pause').setAttribute('aria-pressed', String(page.paused));
  element('frozen').hidden = !page.paused || page.recording;
  element('pause-word').textContent = page.recording && page.paused ? 'Play'
    : page.recording ? 'Pause' : 'Pause view';
  element('back').disabled = element('forward').disabled = !page.paused;
  if (!page.paused) ask();
}

function step(by) {
  seek(page.state ? page.state.number : 1, by);
}

function seek(number, by) {
  if (!page.paused) return;
  // One after the other; of those that have to wait, the last one counts.
  if (page.stepping) {
    page.later = [number, by];
    return;
  }
  page.stepping = true;
  link.send({ type: 'step', number, by });
}

function stepped() {
  const later = page.later;
  page.stepping = false;
  page.later = null;
  if (later) seek(...later);
}

const KEYS = {
  Escape: () => stage.cancel() || (page.recording ? mark('unmark') : command({ type: 'reset' })),
  ' ': pause,
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
};

document.addEventListener('keydown', event => {
  const typing = event.target.closest('input:not(#place), select, button, summary, a');
  const action = KEYS[event.key];
  if (!action || event.ctrlKey || event.altKey || event.metaKey) return;
  if (typing && event.key !== 'Escape') return;
  event.preventDefault();
  action();
});
element('reset').addEventListener('click', KEYS.Escape);
element('pause').addEventListener('click', pause);
element('back').addEventListener('click', () => step(-1));
element('forward').addEventListener('click', () => step(1));
element('enable').addEventListener('click', () => command({ type: 'enable', on: !page.enabled }));
element('palette').addEventListener('change', look);
element('confidence').addEventListener('change', look);
element('sound').addEventListener('change', () => element('sound').checked && beep());
element('record').addEventListener('click', () => command({
  type: 'record', on: element('record').getAttribute('aria-pressed') === 'false',
}));
element('absent').addEventListener('click', () => mark('absent'));
element('unmark').addEventListener('click', () => mark('unmark'));
element('place').addEventListener('input', () => {
  if (!page.paused) pause();
  seek(Number(element('place').value), 0);
});
element('numbers').addEventListener('submit', event => {
  event.preventDefault();
  const fields = new FormData(event.target);
  const box = ['x', 'y', 'width', 'height'].map(name => Number(fields.get(name)));
  if (page.state) start(box, page.state);
});
