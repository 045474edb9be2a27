// The connection to the server: reconnects, and detects when no messages arrive.

const RETRY_MS = 1000;
const SILENCE_MS = 1500;

export class Link {
  constructor({ onMessage, onChange }) {
    this.onMessage = onMessage;
    this.onChange = onChange;
    this.receivedMs = 0;
    this.isOpen = false;
    setInterval(() => this.onChange(), 250);
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/socket`);
    this.socket.onopen = () => { this.isOpen = true; this.receivedMs = performance.now(); this.onChange(); };
    this.socket.onmessage = (event) => {
      this.receivedMs = performance.now();
      this.onMessage(JSON.parse(event.data));
    };
    this.socket.onclose = () => {
      this.isOpen = false;
      this.onChange();
      setTimeout(() => this.open(), RETRY_MS);
    };
  }

  get isAlive() {
    return this.isOpen && performance.now() - this.receivedMs < SILENCE_MS;
  }

  send(request) {
    if (this.isOpen && this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }
}
