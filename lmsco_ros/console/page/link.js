// The socket: asks for frames one by one, and comes back when the server does.

const FIRST_WAIT = 500;
const LONGEST_WAIT = 5000;

/** Split a frame into its state and the file of its picture. */
export function readFrame(buffer) {
  const length = new DataView(buffer).getUint32(0);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  return { state: JSON.parse(text), picture: new Blob([buffer.slice(4 + length)], { type: 'image/jpeg' }) };
}

export class Link {
  /** `on` has up(bool), frame(state, picture) and message(object). */
  constructor(on) {
    this.on = on;
    this.wait = FIRST_WAIT;
    this.open();
  }

  open() {
    const address = new URL('socket', location.href);
    address.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
    this.socket = new WebSocket(address);
    this.socket.binaryType = 'arraybuffer';
    this.socket.onopen = () => { this.wait = FIRST_WAIT; };
    this.socket.onmessage = event => this.receive(event.data);
    this.socket.onclose = () => {
      this.on.up(false);
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
    };
  }

  receive(data) {
    if (typeof data === 'string') {
      const message = JSON.parse(data);
      this.on.message(message);
      if (message.type === 'hello') this.on.up(true);
    } else {
      const { state, picture } = readFrame(data);
      this.on.frame(state, picture);
    }
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
