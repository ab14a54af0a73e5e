import { describe, expect, it } from "vitest";
import { is_sure, place_level, track_note } from "../src/track_note";

const other = { edge: 2, offset_m: 300, probability: 0.41 };
const note = (track_known: boolean, track_probability: number, alternatives: (typeof other)[]) =>
  track_note({ track_known, track_probability, alternatives }, (edge) => `edge ${edge}`).replaceAll("\u202f", " ");

describe("the note on the track", () => {
  it("calls no other possible only where the track is certain", () => {
    expect(note(true, 0.9995, [])).toBe("certain, 99.95 %; no other possible");
    expect(note(true, 0.5, [])).toBe("not certain, 50.0 %; another is possible");
  });
  it("names the others that are known", () => expect(note(true, 0.55, [other])).toBe("not certain, 55.0 %; or edge 2 41.0 %"));
  it("has no place where none was found", () => {
    expect(note(false, 0, [])).toBe("no place found");
    expect(note(false, 0, [other])).toBe("edge 2 41.0 %");
  });
  it("is not sure of a track that is not known", () => {
    const likely = { track_known: false, track_probability: 1, alternatives: [] };
    expect(is_sure(likely)).toBe(false);
    expect(is_sure({ ...likely, track_known: true })).toBe(true);
  });
});

describe("the figures of the place", () => {
  it("are bad where the position must not be used", () => {
    expect(place_level({ integrity: "unusable" }, true)).toBe("bad");
    expect(place_level({ integrity: "unusable" }, false)).toBe("bad");
    expect(place_level({ integrity: "degraded" }, false)).toBe("warn");
    expect(place_level({ integrity: "ok" }, true)).toBe("");
  });
});
