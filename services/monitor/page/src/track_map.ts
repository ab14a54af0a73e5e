// The line in the page's memory: places on edges as map coordinates, stretches of track, and what joins on to what.
import type { LinePoint, MapData, Place } from "./wire";

export type Point = [easting_m: number, northing_m: number];
export interface Box {
  west: number;
  south: number;
  east: number;
  north: number;
}
type Edge = MapData["edges"][number];
type Landmark = MapData["landmarks"][number];
type End = { edge: Edge; start: boolean };
/// An edge that is entered at one of its ends, and how far from there.
type Leg = End & { left_m: number };

const JOINED_M = 0.5; // ends nearer than that are one point
const MOST_LEGS = 1000; // of a ring
const SAME_WAY = 0.9; // cosine between the tangents of a train's way through a joint

export class TrackMap {
  private readonly by_id = new Map<number, Edge>();
  private readonly landmarks_by_edge = new Map<number, Landmark[]>();
  private readonly joints = new Map<string, End[]>();
  readonly boxes = new Map<number, Box>();

  constructor(readonly data: MapData) {
    for (const edge of data.edges) {
      if (edge.line.length === 0) continue;
      this.by_id.set(edge.id, edge);
      this.boxes.set(edge.id, box_of(edge.line));
    }
    for (const one of data.landmarks) {
      const there = this.landmarks_by_edge.get(one.edge);
      if (there === undefined) this.landmarks_by_edge.set(one.edge, [one]);
      else there.push(one);
    }
  }

  has = (edge: number) => this.by_id.has(edge);
  name = (edge: number) => this.by_id.get(edge)?.name || `edge ${edge}`;

  /// Null for an edge that is not on this map.
  at(place: Place): Point | null {
    const edge = this.by_id.get(place.edge);
    if (edge === undefined) return null;
    const line = edge.line;
    const i = Math.max(1, first_behind(line, place.offset_m));
    const a = line[i - 1];
    const b = line[i] ?? a;
    if (a === undefined || b === undefined) return null;
    const share = b[0] > a[0] ? Math.min(1, Math.max(0, (place.offset_m - a[0]) / (b[0] - a[0]))) : 0;
    return [a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])];
  }

  /// The track from `behind_m` before the place (towards the edge's start) to `ahead_m` after it, over joints on every way that a
  /// train can take. Each piece is one polyline.
  stretch(place: Place, behind_m: number, ahead_m: number): Point[][] {
    const edge = this.by_id.get(place.edge);
    if (edge === undefined) return [];
    const from = place.offset_m - behind_m;
    const to = place.offset_m + ahead_m;
    const beyond = [...this.beyond(edge, true, -from), ...this.beyond(edge, false, to - edge.length_m)];
    return [this.piece(edge, from, to), ...beyond.map((leg) => this.part_of(leg))].filter((piece) => piece.length > 1);
  }

  /// The landmarks within `reach_m` of the place, with the metres to them along the edge; over joints as long as there is one way only.
  near(place: Place, reach_m: number): { one: Landmark; along_m: number }[] {
    const edge = this.by_id.get(place.edge);
    if (edge === undefined) return [];
    const found = this.landmarks_on(edge.id).map((one) => ({ one, along_m: one.offset_m - place.offset_m }));
    for (const start of [true, false]) {
      const to_end_m = start ? place.offset_m : edge.length_m - place.offset_m;
      for (const leg of this.only_way(edge, start, reach_m - to_end_m)) {
        for (const one of this.landmarks_on(leg.edge.id)) {
          const into_m = leg.start ? one.offset_m : leg.edge.length_m - one.offset_m;
          found.push({ one, along_m: (start ? -1 : 1) * (reach_m - leg.left_m + into_m) });
        }
      }
    }
    return found.filter(({ along_m }) => Math.abs(along_m) < reach_m).sort((a, b) => a.along_m - b.along_m);
  }

  private landmarks_on = (edge: number) => this.landmarks_by_edge.get(edge) ?? [];

  /// What `left_m` beyond an end of the edge reach, each edge once, by its shortest way.
  private beyond(edge: Edge, start: boolean, left_m: number): Leg[] {
    const found = new Map<string, Leg>();
    const open = left_m > 0 ? this.following(edge, start, left_m) : [];
    while (open.length > 0) {
      open.sort((a, b) => a.left_m - b.left_m);
      const leg = open.pop() as Leg;
      const key = `${leg.edge.id} ${leg.start}`;
      if (found.has(key)) continue;
      found.set(key, leg);
      if (leg.left_m > leg.edge.length_m) open.push(...this.following(leg.edge, !leg.start, leg.left_m - leg.edge.length_m));
    }
    return [...found.values()];
  }

  private only_way(edge: Edge, start: boolean, left_m: number): Leg[] {
    const legs: Leg[] = [];
    for (let ways = left_m > 0 ? this.following(edge, start, left_m) : []; ways.length === 1; ) {
      const leg = ways[0] as Leg;
      legs.push(leg);
      const rest_m = leg.left_m - leg.edge.length_m;
      ways = rest_m > 0 && legs.length < MOST_LEGS ? this.following(leg.edge, !leg.start, rest_m) : [];
    }
    return legs;
  }

  private part_of({ edge, start, left_m }: Leg): Point[] {
    return start ? this.piece(edge, 0, left_m) : this.piece(edge, edge.length_m - left_m, edge.length_m);
  }

  private piece(edge: Edge, from: number, to: number): Point[] {
    const a = Math.max(0, from);
    const b = Math.min(edge.length_m, to);
    if (b < a) return [];
    const inner = edge.line.filter((point) => point[0] > a && point[0] < b).map((point): Point => [point[1], point[2]]);
    const ends = [this.at({ edge: edge.id, offset_m: a }), this.at({ edge: edge.id, offset_m: b })] as [Point, Point];
    return [ends[0], ...inner, ends[1]];
  }

  /// The ways of a train over an end of the edge.
  private following(edge: Edge, start: boolean, left_m: number): Leg[] {
    const out = tangent(edge, start);
    const goes_on = (next: End) => {
      const inward = tangent(next.edge, next.start);
      return -(out[0] * inward[0] + out[1] * inward[1]) >= SAME_WAY;
    };
    return this.joined(edge, start).filter(goes_on).map((next) => ({ ...next, left_m }));
  }

  /// The edges that have an end where this one has its own.
  private joined(edge: Edge, start: boolean): End[] {
    const key = `${edge.id} ${start}`;
    const known = this.joints.get(key);
    if (known !== undefined) return known;
    const [easting, northing] = end_point(edge, start);
    const found: End[] = [];
    this.joints.set(key, found);
    for (const other of this.by_id.values()) {
      for (const other_start of [true, false]) {
        const [e, n] = end_point(other, other_start);
        if (other.id !== edge.id && Math.hypot(e - easting, n - northing) < JOINED_M) found.push({ edge: other, start: other_start });
      }
    }
    return found;
  }

  box(): Box {
    return union([...this.boxes.values()]);
  }
}

