// How services are judged and ordered.
import type { Service } from "./wire";

const WORST = ["dead", "failed", "degraded", "stopped", "starting", "ready", "active"];

/// What stands in the table: a silent service is dead, whatever it said last, unless it said that it stops.
export const state_of = (one: Service) => (one.alive || one.state === "stopped" ? one.state : "dead");

export function level_of(state: string): "ok" | "warn" | "bad" {
  if (state === "active" || state === "ready") return "ok";
  return state === "dead" || state === "failed" || state === "stopped" ? "bad" : "warn";
}

/// The worst first, the well ones by name.
export function by_need(list: readonly Service[]): Service[] {
  const rank = (one: Service) => (level_of(state_of(one)) === "ok" ? WORST.length : WORST.indexOf(state_of(one)));
  return [...list].sort((a, b) => rank(a) - rank(b) || a.service.localeCompare(b.service) || a.host.localeCompare(b.host));
}
