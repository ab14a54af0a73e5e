// Message 136 unfolded for people: the fields of packets 0 and 1 in the order of SUBSET-026 chapters 7 and 8, issues 3.x and 4.0.0.
// It explains what was sent; checking it is the business of `railfix tpr decode`.

export interface Unfolded {
  name: string;
  bits: number;
  value: number;
  meaning: string;
}

const UNKNOWN_DISTANCE = 32767;
const STEP_M = [0.1, 1, 10];
const SIDE = ["reverse", "nominal", "unknown"];
const MODES = ["full supervision", "on-sight", "staff responsible", "shunting", "unfitted", "sleeping", "stand by", "trip", "post trip",
  "system failure", "isolation", "non leading", "limited supervision", "national system", "reversing", "passive shunting",
  "automatic driving", "supervised manoeuvre"];
const LEVELS = ["level 0", "level NTC", "level 1", "level 2"];
const INTEGRITY = ["no information", "confirmed by a device", "confirmed by the driver", "lost"];

class Bits {
  private at = 0;
  constructor(private readonly bytes: number[]) {}
  read(count: number): number {
    let value = 0;
    for (let i = 0; i < count; ++i, ++this.at) {
      const byte = this.bytes[this.at >> 3];
      if (byte === undefined) throw new Error(`the message ends at bit ${this.at}`);
      value = value * 2 + ((byte >> (7 - (this.at & 7))) & 1);
    }
    return value;
  }
}

function bytes_of(hex: string): number[] {
  const digits = hex.replace(/\s+/g, "");
  if (digits.length % 2 !== 0 || /[^0-9a-fA-F]/.test(digits)) throw new Error("not hexadecimal digits in pairs");
  return (digits.match(/../g) ?? []).map((pair) => parseInt(pair, 16));
}

const group = (value: number) =>
  value === 16777215 ? "unknown" : `country/region ${value >> 14}, balise group ${value & 16383}`;

function speed(value: number): string {
  if (value === 127) return "standing still";
  return value > 120 ? "spare" : `${value * 5} km/h`;
}

/// The fields, or the reason why it cannot be read (in `problem`) with those before it.
export function unfold(hex: string, baseline: number): { fields: Unfolded[]; problem: string } {
  const fields: Unfolded[] = [];
  try {
    const bits = new Bits(bytes_of(hex));
    const field = (name: string, count: number, meaning: (value: number) => string = () => "") => {
      const value = bits.read(count);
      fields.push({ name, bits: count, value, meaning: meaning(value) });
      return value;
    };
    field("NID_MESSAGE", 8, (v) => (v === 136 ? "train position report" : "another message"));
    field("L_MESSAGE", 10, () => "bytes");
    field("T_TRAIN", 32, (v) => (v === 4294967295 ? "unknown" : `${(v / 100).toFixed(2)} s`));
    field("NID_ENGINE", 24);
    position(field, baseline);
    return { fields, problem: "" };
  } catch (error) {
    return { fields, problem: (error as Error).message };
  }
}

type Take = (name: string, count: number, meaning?: (value: number) => string) => number;

function position(field: Take, baseline: number): void {
  const packet = field("NID_PACKET", 8, (v) => (v <= 1 ? "position report" : "another packet"));
  if (packet > 1) return;
  field("L_PACKET", 13, () => "bits");
  const step = STEP_M[field("Q_SCALE", 2, (v) => (v > 2 ? "spare" : `${STEP_M[v]} m a step`))] ?? NaN;
  const distance = (what: string) => (v: number) =>
    v === UNKNOWN_DISTANCE ? "unknown" : `${(v * step).toFixed(step < 1 ? 1 : 0)} m ${what}`;
  const side = (v: number) => SIDE[v] ?? "spare";
  field("NID_LRBG", 24, group);
  if (packet === 1) field("NID_PRVLRBG", 24, group);
  field("D_LRBG", 15, distance("from the group to the estimated front end"));
  field("Q_DIRLRBG", 2, side);
  field("Q_DLRBG", 2, side);
  field("L_DOUBTOVER", 15, distance("behind the estimate"));
  field("L_DOUBTUNDER", 15, distance("ahead of it"));
  const integrity = field(baseline >= 4 ? "Q_INTEGRITY" : "Q_LENGTH", 2, (v) => INTEGRITY[v] ?? "");
  if (integrity === 1 || integrity === 2) field("L_TRAININT", 15, (v) => (v === UNKNOWN_DISTANCE ? "unknown" : `${v} m`));
  field("V_TRAIN", 7, speed);
  field("Q_DIRTRAIN", 2, side);
  field("M_MODE", baseline >= 4 ? 5 : 4, (v) => MODES[v] ?? "");
  const level = field("M_LEVEL", 3, (v) => LEVELS[v] ?? (v === 4 && baseline < 4 ? "level 3" : "spare"));
  if (level === 1) field("NID_NTC", 8);
}
