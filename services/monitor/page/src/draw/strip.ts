// The track ahead and behind as a straight line: the interval to scale, what stands beside it.
import { bounds_in_words, words } from "../format";
import type { TrackMap } from "../track_map";
import type { TrainState } from "../wire";
import { colours, label, polyline, round_step, sheet } from "./canvas";

/// Metres shown on each side of the train: so many that the interval takes at most a third.
export function reach_m(over_m: number, under_m: number): number {
  return Math.max(80, round_step(Math.max(over_m, under_m, 1) * 3) * 2);
}

export function draw_strip(canvas: HTMLCanvasElement, map: TrackMap, state: TrainState, live: boolean): void {
  const paper = sheet(canvas);
  if (paper === null) return;
  const { context, width, height } = paper;
  const c = colours();
  const [over_m, under_m] = [state.over_m, state.under_m];
  const bounded = over_m !== null && under_m !== null;
  const reach = reach_m(over_m ?? 0, under_m ?? 0);
  const sign = state.direction === "reverse" ? -1 : 1;
  const x_of = (ahead_m: number) => width / 2 + (ahead_m / reach) * (width / 2);
  const y = height - 24;

  const band = live ? c.band : c.faint;
  if (bounded) {
    context.fillStyle = band;
    const left = x_of(-over_m);
    context.fillRect(left, y - 9, Math.max(2, x_of(under_m) - left), 18);
  } else {
    hatch(context, 0, y - 9, width, 18, band);
  }
  context.strokeStyle = c.track;
  context.lineWidth = 2;
  polyline(context, [[0, y], [width, y]]);
  context.stroke();

  const step = round_step(reach / 2);
  for (let ahead = -Math.floor(reach / step) * step; ahead <= reach; ahead += step) {
    const x = x_of(ahead);
    context.strokeStyle = c.track;
    context.lineWidth = 1.5;
    polyline(context, [[x, y + 3], [x, y + 8]]);
    context.stroke();
    const text = ahead === 0 ? "" : `${ahead > 0 ? "+" : "\u2212"}${Math.abs(ahead)} m`;
    const half = context.measureText(text).width / 2;
    if (x - half > 0 && x + half < width) label(context, text, x - half, height - 4, c.muted);
  }

  let last = -Infinity;
  const near = map
    .near(state, reach)
    .map(({ one, along_m }) => ({ one, ahead: sign * along_m }))
    .sort((a, b) => a.ahead - b.ahead);
  for (const { one, ahead } of near) {
    const x = x_of(ahead);
    context.fillStyle = c.landmark;
    context.fillRect(x - 1, y - 14, 2, 14);
    const text = one.name || words(one.kind);
    const span = context.measureText(text).width;
    if (x - span / 2 < last + 6 || x + span / 2 > width) continue;
    label(context, text, Math.max(2, x - span / 2), y - 18, c.muted);
    last = x + span / 2;
  }

  if (!bounded) return; // no arrow says where the train is
  const x = x_of(0);
  context.fillStyle = live ? c.train : c.muted;
  context.beginPath();
  context.moveTo(x + 7, y);
  context.lineTo(x - 6, y - 7);
  context.lineTo(x - 6, y + 7);
  context.fill();
}

function hatch(context: CanvasRenderingContext2D, left: number, top: number, width: number, height: number, colour: string): void {
  context.strokeStyle = colour;
  context.lineWidth = 3;
  for (let x = left - height; x < left + width; x += 9) {
    polyline(context, [[x, top + height], [x + height, top]]);
    context.stroke();
  }
}

export function strip_in_words(state: TrainState): string {
  if (state.over_m === null || state.under_m === null) return "How far from where it is drawn the train may be has no bound.";
  return `The train is at most ${bounds_in_words(state.over_m, state.under_m)} of where it is drawn.`;
}
