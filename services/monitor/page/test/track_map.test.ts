import { describe, expect, it } from "vitest";
import { TrackMap } from "../src/track_map";
import type { LinePoint, MapData } from "../src/wire";

// East for 100 m, then a joint, then straight on for 50 m (edge 2) or back in a sharp angle (edge 3, no way for a train).
const straight = (from: [number, number], to: [number, number], length: number): LinePoint[] =>
  Array.from({ length: 11 }, (_, i) => [(i * length) / 10, from[0] + ((to[0] - from[0]) * i) / 10, from[1] + ((to[1] - from[1]) * i) / 10, null, 0]);
const DATA: MapData = {
  edges: [
    { id: 1, name: "main", length_m: 100, line: straight([0, 0], [100, 0], 100) },
    { id: 2, length_m: 50, line: straight([150, 0], [100, 0], 50) },
    { id: 3, length_m: 50, line: straight([100, 0], [60, 30], 50) },
  ],
  switches: [],
  landmarks: [],
};
const map = new TrackMap(DATA);
const length = (line: [number, number][]) =>
  line.slice(1).reduce((sum, [e, n], i) => sum + Math.hypot(e - (line[i] as [number, number])[0], n - (line[i] as [number, number])[1]), 0);

describe("places", () => {
  it("lie between the points of the line", () => {
    expect(map.at({ edge: 1, offset_m: 34 })).toEqual([34, 0]);
    expect(map.at({ edge: 2, offset_m: 10 })?.[0]).toBeCloseTo(140);
  });
  it("stay on the edge and are nothing without one", () => {
    expect(map.at({ edge: 1, offset_m: 500 })).toEqual([100, 0]);
    expect(map.at({ edge: 1, offset_m: -5 })).toEqual([0, 0]);
    expect(map.at({ edge: 9, offset_m: 0 })).toBeNull();
  });
  it("have names", () => expect([map.name(1), map.name(2)]).toEqual(["main", "edge 2"]));
});

describe("stretches", () => {
  it("are as long as the interval", () => {
    const [piece, ...rest] = map.stretch({ edge: 1, offset_m: 50 }, 8, 13);
    expect(rest).toEqual([]);
    expect(length(piece as [number, number][])).toBeCloseTo(21);
  });
  it("go over a joint, whichever way the next edge counts, but not round a sharp corner", () => {
    const pieces = map.stretch({ edge: 1, offset_m: 90 }, 5, 30);
    expect(pieces.map(length)).toEqual([expect.closeTo(15), expect.closeTo(20)]);
    expect(Math.max(...pieces.flat().map((point) => point[0]))).toBeCloseTo(120);
  });
  it("end where the track ends", () => expect(map.stretch({ edge: 1, offset_m: 5 }, 50, 0).map(length)).toEqual([expect.closeTo(5)]));
});

describe("many short edges", () => {
  const EDGE_M = 60;
  const edges = Array.from({ length: 20 }, (_, i) => ({ id: i + 1, length_m: EDGE_M, line: straight([i * EDGE_M, 0], [(i + 1) * EDGE_M, 0], EDGE_M) }));
  const balise = (id: number, edge: number, offset_m: number) => ({ id, edge, offset_m, kind: "balise", name: `B${id}`, easting_m: 0, northing_m: 0, across_m: 0 });
  const data = { edges, switches: [], landmarks: [balise(1, 10, 30), balise(2, 12, 10), balise(3, 8, 50)] };
  const chain = new TrackMap(data);
  const place = { edge: 10, offset_m: 55 };

  it("do not shorten the interval", () => {
    const whole = chain.stretch(place, 400, 400).map(length).reduce((sum, one) => sum + one, 0);
    expect(whole).toBeCloseTo(800);
  });
  it("are each drawn once, as far as the shortest way reaches, where two ways meet again", () => {
    const loop = { id: 99, length_m: 90, line: straight([10 * EDGE_M, 0], [11 * EDGE_M, 0], 90) };
    const doubled = new TrackMap({ ...data, edges: [...edges, loop] });
    const [once, twice] = [chain, doubled].map((one) => one.stretch(place, 0, 400).map(length));
    expect(twice?.length).toBe((once?.length ?? 0) + 1);
    expect(twice?.reduce((sum, one) => sum + one, 0)).toBeCloseTo(400 + EDGE_M);
  });
  it("have the landmarks behind their joints", () => {
    expect(chain.near(place, 100).map(({ one, along_m }) => [one.name, Math.round(along_m)])).toEqual([["B1", -25], ["B2", 75]]);
    expect(chain.near(place, 140).map(({ one }) => one.name)).toEqual(["B3", "B1", "B2"]);
  });
  it("have none behind a switch, where the way is not known", () => {
    const leg = { id: 98, length_m: EDGE_M, line: straight([10 * EDGE_M, 0], [11 * EDGE_M, 5], EDGE_M) };
    const branched = new TrackMap({ ...data, edges: [...edges, leg] });
    expect(branched.near(place, 140).map(({ one }) => one.name)).toEqual(["B3", "B1"]);
  });
});

it("finds its box", () => expect(map.box()).toEqual({ west: 0, south: 0, east: 150, north: 30 }));
