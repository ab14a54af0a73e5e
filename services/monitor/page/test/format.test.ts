import { describe, expect, it } from "vitest";
import { bend, bounds, bounds_in_words, bytes, bytes_per_s, clock, duration, hertz, kmh, metres, milliseconds, number, outward, played, probability } from "../src/format";

const plain = (text: string) => text.replace(/\u202f/g, " ").replace(/\u2212/g, "-");

describe("numbers", () => {
  it("rounds bounds outward", () => {
    expect(outward(12.49, 0)).toBe(13);
    expect(outward(0.301, 2)).toBeCloseTo(0.31);
    expect(outward(0.3, 2)).toBeCloseTo(0.3);
    expect(outward(null, 1)).toBe(0);
  });
  it("says how far behind and ahead in words and never less than it is", () => {
    expect(bounds(1.23, 4.51)).toEqual({ behind: "1.3", ahead: "4.6" });
    expect(bounds(0.301, 0.2)).toEqual({ behind: "0.31", ahead: "0.20" });
    expect(bounds(2, 12.01)).toEqual({ behind: "2", ahead: "13" });
    expect(plain(bounds_in_words(2, 12.01))).toBe("2 m behind and 13 m ahead");
    expect(plain(bounds_in_words(null, undefined))).toBe("unknown");
  });
  it("groups thousands from 10 000 on and says unknown for what is not known", () => {
    expect(plain(number(1234.56, 1))).toBe("1234.6");
    expect(plain(number(12345.6, 1))).toBe("12 345.6");
    expect(plain(number(-1234567, 0))).toBe("-1 234 567");
    for (const nothing of [null, undefined, NaN, Infinity]) expect(number(nothing, 1)).toBe("unknown");
  });
  it("has no negative zero", () => expect(number(-0.04, 1)).toBe("0.0"));
  it("gives lengths the digits they deserve", () => {
    expect([0.5, -9.994, 12.34, 999.94, 1000, 12345.6].map(metres).map(plain)).toEqual(["0.50 m", "-9.99 m", "12.3 m", "999.9 m", "1000 m", "12 346 m"]);
  });
  it("has a unit on everything", () => {
    expect(plain(milliseconds(2.04))).toBe("2.0 ms");
    expect(plain(milliseconds(123.4))).toBe("123 ms");
    expect(plain(hertz(59.94))).toBe("60 Hz");
    expect(plain(bytes(0))).toBe("0 B");
    expect(plain(bytes(1310))).toBe("1.3 kB");
    expect(plain(bytes(4.2e9))).toBe("4.2 GB");
    expect(plain(bytes_per_s(210000))).toBe("210 kB/s");
    expect(bytes_per_s(null)).toBe("unknown");
    expect(metres(null)).toBe("unknown");
  });
  it("keeps an unknown speed unknown", () => {
    expect(kmh(null)).toBeNull();
    expect(kmh(10)).toBe(36);
  });
});

describe("probability", () => {
  it("is never rounded up to certainty", () => {
    expect(plain(probability(0.99996))).toBe("> 99.99 %");
    expect(plain(probability(0.99989))).toBe("99.98 %");
    expect(plain(probability(0.64))).toBe("64.0 %");
    expect(plain(probability(0.0002))).toBe("< 0.1 %");
    expect(plain(probability(1))).toBe("100 %");
    expect(probability(null)).toBe("unknown");
  });
});

describe("times", () => {
  it("says durations in at most two units", () => {
    const said = [0, 0.031, 0.42, 9.94, 9.96, 59.4, 59.6, 125, 3600, 11520, 187200].map((s) => plain(duration(s)));
    expect(said).toEqual(["0.0 s", "31 ms", "0.4 s", "9.9 s", "10 s", "59 s", "1 min", "2 min 5 s", "1 h", "3 h 12 min", "2 d 4 h"]);
    expect(duration(Infinity)).toBe("unknown");
  });
  it("gives the date only when it is another day", () => {
    const now = new Date(2026, 10, 21, 12, 31, 4).getTime();
    expect(clock(now, now)).toBe("12:31:04");
    expect(clock(now - 86400000, now)).toBe("2026-11-20 12:31:04");
  });
  it("writes places in a recording", () => {
    expect([0, 59.96, 61.04, 3723.4].map(played)).toEqual(["0:00.0", "1:00.0", "1:01.0", "1:02:03.4"]);
  });
});

describe("bend", () => {
  it("says side and radius, and straight below what can be known", () => {
    expect(plain(bend(1 / 812))).toBe("left, radius 812.0 m");
    expect(plain(bend(-1 / 4000))).toBe("right, radius 4000 m");
    expect(bend(1 / 30000)).toBe("straight");
    expect(bend(1 / 4000, 1e-3)).toBe("straight");
    expect(bend(undefined)).toBe("unknown");
  });
});
