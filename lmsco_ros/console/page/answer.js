// What came of what a person asked for.

const SAY_MS = 5000;
const PATIENCE_MS = 5000;
const LOOK_MS = 300;

export class Answer {
  /** `look` is called while a start waits for its answer. */
  constructor(line, look) {
    this.line = line;
    this.look = look;
    this.begin();
  }

  /** What a new connection tells first happened before. */
  begin() {
    this.newest = null;
    this.settle();
  }

  say(text, refused = false) {
    clearTimeout(this.saying);
    if (!refused) this.saying = setTimeout(() => this.say(''), SAY_MS);
    this.line.textContent = text;
    this.line.classList.toggle('refused', refused);
  }

  /** Say what the console itself answers. */
  told(done, text) {
    if (!done) this.settle();
    this.say(text, !done);
  }

  /** A start was asked for: say so until the tracker has answered, or when it does not. */
  expect() {
    this.settle();
    this.say('asked the tracker to start');
    this.looking = setInterval(this.look, LOOK_MS);
    this.giving = setTimeout(() => {
      this.settle();
      this.say('The tracker has not answered. Is it running, and does it get what this page sends?', true);
    }, PATIENCE_MS);
  }

  /** Say what became of starts since the last call. */
  hear(events) {
    const known = this.newest;
    this.newest = Math.max(known || 0, ...events.map(event => event.number));
    if (known === null) return;
    for (const event of events.filter(each => each.number > known)) {
      if (event.kind !== 'accepted' && event.kind !== 'refused') continue;
      this.settle();
      if (event.kind === 'refused') this.say(event.text, true);
      else this.say(`target ${event.track_id} is followed`);
    }
  }

  settle() {
    clearInterval(this.looking);
    clearTimeout(this.giving);
  }
}
