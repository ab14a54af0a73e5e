// What is said when no problem is known: that all is well only while the train is heard, for silence is no good news.
import { duration } from "./format";
import type { Freshness } from "./stale";

export interface Verdict {
  level: "fine" | "old" | "asking";
  text: string;
}

/// `asked`: the monitor has said what it knows; `position` and its age: of what it says of the train.
export function verdict(asked: boolean, position: Freshness, age: number): Verdict {
  if (!asked) return { level: "asking", text: "Asking the train …" };
  if (position === "none") return { level: "asking", text: "No position of the train has been heard yet; nothing else is known to be wrong" };
  if (position === "stale") return { level: "old", text: `Nothing has been heard of the train's position for ${duration(age)}; nothing else is known to be wrong` };
  return { level: "fine", text: "No problems known" };
}
