import { describe, expect, it, vi } from "vitest";
import { draw_strip, strip_in_words } from "../src/draw/strip";
import { TrackMap } from "../src/track_map";
import type { TrainState } from "../src/wire";

vi.stubGlobal("window", { devicePixelRatio: 1 });
vi.stubGlobal("document", { documentElement: { dataset: {} } });
vi.stubGlobal("getComputedStyle", () => ({ fontFamily: "x", getPropertyValue: () => "" }));

/// What is drawn on a sheet of 800 pixels.
function drawn(state: Partial<TrainState>) {
  const seen = { widths: [] as number[], fills: 0, strokes: 0 };
  const known: Record<string, unknown> = {
    fillRect: (_x: number, _y: number, width: number) => seen.widths.push(width),
    fill: () => ++seen.fills,
    stroke: () => ++seen.strokes,
    measureText: () => ({ width: 10 }),
  };
  const context = new Proxy(known, { get: (target, name) => target[String(name)] ?? (() => undefined), set: () => true });
  const canvas = { clientWidth: 800, clientHeight: 80, width: 0, height: 0, getContext: () => context } as unknown as HTMLCanvasElement;
  draw_strip(canvas, new TrackMap({ edges: [], switches: [], landmarks: [] }), { edge: 1, offset_m: 0, direction: "forward", ...state } as TrainState, true);
  return seen;
}

describe("the strip", () => {
  it("has the interval to scale and the train in it", () => {
    const { widths, fills } = drawn({ over_m: 12, under_m: 12 });
    expect(widths[0]).toBeGreaterThan(50);
    expect(fills).toBe(1);
  });
  it("shows no place where no bound is known", () => {
    const bounded = drawn({ over_m: 12, under_m: 12 });
    for (const state of [{ over_m: null, under_m: null }, { over_m: 3, under_m: null }]) {
      const seen = drawn(state);
      expect(seen.widths).toEqual([]);
      expect(seen.fills).toBe(0);
      expect(seen.strokes).toBeGreaterThan(bounded.strokes + 50); // hatched from end to end
      expect(strip_in_words(state as TrainState)).toMatch(/no bound/);
    }
  });
});
