// The train on its line, north up.
import { metres, probability, words } from "../format";
import { type Box, overlap, type Point, type TrackMap } from "../track_map";
import type { MapData, TrainState } from "../wire";
import { type Colours, colours, label, polyline, round_step, sheet, type Sheet } from "./canvas";

export interface Camera {
  easting_m: number;
  northing_m: number;
  metres_per_px: number;
}

type Landmark = MapData["landmarks"][number];
const BUTTONS_PX = 260; // the buttons lie over the upper right corner
type Project = (point: Point) => [number, number];

/// `live` false: the train is drawn as old.
export function draw_map(canvas: HTMLCanvasElement, map: TrackMap, state: TrainState | null, live: boolean, camera: Camera): void {
  const paper = sheet(canvas);
  if (paper === null) return;
  const scene = new Scene(paper, map, camera);
  scene.edges();
  scene.switches();
  if (state !== null) scene.train(state, live);
  scene.landmarks();
  scene.edge_names();
  scene.scale_bar();
}

class Scene {
  private readonly c: Colours = colours();
  private readonly taken: Box[]; // screen rectangles that labels must not use, y down
  private readonly seen: Box; // map coordinates
  private readonly project: Project;

  constructor(
    private readonly paper: Sheet,
    private readonly map: TrackMap,
    private readonly camera: Camera,
  ) {
    const { width, height } = paper;
    this.taken = [{ west: width - BUTTONS_PX, east: width, south: 0, north: 44 }];
    const m = camera.metres_per_px;
    this.project = ([e, n]) => [width / 2 + (e - camera.easting_m) / m, height / 2 - (n - camera.northing_m) / m];
    const margin_m = 40 * m;
    this.seen = {
      west: camera.easting_m - (width / 2) * m - margin_m,
      east: camera.easting_m + (width / 2) * m + margin_m,
      south: camera.northing_m - (height / 2) * m - margin_m,
      north: camera.northing_m + (height / 2) * m + margin_m,
    };
  }

  edges(): void {
    const { context } = this.paper;
    context.strokeStyle = this.c.track;
    context.lineWidth = 2;
    for (const edge of this.map.data.edges) {
      const box = this.map.boxes.get(edge.id);
      if (box === undefined || !overlap(box, this.seen)) continue;
      polyline(context, edge.line.map((point) => this.project([point[1], point[2]])));
      context.stroke();
    }
  }

