import { describe, expect, it } from "vitest";
import { range_of, round_ticks } from "../src/draw/plot";
import { reach_m } from "../src/draw/strip";
import { by_need, state_of } from "../src/health";
import { filtered } from "../src/log_filter";
import { at_train, misfit } from "../src/misfit";
import { type LogRecord, type Service, split_picture } from "../src/wire";

const service = (name: string, state: string, alive = true) => ({ service: name, host: "cab", state, alive }) as Service;

describe("health", () => {
  it("calls a silent service dead, but not one that stopped", () => {
    expect(state_of(service("a", "active", false))).toBe("dead");
    expect(state_of(service("a", "stopped", false))).toBe("stopped");
  });
  it("puts the worst first", () => {
    const list = [service("b", "active"), service("c", "degraded"), service("a", "ready"), service("d", "active", false)];
    expect(by_need(list).map((one) => one.service)).toEqual(["d", "c", "a", "b"]);
  });
});

describe("log filter", () => {
  const record = (name: string, level: LogRecord["level"], text: string): LogRecord => ({ stamp_ns: 0, service: name, host: "cab", level, text });
  const records = [record("fusion", "info", "Reference is now 12."), record("fusion", "error", "No map."), record("odometry", "debug", "Tracking")];
  it("goes by service, level and text", () => {
    expect(filtered(records, { service: "", least: "trace", text: "" }).length).toBe(3);
    expect(filtered(records, { service: "fusion", least: "warning", text: "" })).toEqual([records[1]]);
    expect(filtered(records, { service: "", least: "trace", text: "  TRACK " })).toEqual([records[2]]);
  });
});

describe("curvature", () => {
  it("finds the place where both are farthest apart", () => {
    const worst = misfit({ measured: [[-10, 0.001, 0.001], [0, 0.004, 0.001], [10, 0.009, 0.0]], map: [[-10, 0.001], [0, 0.001], [10, 0]] });
    expect(worst).toEqual({ sigmas: expect.closeTo(3), ahead_m: 0 });
    expect(misfit({ measured: [[0, 1, 1]], map: [] })).toBeNull();
  });
  it("takes what is nearest to the train", () => expect(at_train([[-3, 1], [2, 5], [9, 7]])).toEqual([2, 5]));
  it("takes nothing that is far from it", () => expect(at_train([[-300, 1], [40, 5]])).toBeUndefined());
});

describe("plots", () => {
  it("have room for all values and a least height", () => {
    expect(range_of([0, 80], 20, true)).toEqual({ from: 0, to: 84.8 });
    const flat = range_of([5, null, 5], 2, false);
    expect(flat.to - flat.from).toBeGreaterThanOrEqual(2);
    expect(range_of([null], 3, false)).toEqual({ from: 0, to: 3 });
  });
  it("have round ticks", () => expect(round_ticks(-90, 30, 3)).toEqual([-80, -60, -40, -20, 0, 20]));
  it("show the interval as at most a third of the strip", () => {
    for (const half of [0.1, 3, 20, 77, 400]) expect(reach_m(half, half / 2)).toBeGreaterThanOrEqual(3 * half);
  });
});

describe("picture frames", () => {
  const frame = (header: string, rest: number[]) => {
    const text = new TextEncoder().encode(header);
    const bytes = new Uint8Array(4 + text.length + rest.length);
    new DataView(bytes.buffer).setUint32(0, text.length, true);
    bytes.set(text, 4);
    bytes.set(rest, 4 + text.length);
    return bytes.buffer;
  };
  it("are split into header and JPEG", () => {
    const split = split_picture(frame('{"kind":"picture","camera":"cam0","stamp_ns":5}', [255, 216]));
    expect(split?.header.camera).toBe("cam0");
    expect([...(split?.jpeg ?? [])]).toEqual([255, 216]);
  });
  it("are refused when they are something else", () => {
    for (const bad of [new ArrayBuffer(2), frame("{", []), frame('{"kind":"other"}', []), new Uint8Array([255, 255, 0, 0, 1]).buffer]) expect(split_picture(bad)).toBeNull();
  });
});
