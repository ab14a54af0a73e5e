// How well the measured curvature agrees with the map's.
import type { Curvature } from "./wire";

const BESIDE_M = 0.51; // points of both curves nearer than that are compared

const AT_TRAIN_M = 10; // what lies further away is not the train's

export const at_train = <T extends readonly [number, number, ...number[]]>(points: readonly T[]) =>
  points
    .filter((one) => Math.abs(one[0]) < AT_TRAIN_M)
    .reduce<T | undefined>((best, one) => (best === undefined || Math.abs(one[0]) < Math.abs(best[0]) ? one : best), undefined);

/// The largest distance between both in sigmas; null where never both are known.
export function misfit(one: Pick<Curvature, "measured" | "map">): { sigmas: number; ahead_m: number } | null {
  let worst: { sigmas: number; ahead_m: number } | null = null;
  for (const [ahead_m, per_m, sigma] of one.measured) {
    const beside = one.map.find(([ahead]) => Math.abs(ahead - ahead_m) < BESIDE_M);
    if (beside === undefined || sigma <= 0) continue;
    const sigmas = Math.abs(per_m - beside[1]) / sigma;
    if (worst === null || sigmas > worst.sigmas) worst = { sigmas, ahead_m };
  }
  return worst;
}
