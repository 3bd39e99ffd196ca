// Starts, losses and finds, the newest first.

const MOST = 50;
const WORDS = {
  accepted: 'started', refused: 'start refused', lost: 'lost', found: 'found again',
  dropped: 'dropped',
};

export class History {
  constructor(list) {
    this.list = list;
    this.events = new Map();
  }

  clear() {
    this.events.clear();
  }

  add(events) {
    if (!events.length) return;
    for (const event of events) this.events.set(event.number, event);
    while (this.events.size > MOST) this.events.delete(Math.min(...this.events.keys()));
    const newest = [...this.events.values()].sort((one, other) => other.number - one.number);
    this.list.replaceChildren(...newest.map(item));
  }
}

function item(event) {
  const row = document.createElement('li');
  const picture = document.createElement(event.thumbnail ? 'img' : 'div');
  if (event.thumbnail) {
    picture.src = `data:image/jpeg;base64,${event.thumbnail}`;
    picture.alt = '';
  } else {
    picture.className = 'blank';
  }
  const words = document.createElement('div');
  const title = document.createElement('strong');
  const target = event.track_id && event.kind !== 'refused' ? `target ${event.track_id} ` : '';
  title.textContent = `${target}${WORDS[event.kind] || event.kind}`;
  const text = document.createElement('span');
  text.textContent = `${new Date(1000 * event.at).toLocaleTimeString()} · ${event.text}`;
  words.append(title, text);
  row.append(picture, words);
  return row;
}
