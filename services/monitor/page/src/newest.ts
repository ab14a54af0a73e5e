// What a browser that is too slow leaves out: of each kind whose newest message says all, only that one is taken when the page is
// drawn next.
import type { Message } from "./wire";

const NEWEST: ReadonlySet<Message["kind"]> = new Set(["state", "curvature", "services", "topics", "recorder", "player"] as const);

export class Newest {
  private waiting = new Map<Message["kind"], { message: Message; at_ms: number }>();
  private asked = false;

  /// `draw_next` calls back before the page is drawn.
  constructor(
    private readonly take: (message: Message, at_ms: number) => void,
    private readonly draw_next: (callback: () => void) => void,
  ) {}

  put(message: Message, at_ms: number): void {
    if (!NEWEST.has(message.kind)) {
      this.take(message, at_ms);
      return;
    }
    this.waiting.set(message.kind, { message, at_ms });
    if (this.asked) return;
    this.asked = true;
    this.draw_next(() => this.take_all());
  }

  /// What waits is of a connection that is gone.
  drop(): void {
    this.waiting.clear();
  }

  private take_all(): void {
    this.asked = false;
    const all = [...this.waiting.values()];
    this.waiting.clear();
    for (const { message, at_ms } of all) this.take(message, at_ms);
  }
}
