// A small plot: lines with gaps, a band, a zero line, axes with units.
import { number } from "../format";
import { colours, label, polyline, round_step, sheet } from "./canvas";

export interface Series {
  colour: string;
  width: number;
  dash?: number[];
  points: [x: number, y: number | null][];
}
export interface Band {
  colour: string;
  points: [x: number, low: number, high: number][];
}
export interface Axes {
  x: { from: number; to: number; ticks: number[]; name: (value: number) => string };
  y: { from: number; to: number; unit: string };
}

const LEFT = 46;
const BOTTOM = 18;
const TOP = 18;
const RIGHT = 10;

/// Round places between both ends, at least `count` of them.
export function round_ticks(from: number, to: number, count: number): number[] {
  const step = round_step((to - from) / count);
  const first = Math.ceil(from / step - 1e-9);
  const last = Math.floor(to / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => (first + i) * step);
}

/// A range around all values, never narrower than `least`, zero inside when `zero`.
export function range_of(values: (number | null)[], least: number, zero: boolean): { from: number; to: number } {
  const known = values.filter((value): value is number => value !== null && Number.isFinite(value));
  if (zero) known.push(0);
  if (known.length === 0) return { from: 0, to: least };
  let from = known.reduce((a, b) => Math.min(a, b));
  let to = known.reduce((a, b) => Math.max(a, b));
  const lacking = Math.max(0, least - (to - from));
  const below = zero && from === 0 ? 0 : lacking / 2;
  from -= below;
  to += lacking - below;
  const air = (to - from) * 0.06;
  return { from: zero && from === 0 ? 0 : from - air, to: to + air };
}

export function draw_plot(canvas: HTMLCanvasElement, axes: Axes, bands: Band[], lines: Series[]): void {
  const paper = sheet(canvas);
  if (paper === null) return;
  const { context, width, height } = paper;
  const c = colours();
  const x_of = (x: number) => LEFT + ((x - axes.x.from) / (axes.x.to - axes.x.from || 1)) * (width - LEFT - RIGHT);
  const y_of = (y: number) => TOP + ((axes.y.to - y) / (axes.y.to - axes.y.from || 1)) * (height - TOP - BOTTOM);

  const y_step = round_step((axes.y.to - axes.y.from) / Math.max(2.2, (height - TOP - BOTTOM) / 36));
  const digits = Math.max(0, -Math.floor(Math.log10(y_step) + 1e-9));
  for (let y = Math.ceil(axes.y.from / y_step) * y_step; y <= axes.y.to + 1e-12; y += y_step) {
    const zero = Math.abs(y) < y_step / 1000;
    context.strokeStyle = zero ? c.muted : c.faint;
    context.lineWidth = 1;
    polyline(context, [[LEFT, Math.round(y_of(y)) + 0.5], [width - RIGHT, Math.round(y_of(y)) + 0.5]]);
    context.stroke();
    const text = number(zero ? 0 : y, digits);
    label(context, text, LEFT - 6 - context.measureText(text).width, y_of(y) + 4, c.muted);
  }
  label(context, axes.y.unit, LEFT - 6 - context.measureText(axes.y.unit).width, 10, c.muted);
  for (const x of axes.x.ticks) {
    const text = axes.x.name(x);
    const half = context.measureText(text).width / 2;
    label(context, text, Math.min(width - 2 * half - 2, Math.max(LEFT, x_of(x) - half)), height - 4, c.muted);
  }

  context.save();
  context.beginPath();
  context.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
  context.clip();
  for (const band of bands) {
    if (band.points.length < 2) continue;
    const upper = band.points.map(([x, , high]): [number, number] => [x_of(x), y_of(high)]);
    const lower = band.points.map(([x, low]): [number, number] => [x_of(x), y_of(low)]).reverse();
    polyline(context, upper.concat(lower));
    context.fillStyle = band.colour;
    context.fill();
  }
  for (const line of lines) {
    context.strokeStyle = line.colour;
    context.lineWidth = line.width;
    context.setLineDash(line.dash ?? []);
    context.beginPath();
    let pen_down = false;
    for (const [x, y] of line.points) {
      if (y === null) pen_down = false;
      else if (pen_down) context.lineTo(x_of(x), y_of(y));
      else {
        context.moveTo(x_of(x), y_of(y));
        pen_down = true;
      }
    }
    context.stroke();
  }
  context.setLineDash([]);
  context.restore();
}
