import { describe, expect, it } from "vitest";
import { age_s, appended, freshness, LinkDelay, nothing } from "../src/stale";

describe("age", () => {
  it("is what the server said plus what passed here", () => {
    expect(age_s({ value: 1, at_ms: 1000 }, 3500)).toBe(2.5);
    expect(age_s({ value: 1, at_ms: 1000 }, 3500, 4)).toBe(6.5);
  });
  it("does not become negative when a clock is set back", () => expect(age_s({ value: 1, at_ms: 9000 }, 3500)).toBe(0));
  it("is infinite for what never came", () => expect(age_s(nothing(), 3500)).toBe(Infinity));
});

describe("the link", () => {
  it("is late by what a message took longer than the quickest", () => {
    const link = new LinkDelay();
    expect(link.late_s(5000, 1040)).toBe(0);
    expect(link.late_s(5100, 1120)).toBe(0);
    expect(link.late_s(5200, 3220)).toBeCloseTo(2, 2);
    expect(link.late_s(5300, 3320)).toBeCloseTo(2, 2);
    link.reset();
    expect(link.late_s(9000, 100)).toBe(0);
  });
  it("bears clocks that drift apart", () => {
    const link = new LinkDelay();
    for (let s = 0; s < 36000; ++s) expect(link.late_s(1000 * s, 1000.2 * s)).toBeLessThan(0.01);
  });
});

describe("freshness", () => {
  it("is live only while connected and young enough", () => {
    expect(freshness(0.5, 1.5, true)).toBe("live");
    expect(freshness(1.6, 1.5, true)).toBe("stale");
    expect(freshness(0.0, 1.5, false)).toBe("stale");
    expect(freshness(Infinity, 1.5, true)).toBe("none");
  });
});

describe("bounded lists", () => {
  const key = (n: number) => String(n);
  it("keep the newest", () => expect(appended([1, 2, 3], [4, 5], 3, key)).toEqual([3, 4, 5]));
  it("hold nothing twice when a subscription repeats itself", () => expect(appended([1, 2, 3], [2, 3, 4, 4], 10, key)).toEqual([1, 2, 3, 4]));
  it("stand by their time where they have one", () => expect(appended([2, 5], [3, 9, 1], 4, key, (one) => one)).toEqual([2, 3, 5, 9]));
  it("do not grow", () => {
    let list: number[] = [];
    for (let i = 0; i < 10000; ++i) list = appended(list, [i], 500, key);
    expect(list.length).toBe(500);
    expect(list[499]).toBe(9999);
  });
});