/// Index of the first point at or behind the offset; the line's length when there is none.
function first_behind(line: LinePoint[], offset_m: number): number {
  let low = 0;
  let high = line.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((line[middle] as LinePoint)[0] < offset_m) low = middle + 1;
    else high = middle;
  }
  return low;
}

const end_point = (edge: Edge, start: boolean): Point => {
  const point = edge.line[start ? 0 : edge.line.length - 1] as LinePoint;
  return [point[1], point[2]];
};

/// Unit vector pointing out of the edge at one of its ends.
function tangent(edge: Edge, start: boolean): Point {
  const line = edge.line;
  const at = line[start ? 0 : line.length - 1] as LinePoint;
  const inside = (line[start ? 1 : line.length - 2] ?? at) as LinePoint;
  const length = Math.hypot(at[1] - inside[1], at[2] - inside[2]) || 1;
  return [(at[1] - inside[1]) / length, (at[2] - inside[2]) / length];
}

function box_of(line: LinePoint[]): Box {
  const box = { west: Infinity, south: Infinity, east: -Infinity, north: -Infinity };
  for (const [, e, n] of line) {
    box.west = Math.min(box.west, e);
    box.east = Math.max(box.east, e);
    box.south = Math.min(box.south, n);
    box.north = Math.max(box.north, n);
  }
  return box;
}

function union(boxes: Box[]): Box {
  if (boxes.length === 0) return { west: 0, south: 0, east: 1, north: 1 };
  return boxes.reduce((a, b) => ({
    west: Math.min(a.west, b.west),
    south: Math.min(a.south, b.south),
    east: Math.max(a.east, b.east),
    north: Math.max(a.north, b.north),
  }));
}

export const overlap = (a: Box, b: Box) => a.west <= b.east && b.west <= a.east && a.south <= b.north && b.south <= a.north;