  switches(): void {
    const { context } = this.paper;
    for (const one of this.map.data.switches) {
      if (!this.inside(one.easting_m, one.northing_m)) continue;
      const [x, y] = this.project([one.easting_m, one.northing_m]);
      context.fillStyle = this.c.panel;
      context.strokeStyle = this.c.track;
      context.lineWidth = 1.5;
      context.beginPath();
      context.arc(x, y, 3.5, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    }
  }

  /// Big things keep their names at every scale, small ones when there is room.
  landmarks(): void {
    const m = this.camera.metres_per_px;
    const wanted = this.map.data.landmarks.filter((one) => m < shown_up_to_m(one.kind) && this.inside(one.easting_m, one.northing_m));
    wanted.sort((a, b) => shown_up_to_m(b.kind) - shown_up_to_m(a.kind));
    const said = new Set<string>();
    for (const one of wanted) {
      const [x, y] = this.project([one.easting_m, one.northing_m]);
      this.symbol(one, x, y);
      const text = one.name || words(one.kind);
      if (m > shown_up_to_m(one.kind) / 2 || said.has(text + Math.round(x / 160))) continue;
      if (this.room(text, x + 9, y - 6)) {
        label(this.paper.context, text, x + 9, y - 6, this.c.muted);
        said.add(text + Math.round(x / 160));
      }
    }
  }

  train(state: TrainState, live: boolean): void {
    for (const other of state.alternatives) {
      const point = this.map.at(other);
      if (point !== null) this.possible(point, `${this.map.name(other.edge)}: ${probability(other.probability)}`);
    }
    if (!state.track_known || !this.map.has(state.edge)) return;
    const point = this.map.at(state) as Point;
    const { over_m, under_m } = state;
    if (over_m === null || under_m === null) {
      this.possible(point, "no bound is known");
      return;
    }
    const { context } = this.paper;
    const reverse = state.direction === "reverse";
    const [before_m, after_m] = reverse ? [under_m, over_m] : [over_m, under_m];
    context.strokeStyle = live ? this.c.band : this.c.faint;
    context.lineWidth = 11;
    for (const piece of this.map.stretch(state, before_m, after_m)) {
      polyline(context, piece.map(this.project));
      context.stroke();
    }
    const [x, y] = this.project(point);
    this.arrow(x, y, state.direction === "unknown" ? null : state.heading_rad, live ? this.c.train : this.c.muted);
    this.taken.push({ west: x - 12, east: x + 12, south: y - 12, north: y + 12 });
    if (!live && this.room("old", x + 12, y + 16)) label(context, "old", x + 12, y + 16, this.c.muted);
  }

  /// On the track itself, in the middle of what is seen of it. Edges without a name are told by their number, after all
  /// others and where there is much of them to see.
  edge_names(): void {
    const named = (edge: MapData["edges"][number]) => Boolean(edge.name);
    for (const edge of [...this.map.data.edges].sort((a, b) => Number(named(b)) - Number(named(a)))) {
      const box = this.map.boxes.get(edge.id);
      if (box === undefined || !overlap(box, this.seen)) continue;
      const text = this.map.name(edge.id);
      const middle = middle_inside(edge.line.map((point) => this.project([point[1], point[2]])), this.paper, named(edge) ? NAMED_FROM_PX : NUMBERED_FROM_PX);
      if (middle === null) continue;
      const [x, y] = middle;
      if (this.room(text, x + 6, y + 14)) label(this.paper.context, text, x + 6, y + 14, named(edge) ? this.c.text : this.c.muted);
    }
  }

  scale_bar(): void {
    const { context, height } = this.paper;
    const length_m = round_step(this.camera.metres_per_px * 110);
    const x = 12;
    const y = height - 12;
    const end = x + length_m / this.camera.metres_per_px;
    context.strokeStyle = this.c.muted;
    context.lineWidth = 1.5;
    polyline(context, [[x, y - 4], [x, y], [end, y], [end, y - 4]]);
    context.stroke();
    label(context, length_m >= 1000 ? `${length_m / 1000} km` : `${length_m} m`, x + 4, y - 5, this.c.muted);
  }

  private possible(point: Point, text: string): void {
    const { context } = this.paper;
    const [x, y] = this.project(point);
    context.strokeStyle = this.c.maybe;
    context.lineWidth = 2;
    context.setLineDash([3, 2]);
    context.beginPath();
    context.arc(x, y, 9, 0, 2 * Math.PI);
    context.stroke();
    context.setLineDash([]);
    if (this.room(text, x + 12, y - 10)) label(context, text, x + 12, y - 10, this.c.maybe);
  }

  private arrow(x: number, y: number, heading_rad: number | null, colour: string): void {
    const { context } = this.paper;
    context.save();
    context.translate(x, y);
    context.fillStyle = colour;
    context.strokeStyle = this.c.panel;
    context.lineWidth = 2;
    context.beginPath();
    if (heading_rad === null) {
      context.arc(0, 0, 7, 0, 2 * Math.PI);
    } else {
      context.rotate(heading_rad);
      for (const [dx, dy] of [[0, -11], [7, 8], [0, 4], [-7, 8]] as const) context.lineTo(dx, dy);
      context.closePath();
    }
    context.stroke();
    context.fill();
    context.restore();
  }

  private symbol(one: Landmark, x: number, y: number): void {
    const { context } = this.paper;
    context.fillStyle = this.c.landmark;
    context.strokeStyle = this.c.landmark;
    context.lineWidth = 1.5;
    if (one.kind === "balise") {
      context.fillRect(x - 3, y - 2, 6, 4);
    } else if (one.kind === "mast") {
      context.fillRect(x - 1, y - 1, 2.5, 2.5);
    } else if (one.kind === "frog") {
      polyline(context, [[x - 3, y + 3], [x, y - 3], [x + 3, y + 3]]);
      context.stroke();
    } else {
      context.strokeRect(x - 3.5, y - 3.5, 7, 7);
    }
  }

  private inside(e: number, n: number): boolean {
    return overlap({ west: e, east: e, south: n, north: n }, this.seen);
  }

  /// Takes the place when nothing stands there yet.
  private room(text: string, x: number, y: number): boolean {
    const width = this.paper.context.measureText(text).width;
    const box = { west: x - 2, east: x + width + 2, south: y - 11, north: y + 3 };
    if (box.west < 0 || box.east > this.paper.width || box.south < 0 || this.taken.some((other) => overlap(box, other))) return false;
    this.taken.push(box);
    return true;
  }
}

const NAMED_FROM_PX = 24; // so much of an edge must be seen
const NUMBERED_FROM_PX = 80;
const NEXT_WITHIN_M = 20000; // a landmark farther ahead is not named as the next

/// The middle of what lies of a line on the paper; null when that is shorter than `least_px`.
function middle_inside(line: [number, number][], paper: { width: number; height: number }, least_px: number): [number, number] | null {
  const pieces: { at: [number, number]; along: [number, number]; length_px: number }[] = [];
  let seen_px = 0;
  for (let i = 1; i < line.length; ++i) {
    const [a, b] = [line[i - 1], line[i]] as [[number, number], [number, number]];
    const [from, to] = clipped(a, b, paper);
    if (from >= to) continue;
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const along: [number, number] = [(to - from) * dx, (to - from) * dy];
    pieces.push({ at: [a[0] + from * dx, a[1] + from * dy], along, length_px: Math.hypot(...along) });
    seen_px += Math.hypot(...along);
  }
  if (seen_px < least_px) return null;
  let left_px = seen_px / 2;
  for (const { at, along, length_px } of pieces) {
    if (left_px <= length_px) return [at[0] + (left_px / length_px) * along[0], at[1] + (left_px / length_px) * along[1]];
    left_px -= length_px;
  }
  return null;
}

/// The part of a segment on the paper, as shares from a to b (Liang and Barsky, 1984).
function clipped(a: [number, number], b: [number, number], paper: { width: number; height: number }): [number, number] {
  let [from, to] = [0, 1];
  const sides = [[a[0] - b[0], a[0]], [b[0] - a[0], paper.width - a[0]], [a[1] - b[1], a[1]], [b[1] - a[1], paper.height - a[1]]] as const;
  for (const [change, room] of sides) {
    if (change === 0 && room < 0) return [1, 0];
    if (change < 0) from = Math.max(from, room / change);
    if (change > 0) to = Math.min(to, room / change);
  }
  return [from, to];
}

/// Metres a pixel up to which a kind is drawn; its name up to a third of that.
function shown_up_to_m(kind: string): number {
  switch (kind) {
    case "platform":
    case "station":
      return 60;
    case "portal_in":
    case "portal_out":
    case "bridge":
      return 12;
    case "balise":
    case "frog":
      return 6;
    default:
      return 1;
  }
}

/// What the picture shows, for those who do not see it.
export function map_in_words(map: TrackMap, state: TrainState | null): string {
  if (state === null) return "Line map. Where the train is, is not known.";
  const others = state.alternatives.map((one) => `${map.name(one.edge)} at ${metres(one.offset_m)}, ${probability(one.probability)}`);
  const also = others.length === 0 ? "" : ` Also possible: ${others.join("; ")}.`;
  if (!state.track_known) return `Line map. The track is not yet known.${also}`;
  const sign = state.direction === "reverse" ? -1 : 1;
  const next = map
    .near(state, NEXT_WITHIN_M)
    .filter(({ along_m }) => sign * along_m > 0)
    .sort((a, b) => Math.abs(a.along_m) - Math.abs(b.along_m))[0];
  const ahead = next === undefined ? "" : ` Next: ${next.one.name || words(next.one.kind)} in ${metres(Math.abs(next.along_m))}.`;
  return `Line map. Train on ${map.name(state.edge)} at ${metres(state.offset_m)}.${ahead}${also}`;
}
