// How sure the track is, and which others it may be.
import { probability } from "./format";
import type { TrainState } from "./wire";

type Choice = Pick<TrainState, "track_known" | "track_probability" | "alternatives">;

export const is_sure = (one: Choice) => one.track_known && (one.track_probability ?? 0) >= 0.999;

/// Of the figures that say where the train is: what must not be used does not look as if it could be.
export function place_level(one: Pick<TrainState, "integrity">, known: boolean): "" | "warn" | "bad" {
  if (one.integrity === "unusable") return "bad";
  return known ? "" : "warn";
}

/// Which others there are only the matcher says, and it may be silent while fusion still doubts.
export function track_note(one: Choice, name: (edge: number) => string): string {
  const others = one.alternatives.map((other) => `${name(other.edge)} ${probability(other.probability)}`).join(", ");
  if (!one.track_known) return others || "no place found";
  const unnamed = is_sure(one) ? "no other possible" : "another is possible";
  return `${is_sure(one) ? "certain" : "not certain"}, ${probability(one.track_probability)}; ${others ? `or ${others}` : unnamed}`;
}
