import { beforeEach, describe, expect, it, vi } from "vitest";
import { Newest } from "../src/newest";
import { all_problems } from "../src/panels/problems";
import { about, age_of, clock_offset_ms, connection, curvature, fresh, late_s, log, note_arrival, picture, problems, reports, show_picture, state, take, tick } from "../src/store";
import { nothing } from "../src/stale";
import type { About, Message } from "../src/wire";

vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined });
const now_ns = () => Date.now() * 1e6;
const sent_ns = () => performance.now() * 1e6;
const say = (message: object) => {
  note_arrival(message as Message, performance.now());
  take(message as Message);
};
const hello = (train = "a") => say({ kind: "hello", train, now_ns: now_ns() });
const beat = (late: number, more: object = {}) => say({ kind: "beat", sent_ns: sent_ns() - late * 1e9, now_ns: now_ns() - late * 1e9, cameras: ["cam0"], ...more });
const image = () => ({ close: () => undefined }) as ImageBitmap;

beforeEach(() => {
  connection.value = { up: true, since_ms: Date.now(), ever: true };
  hello();
  beat(0);
  tick();
});

describe("a slow link", () => {
  it("makes all that comes over it as old as it is", () => {
    beat(7);
    say({ kind: "curvature", edge: 1, offset_m: 0, measured: [], map: [] });
    expect(age_of("curvature", performance.now())).toBeCloseTo(7, 1);
    expect(fresh("curvature", performance.now())).toBe("stale");
    show_picture({ camera: "cam0", stamp_ns: 1, image: image() }, performance.now(), late_s.value);
    expect(fresh("picture", performance.now())).toBe("stale");
  });
  it("is named on top, with the age of what is shown", () => {
    expect(all_problems()).toEqual([]);
    beat(7);
    expect(all_problems()[0]?.what).toMatch(/^What is shown is 7\.\d\ss old: the link to the train or this browser is slow/);
    beat(0);
    expect(all_problems()).toEqual([]);
  });
});

describe("a picture", () => {
  it("grows old when those that follow cannot be decoded, whatever is said of them", () => {
    show_picture({ camera: "cam0", stamp_ns: 1, image: image() }, performance.now() - 9000, 0);
    say({ kind: "view", camera: "cam0", stamp_ns: 2, landmarks: [], health: [], seen: true, rails: null, why: null, width: 1, height: 1 });
    expect(age_of("picture", performance.now())).toBeCloseTo(9, 1);
    expect(fresh("picture", performance.now())).toBe("stale");
  });
});

describe("another train on the same address", () => {
  it("is not shown with what the one before said", () => {
    say({ kind: "state", edge: 1, age_s: 0.1, sent_ns: sent_ns() });
    say({ kind: "report", stamp_ns: 1, sent_ns: 1, seq: 1 });
    say({ kind: "log", records: [{ stamp_ns: 1, service: "fusion", host: "cab", level: "info", text: "x" }] });
    show_picture({ camera: "cam0", stamp_ns: 1, image: image() }, performance.now(), 0);
    about.value = { train: "a", cameras: [] } as unknown as About;
    hello("a");
    expect(state.value.value).not.toBeNull();
    hello("b");
    for (const one of [state, picture, curvature]) expect(one.value).toEqual(nothing());
    expect([reports.value, log.value, about.value]).toEqual([[], [], null]);
  });
});

describe("a clock that is set", () => {
  it("moves no problem's beginning", () => {
    const hour_ns = 3600e9;
    say({ kind: "problems", now_ns: now_ns() + hour_ns, problems: [{ id: "a", level: "error", what: "a", what_to_do: "", since_ns: now_ns() + hour_ns - 17e9 }] });
    expect((Date.now() - (problems.value?.[0]?.since_ns ?? 0) / 1e6) / 1000).toBeCloseTo(17, 0);
  });
  it("is followed while the page is open", () => {
    beat(0, { now_ns: now_ns() + 3600e9 });
    expect(clock_offset_ms.value / 1000).toBeCloseTo(-3600, 0);
  });
});

it("a camera that comes later is known", () => {
  about.value = { train: "a", cameras: ["cam0"] } as unknown as About;
  beat(0, { cameras: ["cam1"] });
  expect(about.value?.cameras).toEqual(["cam1"]);
});

describe("a slow browser", () => {
  const taken: Message[] = [];
  const drawn: (() => void)[] = [];
  const newest = new Newest((message) => taken.push(message), (callback) => drawn.push(callback));
  const put = (message: object) => newest.put(message as Message, 0);
  beforeEach(() => {
    taken.length = 0;
    drawn.length = 0;
  });

  it("takes the newest state only, and every report", () => {
    for (let edge = 1; edge <= 5; ++edge) put({ kind: "state", edge });
    for (let seq = 1; seq <= 3; ++seq) put({ kind: "report", seq });
    expect(taken.map((one) => one.kind)).toEqual(["report", "report", "report"]);
    expect(drawn.length).toBe(1);
    drawn[0]?.();
    expect(taken[3]).toEqual({ kind: "state", edge: 5 });
    put({ kind: "state", edge: 6 });
    drawn[1]?.();
    expect(taken[4]).toEqual({ kind: "state", edge: 6 });
  });
  it("takes nothing of a connection that is gone", () => {
    put({ kind: "state", edge: 1 });
    newest.drop();
    drawn[0]?.();
    expect(taken).toEqual([]);
  });
});
