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

const JOINED_M = 0.5; // ends nearer than that are one point
const SAME_WAY = 0.9; // cosine between the tangents of a train's way through a joint

export class TrackMap {
  private readonly by_id = new Map<number, Edge>();
  readonly boxes = new Map<number, Box>();

  constructor(readonly data: MapData) {
    for (const edge of data.edges) {
      if (edge.line.length === 0) continue;
      this.by_id.set(edge.id, edge);
      this.boxes.set(edge.id, box_of(edge.line));
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
    const pieces = [this.piece(edge, from, to)];
    if (from < 0) this.go_on(edge, true, -from, pieces, 0);
    if (to > edge.length_m) this.go_on(edge, false, to - edge.length_m, pieces, 0);
    return pieces.filter((piece) => piece.length > 1);
  }

  private piece(edge: Edge, from: number, to: number): Point[] {
    const a = Math.max(0, from);
    const b = Math.min(edge.length_m, to);
    if (b < a) return [];
    const inner = edge.line.filter((point) => point[0] > a && point[0] < b).map((point): Point => [point[1], point[2]]);
    const ends = [this.at({ edge: edge.id, offset_m: a }), this.at({ edge: edge.id, offset_m: b })] as [Point, Point];
    return [ends[0], ...inner, ends[1]];
  }

  private go_on(edge: Edge, start: boolean, left_m: number, pieces: Point[][], depth: number): void {
    if (depth > 4) return;
    const out = tangent(edge, start);
    for (const next of this.joined(edge, start)) {
      const inward = tangent(next.edge, next.start);
      if (-(out[0] * inward[0] + out[1] * inward[1]) < SAME_WAY) continue;
      const length = next.edge.length_m;
      pieces.push(next.start ? this.piece(next.edge, 0, left_m) : this.piece(next.edge, length - left_m, length));
      if (left_m > length) this.go_on(next.edge, !next.start, left_m - length, pieces, depth + 1);
    }
  }

  /// The edges that have an end where this one has its own.
  private joined(edge: Edge, start: boolean): { edge: Edge; start: boolean }[] {
    const [easting, northing] = end_point(edge, start);
    const found: { edge: Edge; start: boolean }[] = [];
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
