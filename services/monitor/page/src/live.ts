// The socket to the monitor: asks for what is visible, comes back by itself, and notices when nobody answers any more.
import { signal } from "@preact/signals";
import { Newest } from "./newest";
import { connection, late_s, note_arrival, show_picture, take } from "./store";
import { type Message, type Reply, split_picture } from "./wire";

const SILENCE_MS = 4000; // something comes at least once a second, whatever is watched
const REPLY_MS = 10000;
const RETRY_MS = [250, 500, 1000, 2000];

/// Set when the monitor asks for one (about.control = "token").
export const token = signal("");

export class Live {
  private socket: WebSocket | null = null;
  private tries = 0;
  private heard_ms = 0;
  private next_id = 1;
  private watched: string[] = [];
  private decoding = false;
  private readonly newest = new Newest(take, (callback) => requestAnimationFrame(callback));
  private readonly waiting = new Map<number, (reply: Reply) => void>();

  constructor(
    private readonly address: string,
    private readonly greeted: () => void,
  ) {
    this.connect();
    setInterval(() => this.check(), 1000);
  }

  watch(topics: string[]): void {
    if (topics.join() === this.watched.join()) return;
    this.watched = topics;
    this.heard_ms = performance.now();
    this.send({ watch: topics });
  }

  /// The answer of the service, or a sentence why there is none.
  control(service: string, command: string, argument = ""): Promise<Reply> {
    const id = this.next_id++;
    return new Promise((resolve) => {
      const give_up = (text: string) => this.answered({ id, done: false, text });
      const timer = setTimeout(() => give_up(`${service} did not answer within ${REPLY_MS / 1000} s.`), REPLY_MS);
      this.waiting.set(id, (reply) => {
        clearTimeout(timer);
        resolve(reply);
      });
      if (!this.send({ control: { id, service, command, argument, token: token.value } })) {
        give_up("There is no connection to the train.");
      }
    });
  }

  private answered(reply: Reply): void {
    this.waiting.get(reply.id)?.(reply);
    this.waiting.delete(reply.id);
  }

  private send(what: object): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(what));
    return true;
  }

  private connect(): void {
    const socket = new WebSocket(this.address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heard_ms = performance.now();
    socket.onopen = () => this.send({ watch: this.watched });
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket !== this.socket) return;
      this.heard_ms = performance.now();
      if (typeof event.data === "string") this.text(event.data);
      else void this.binary(event.data);
    };
    socket.onclose = () => {
      if (socket === this.socket) this.lost();
    };
  }

  private text(data: string): void {
    const message = JSON.parse(data) as Message;
    note_arrival(message, this.heard_ms);
    if (message.kind === "hello") {
      this.tries = 0;
      connection.value = { up: true, since_ms: Date.now(), ever: true };
      this.greeted();
    }
    if (message.kind === "reply") this.answered(message);
    else this.newest.put(message, this.heard_ms);
  }

  /// One picture at a time: while one is being decoded, those that come are skipped.
  private async binary(data: ArrayBuffer): Promise<void> {
    const picture = split_picture(data);
    if (picture === null || this.decoding) return;
    this.decoding = true;
    const [at_ms, waited_s] = [this.heard_ms, late_s.value];
    try {
      const image = await createImageBitmap(new Blob([picture.jpeg as BlobPart], { type: "image/jpeg" }));
      show_picture({ camera: picture.header.camera, stamp_ns: picture.header.stamp_ns, image }, at_ms, waited_s);
    } catch {
      // A picture that cannot be decoded is not shown, and the last one grows old.
    } finally {
      this.decoding = false;
    }
  }

  private check(): void {
    if (this.socket !== null && performance.now() - this.heard_ms > SILENCE_MS) this.lost();
  }

  private lost(): void {
    const socket = this.socket;
    this.socket = null;
    this.newest.drop();
    socket?.close();
    if (connection.value.up) connection.value = { up: false, since_ms: Date.now(), ever: true };
    for (const id of [...this.waiting.keys()]) this.answered({ id, done: false, text: "The connection to the train was lost." });
    const wait = RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)];
    setTimeout(() => this.connect(), wait);
  }
}
