import { beforeEach, describe, expect, it, vi } from "vitest";
import { age_of, connection, fresh, note_arrival, passed_ms, problems, state, take, tick } from "../src/store";
import { nothing } from "../src/stale";
import { verdict } from "../src/verdict";
import type { Message } from "../src/wire";

const said = () => verdict(problems.value !== null, fresh("state"), age_of("state"));
const hello = () => take({ kind: "hello", now_ns: Date.now() * 1e6 } as Message);
const well = () => take({ kind: "problems", problems: [] } as Message);
const position = (more: object) => {
  const message = { kind: "state", ...more } as Message;
  note_arrival(message, performance.now());
  take(message);
};
const later = (seconds: number) => (passed_ms.value = performance.now() + seconds * 1000);

describe("all is well", () => {
  beforeEach(() => {
    state.value = nothing();
    problems.value = null;
    connection.value = { up: true, since_ms: Date.now(), ever: true };
    tick();
    hello();
  });

  it("is said when the train is heard and nothing is wrong", () => {
    well();
    position({ edge: 1, age_s: 0.1 });
    expect(said()).toEqual({ level: "fine", text: "No problems known" });
  });
  it("is not said before the monitor has answered", () => expect(said().level).toBe("asking"));
  it("is not said before anything was heard of the train", () => {
    well();
    position({ age_s: null });
    expect(said().level).toBe("asking");
    expect(said().text).toMatch(/^No position of the train has been heard yet/);
  });
  it("is not said any more when the train falls silent", () => {
    well();
    position({ edge: 1, age_s: 0.1 });
    position({ edge: 1, age_s: 12 });
    expect(said()).toEqual({ level: "old", text: expect.stringMatching(/^Nothing has been heard of the train's position for 12\ss/) });
  });
  it("is not said of what has waited on a slow link", () => {
    well();
    position({ edge: 1, age_s: 0.1, sent_ns: 1e9 * 5 });
    position({ edge: 1, age_s: 0.1, sent_ns: 1e9 * 5 - 1e9 * 7 });
    expect(said()).toEqual({ level: "old", text: expect.stringMatching(/for 7\.[01]\ss/) });
  });
  it("is not said any more when the train falls silent and this browser's clock is set back", () => {
    well();
    position({ edge: 1, age_s: 0.1 });
    vi.spyOn(performance, "now").mockReturnValue(performance.now() + 3e3);
    vi.spyOn(Date, "now").mockReturnValue(Date.now() - 3.6e6);
    tick();
    vi.restoreAllMocks();
    expect(said().level).toBe("old");
  });
  it("is not said any more when nobody answers", () => {
    well();
    position({ edge: 1, age_s: 0.1 });
    later(3);
    expect(said().level).toBe("old");
    tick();
    connection.value = { up: false, since_ms: Date.now(), ever: true };
    expect(said().level).toBe("old");
  });
  it("is not said by what the monitor before knew", () => {
    well();
    position({ edge: 1, age_s: 0.1 });
    hello();
    expect(said().level).toBe("asking");
    well();
    later(40);
    position({ age_s: null });
    expect(state.value.value).not.toBeNull();
    expect(said().text).toMatch(/for 40\ss;/);
  });
});
