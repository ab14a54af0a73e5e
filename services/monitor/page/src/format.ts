// Numbers as people read them: unit always there, thin spaces between thousands, "unknown" for what is not known.

const THIN = "\u202f";
const MINUS = "\u2212";

export function number(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "unknown";
  const text = Math.abs(value).toFixed(digits);
  const [whole, rest] = text.split(".") as [string, string | undefined];
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, THIN) : whole;
  const sign = value < 0 && Number(text) !== 0 ? MINUS : "";
  return sign + grouped + (rest === undefined ? "" : "." + rest);
}

/// A bound that is shown with so many digits must not be less than it is.
export function outward(value: number | null | undefined, digits: number): number {
  const parts = 10 ** digits;
  return Math.max(0, Math.ceil((value ?? 0) * parts - 1e-6)) / parts;
}

/// How far behind and ahead the train may be at most, with the digits that the wider bound deserves.
export function bounds(over_m: number | null, under_m: number | null): { behind: string; ahead: string } {
  const widest = Math.max(over_m ?? 0, under_m ?? 0);
  const digits = widest < 0.995 ? 2 : widest < 9.95 ? 1 : 0;
  const said = (bound: number | null) => number(outward(bound, digits), digits);
  return { behind: said(over_m), ahead: said(under_m) };
}

/// The same as one sentence's part.
export function bounds_in_words(over_m: number | null | undefined, under_m: number | null | undefined): string {
  if (typeof over_m !== "number" || typeof under_m !== "number") return "unknown";
  const { behind, ahead } = bounds(over_m, under_m);
  return `${behind}${THIN}m behind and ${ahead}${THIN}m ahead`;
}

function with_unit(value: number | null | undefined, digits: number, unit: string): string {
  const text = number(value, digits);
  return text === "unknown" ? text : `${text}${THIN}${unit}`;
}

export const kmh = (mps: number | null | undefined) => (mps === null || mps === undefined ? null : mps * 3.6);

/// Two decimals for short lengths, none for long ones.
export function metres(value: number | null | undefined): string {
  const size = Math.abs(value ?? 0);
  return with_unit(value, size < 10 ? 2 : size < 1000 ? 1 : 0, "m");
}

export function milliseconds(value: number | null | undefined): string {
  return with_unit(value, Math.abs(value ?? 0) < 10 ? 1 : 0, "ms");
}

export function bytes(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "unknown";
  let size = value;
  let unit = "B";
  for (const next of ["kB", "MB", "GB", "TB"]) {
    if (Math.abs(size) < 1000) break;
    size /= 1000;
    unit = next;
  }
  return with_unit(size, unit === "B" || Math.abs(size) >= 100 ? 0 : 1, unit);
}

export const bytes_per_s = (value: number | null | undefined) =>
  value === null || value === undefined ? "unknown" : `${bytes(value)}/s`;

export const hertz = (value: number | null | undefined) => with_unit(value, Math.abs(value ?? 0) < 10 ? 1 : 0, "Hz");
export const percent = (value: number | null | undefined, digits = 0) => with_unit(value, digits, "%");

/// Never rounded up to certainty: 0.99996 is "> 99.99 %".
export function probability(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "unknown";
  if (value >= 1) return `100${THIN}%`;
  if (value > 0.9999) return `> 99.99${THIN}%`;
  if (value > 0 && value < 0.001) return `< 0.1${THIN}%`;
  const shown = Math.floor(value * 10000) / 100;
  return `${shown.toFixed(value > 0.99 ? 2 : 1)}${THIN}%`;
}

/// "31 ms", "0.4 s", "12 s", "2 min 5 s", "3 h 12 min", "2 d 4 h".
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "unknown";
  const s = Math.max(0, seconds);
  if (s > 0 && s < 0.0995) return with_unit(s * 1000, 0, "ms");
  if (s < 9.95) return with_unit(s, 1, "s");
  const whole = Math.round(s);
  if (whole < 60) return `${whole}${THIN}s`;
  const parts = (large: number, a: string, small: number, b: string) =>
    small === 0 ? `${large}${THIN}${a}` : `${large}${THIN}${a} ${small}${THIN}${b}`;
  if (whole < 3600) return parts(Math.floor(whole / 60), "min", whole % 60, "s");
  const minutes = Math.floor(whole / 60);
  if (minutes < 1440) return parts(Math.floor(minutes / 60), "h", minutes % 60, "min");
  return parts(Math.floor(minutes / 1440), "d", Math.floor(minutes / 60) % 24, "h");
}

const two = (n: number) => String(n).padStart(2, "0");

/// "12:31:04" and "2026-11-21", by this browser's time zone.
export function time_of_day(ms: number): string {
  const when = new Date(ms);
  return `${two(when.getHours())}:${two(when.getMinutes())}:${two(when.getSeconds())}`;
}
export function day(ms: number): string {
  const when = new Date(ms);
  return `${when.getFullYear()}-${two(when.getMonth() + 1)}-${two(when.getDate())}`;
}

/// "12:31:04", with the date when it is not today's.
export const clock = (ms: number, now_ms: number) => (day(ms) === day(now_ms) ? "" : `${day(ms)} `) + time_of_day(ms);

/// Place in a recording: "1:02:03.4".
export function played(seconds: number): string {
  const tenths = Math.max(0, Math.round(seconds * 10));
  const s = Math.floor(tenths / 10);
  const minutes = Math.floor(s / 60);
  const head = minutes >= 60 ? `${Math.floor(minutes / 60)}:${two(minutes % 60)}` : `${minutes}`;
  return `${head}:${two(s % 60)}.${tenths % 10}`;
}

/// "left, radius 812 m" or "straight": below 1/20 km nobody sees the bend, below its sigma nobody knows it.
export function bend(per_m: number | null | undefined, sigma_per_m = 0): string {
  if (per_m === null || per_m === undefined || !Number.isFinite(per_m)) return "unknown";
  if (Math.abs(per_m) < Math.max(1 / 20000, sigma_per_m)) return "straight";
  return `${per_m > 0 ? "left" : "right"}, radius ${metres(Math.round(Math.abs(1 / per_m)))}`;
}

const WORDS: Record<string, string> = { portal_in: "tunnel portal", portal_out: "tunnel portal", imu: "IMU", gnss: "GNSS" };

/// "track_detector" -> "track detector"; names of services and topics stay as they are.
export const words = (name: string) => WORDS[name] ?? name.replace(/_/g, " ");
export const capital = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);
