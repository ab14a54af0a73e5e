import { describe, expect, it } from "vitest";
import { unfold } from "../src/etcs";

// Values as `railfix tpr decode` prints them for the same message (docs/figures.md, "ETCS check vector").
const HEX = "880601D6F345402AF34000E48F68EB84D250014010C38830";
const HEX4 = "880601D6F345402AF34000E68F68EB84D250014010C38818";  // the same in baseline 4
const VALUES = {
  NID_MESSAGE: 136, L_MESSAGE: 24, T_TRAIN: 123456789, NID_ENGINE: 43981, NID_PACKET: 0, L_PACKET: 114, Q_SCALE: 1, NID_LRBG: 2019799, D_LRBG: 1234,
  Q_DIRLRBG: 1, Q_DLRBG: 1, L_DOUBTOVER: 10, L_DOUBTUNDER: 67, Q_LENGTH: 0, V_TRAIN: 28, Q_DIRTRAIN: 1, M_MODE: 0, M_LEVEL: 3,
};

describe("message 136", () => {
  it("is unfolded as the decoder does it", () => {
    const { fields, problem } = unfold(HEX, 3);
    expect(problem).toBe("");
    expect(Object.fromEntries(fields.map((one) => [one.name, one.value]))).toEqual(VALUES);
    const meaning = Object.fromEntries(fields.map((one) => [one.name, one.meaning]));
    expect(meaning.NID_LRBG).toBe("country/region 123, balise group 4567");
    expect(meaning.V_TRAIN).toBe("140 km/h");
    expect(meaning.L_DOUBTUNDER).toBe("67 m ahead of it");
    expect(meaning.M_LEVEL).toBe("level 2");
  });
  it("has a longer M_MODE in baseline 4", () => {
    const fields = unfold(HEX + "00", 4).fields;
    expect(fields.find((one) => one.name === "M_MODE")?.bits).toBe(5);
    expect(fields.some((one) => one.name === "Q_INTEGRITY")).toBe(true);
  });
  it("names the levels as each baseline does", () => {
    const level = (hex: string, baseline: number) => unfold(hex, baseline).fields.find((one) => one.name === "M_LEVEL");
    expect(level(HEX4, 4)).toMatchObject({ value: 3, meaning: "level 2" });
    expect(level(HEX4.slice(0, -2) + "20", 4)).toMatchObject({ value: 4, meaning: "spare" });
    expect(level(HEX.slice(0, -2) + "40", 3)).toMatchObject({ value: 4, meaning: "level 3" });
  });
  it("says where a message ends too early, with what could be read", () => {
    const { fields, problem } = unfold(HEX.slice(0, 20), 3);
    expect(problem).toContain("ends at bit 80");
    expect(fields.map((one) => one.name)).toContain("NID_ENGINE");
  });
  it("refuses what is no hexadecimal", () => expect(unfold("88XX", 3).problem).toContain("hexadecimal"));
});
