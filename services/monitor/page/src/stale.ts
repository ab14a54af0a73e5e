// How old a value may be before it is shown as old.

export interface Held<T> {
  value: T | null;
  at_ms: number; // when it came, by performance.now()
  late_s?: number; // how long it had waited on the way
}

export const nothing = <T>(): Held<T> => ({ value: null, at_ms: 0 });

/// Seconds after which a value of this kind is no longer live; the server's own rate leaves two or three in that time.
export const FRESH_S = { state: 1.5, curvature: 1.5, picture: 1.5, services: 2, topics: 3.5, recorder: 3.5, player: 1.5 } as const;

/// What waits longer on the way than that is not shown as live, and the link or this browser is named.
export const LATE_S = 1.5;

/// Seconds since the train made the value: what the server said plus what passed on the way and here. Infinite when there is none.
export function age_s<T>(held: Held<T>, passed_ms: number, age_at_arrival_s = 0): number {
  if (held.value === null) return Infinity;
  return Math.max(0, (passed_ms - held.at_ms) / 1000) + Math.max(0, age_at_arrival_s) + (held.late_s ?? 0);
}

/// How much later than the quickest message of a connection another one came: so long it has waited on the way. The two
/// clocks, which nobody sets, may drift apart by a millisecond a second.
export class LinkDelay {
  private quickest_ms = Infinity;
  private at_ms = 0;
  reset(): void {
    this.quickest_ms = Infinity;
  }
  late_s(sent_ms: number, arrived_ms: number): number {
    const took_ms = arrived_ms - sent_ms;
    this.quickest_ms = Math.min(took_ms, this.quickest_ms + (arrived_ms - this.at_ms) * 1e-3);
    this.at_ms = arrived_ms;
    return (took_ms - this.quickest_ms) / 1000;
  }
}

export type Freshness = "live" | "stale" | "none";

export function freshness(age: number, limit_s: number, connected: boolean): Freshness {
  if (!Number.isFinite(age)) return "none";
  return connected && age <= limit_s ? "live" : "stale";
}

/// Newest `limit` of both, the newer ones last, nothing twice: a new subscription repeats what is known. What comes last is
/// the newest, unless `time` tells.
export function appended<T>(old: readonly T[], more: readonly T[], limit: number, key: (item: T) => string, time?: (item: T) => number): T[] {
  const known = new Set(old.map(key));
  const all = old.concat(more.filter((item) => !known.has(key(item)) && known.add(key(item))));
  if (time) all.sort((one, other) => time(one) - time(other));
  return all.length > limit ? all.slice(all.length - limit) : all;
}
