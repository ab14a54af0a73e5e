// What the monitor sends and takes over /api (services/monitor/README.md). Times are nanoseconds since the Unix epoch, rounded to
// what a double holds; null = not known.

export type Integrity = "ok" | "degraded" | "unusable";
export type Direction = "forward" | "reverse" | "unknown";

export interface About {
  train: string;
  version: string;
  host: string;
  now_ns: number;
  cameras: string[];
  control: "open" | "token" | "no_token" | "off"; // no_token: from here it would need one, and none is set
  map: { name: string; edges: number; length_m: number } | null;
}

export interface Place {
  edge: number;
  offset_m: number;
}

export interface TrainState extends Place {
  stamp_ns: number;
  age_s: number;
  sent_ns?: number; // by the monitor's clock that nobody sets
  distance_m: number | null;
  speed_mps: number | null;
  acceleration_mps2: number | null;
  over_m: number | null; // the true position may lie this far behind ...
  under_m: number | null; // ... and this far ahead
  sigma_m: number | null;
  integrity: Integrity;
  track_known: boolean;
  track_probability: number | null;
  direction: Direction;
  standstill: boolean;
  sources: string[];
  reference: string | null; // what the position was last fixed to
  since_reference_m: number | null;
  lat: number | null;
  lon: number | null;
  easting_m: number | null;
  northing_m: number | null;
  heading_rad: number | null;
  pose: { height_m: number | null; pitch_rad: number | null; roll_rad: number | null } | null;
  alternatives: (Place & { probability: number })[];
}

export interface Curvature extends Place {
  stamp_ns: number;
  measured: [ahead_m: number, per_m: number, sigma_per_m: number][];
  map: [ahead_m: number, per_m: number][];
}

export type PicturePoint = [x: number, y: number];

export interface View {
  camera: string;
  stamp_ns: number;
  width: number;
  height: number;
  rails: { left: PicturePoint[]; right: PicturePoint[] } | null;
  seen: boolean; // both rails
  why: string | null; // why not: "not seen", "left rail not seen", ...
  // Where the map and the position put them.
  landmarks: { kind: string; name: string; ahead_m: number; across_m: number; x: number; y: number; side: string }[];
  health: string[];
}

export interface PictureHeader {
  kind: "picture";
  camera: string;
  stamp_ns: number;
}

export interface Report {
  stamp_ns: number;
  sent_ns: number;
  seq: number;
  reason: string;
  nid_packet: number;
  baseline: number;
  nid_lrbg: number | null;
  d_lrbg_m: number | null;
  q_dirlrbg: number;
  q_dlrbg: number;
  l_doubtover_m: number | null;
  l_doubtunder_m: number | null;
  v_train_kmh: number | null;
  hex: string;
}

export interface Service {
  service: string;
  host: string;
  state: string;
  reason: string;
  since_ns: number;
  age_s: number;
  alive: boolean;
  version: string;
  pid: number;
  cpu_percent: number;
  rss_mb: number;
  frames_in: number;
  frames_out: number;
  dropped: number;
  latency_p50_ms: number | null;
  latency_p99_ms: number | null;
  matches: number;
}

export interface Topic {
  topic: string;
  type: string;
  writers: number;
  hz: number | null;
  bytes_per_s: number | null;
  age_s: number | null;
  latency_p50_ms: number | null;
  latency_p95_ms: number | null;
  latency_p99_ms: number | null;
  lost: number;
  gaps: number;
  longest_gap_s: number | null;
  measured: boolean; // false: known, but not listened to
}

export type LogLevel = "trace" | "debug" | "info" | "warning" | "error" | "critical";

export interface LogRecord {
  stamp_ns: number;
  service: string;
  host: string;
  level: LogLevel;
  text: string;
}

export interface RecorderStatus {
  absent?: boolean;
  stamp_ns: number;
  started_ns: number;
  event_ns: number;
  messages: number;
  bytes: number;
  bytes_per_s: number;
  queue_mb: number;
  ring_s: number;
  kept_mb: number;
  quota_mb: number;
  disk_free_mb: number | null;
  files: number;
  protected_files: number;
  state: "stopped" | "recording" | "paused" | "waiting";
  file: string;
  event: string;
  lost: { topic: string; transport: number; encoder: number; queue: number; disk: number }[];
}

export interface PlayerStatus {
  absent?: boolean;
  stamp_ns: number;
  from_ns: number;
  to_ns: number;
  at_ns: number;
  rate: number;
  state: "playing" | "paused" | "ended";
  looped: boolean;
  lock_step: boolean;
  file: string;
}

export interface Problem {
  id: string;
  level: "warning" | "error";
  what: string;
  what_to_do: string;
  since_ns: number;
}

export interface Reply {
  id: number;
  done: boolean;
  text: string;
}

export type Message =
  | { kind: "hello"; train: string; version: string; host: string; now_ns: number }
  | { kind: "beat"; sent_ns: number; now_ns: number; cameras: string[] } // once a second, whatever is watched
  | ({ kind: "state" } & Partial<TrainState>)
  | ({ kind: "curvature" } & Curvature)
  | ({ kind: "view" } & View)
  | ({ kind: "report" } & Report)
  | { kind: "services"; services: Service[] }
  | { kind: "topics"; topics: Topic[] }
  | { kind: "log"; records: LogRecord[] }
  | ({ kind: "recorder" } & RecorderStatus)
  | ({ kind: "player" } & PlayerStatus)
  | { kind: "problems"; now_ns?: number; problems: Problem[] } // now_ns: not from a monitor before this one
  | ({ kind: "reply" } & Reply);

// GET /api/map
export type LinePoint = [offset_m: number, easting_m: number, northing_m: number, height_m: number | null, per_m: number];

export interface MapData {
  edges: { id: number; name?: string; length_m: number; line: LinePoint[] }[];
  switches: (Place & { id: number; easting_m: number; northing_m: number })[];
  landmarks: (Place & { id: number; kind: string; name: string; easting_m: number; northing_m: number; across_m: number })[];
}

/// A binary frame: length of a JSON header (u32, little endian), the header, then the picture. Null when it is none.
export function split_picture(frame: ArrayBuffer): { header: PictureHeader; jpeg: Uint8Array } | null {
  if (frame.byteLength < 4) return null;
  const length = new DataView(frame).getUint32(0, true);
  if (4 + length > frame.byteLength) return null;
  try {
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length))) as PictureHeader;
    return header.kind === "picture" ? { header, jpeg: new Uint8Array(frame, 4 + length) } : null;
  } catch {
    return null;
  }
}
