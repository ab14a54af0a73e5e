// All that the page knows. Everything is bounded: an hour open holds no more than a minute does.
import { computed, signal } from "@preact/signals";
import { age_s, appended, FRESH_S, freshness, type Freshness, type Held, LinkDelay, nothing } from "./stale";
import type { About, Curvature, LogRecord, MapData, Message, PlayerStatus, Problem, RecorderStatus, Report, Service, Topic, TrainState, View } from "./wire";

export const LOG_LIMIT = 500;
export const REPORT_LIMIT = 50;
const HISTORY_LIMIT = 600; // one a second

export interface Picture {
  camera: string;
  stamp_ns: number;
  image: ImageBitmap;
  view: View | null; // what was seen in this very picture
}

const VIEWS_KEPT = 8; // a view comes before its picture, which must be decoded first
let views: View[] = [];

/// One second of the past: null where nothing was known.
export interface Moment {
  at_ms: number;
  speed_mps: number | null;
  over_m: number | null;
  under_m: number | null;
}

export const about = signal<About | null>(null);
export const map = signal<MapData | null>(null);
export const map_failed = signal(false);
export const state = signal<Held<TrainState>>(nothing());
export const curvature = signal<Held<Curvature>>(nothing());
export const view = signal<Held<View>>(nothing());
export const picture = signal<Picture | null>(null);
export const services = signal<Held<Service[]>>(nothing());
export const topics = signal<Held<Topic[]>>(nothing());
export const reports = signal<Report[]>([]);
export const log = signal<LogRecord[]>([]);
export const recorder = signal<Held<RecorderStatus>>(nothing());
export const player = signal<Held<PlayerStatus>>(nothing());
export const problems = signal<Problem[] | null>(null);
export const history = signal<Moment[]>([]);

/// The socket: `since_ms` is when it came up or was lost, by this browser's clock.
export const connection = signal<{ up: boolean; since_ms: number; ever: boolean }>({ up: false, since_ms: Date.now(), ever: false });
/// This browser's clock minus the monitor's, so that "since" means the same on both.
export const clock_offset_ms = signal(0);
/// Both move twice a second while the page can be seen: the time to show, and the one that every age hangs on, which no
/// clock that is set can stop.
export const now_ms = signal(Date.now());
export const passed_ms = signal(performance.now());
export function tick(): void {
  now_ms.value = Date.now();
  passed_ms.value = performance.now();
}

export const host_now_ms = computed(() => now_ms.value - clock_offset_ms.value);
export const host_ms = (ns: number) => ns / 1e6 + clock_offset_ms.value;

type Kind = keyof typeof FRESH_S;
const held: Record<Kind, { value: Held<unknown> }> = { state, curvature, view, services, topics, recorder, player };

export function age_of(kind: Kind, at_ms = passed_ms.value): number {
  const one = held[kind].value;
  return age_s(one, at_ms, kind === "state" ? ((one.value as TrainState | null)?.age_s ?? 0) : 0);
}
export const fresh = (kind: Kind, at_ms = passed_ms.value): Freshness => freshness(age_of(kind, at_ms), FRESH_S[kind], connection.value.up);

const link = new LinkDelay();

/// A monitor that has just begun knows of none; what we hold grows old.
function take_state(message: Partial<TrainState>): void {
  if (message.edge === undefined) return;
  const at_ms = performance.now();
  const known = message as TrainState;
  const late_s = known.sent_ns === undefined ? 0 : link.late_s(known.sent_ns / 1e6, at_ms); // a monitor before this one
  state.value = { value: { ...known, age_s: known.age_s + late_s }, at_ms };
}

/// Called once a second.
export function remember_moment(at_ms: number): void {
  const live = fresh("state", performance.now()) === "live" ? state.value.value : null; // also while nobody sees the page
  const moment = { at_ms, speed_mps: live?.speed_mps ?? null, over_m: live?.over_m ?? null, under_m: live?.under_m ?? null };
  history.value = history.value.concat(moment).slice(-HISTORY_LIMIT);
}

export function show_picture(next: Omit<Picture, "view">): void {
  const seen = views.find((one) => one.camera === next.camera && one.stamp_ns === next.stamp_ns) ?? null;
  const last = picture.value;
  picture.value = { ...next, view: seen };
  last?.image.close();
}

const report_key = (report: Report) => `${report.stamp_ns} ${report.seq}`;
const log_key = (record: LogRecord) => `${record.stamp_ns} ${record.host} ${record.service} ${record.text}`;

/// Everything but replies, which belong to whoever asked.
export function take(message: Message): void {
  const at_ms = performance.now();
  switch (message.kind) {
    case "hello":
      clock_offset_ms.value = Date.now() - message.now_ns / 1e6;
      problems.value = null; // of the connection before
      link.reset();
      break;
    case "state":
      take_state(message);
      break;
    case "curvature":
      curvature.value = { value: message, at_ms };
      break;
    case "view":
      view.value = { value: message, at_ms };
      views = views.concat(message).slice(-VIEWS_KEPT);
      break;
    case "services":
      services.value = { value: message.services, at_ms };
      break;
    case "topics":
      topics.value = { value: message.topics, at_ms };
      break;
    case "report":
      reports.value = appended(reports.value, [message], REPORT_LIMIT, report_key, (report) => report.sent_ns);
      break;
    case "log":
      log.value = appended(log.value, message.records, LOG_LIMIT, log_key);
      break;
    case "recorder":
      recorder.value = { value: message, at_ms };
      break;
    case "player":
      player.value = { value: message, at_ms };
      break;
    case "problems":
      problems.value = message.problems;
      break;
    case "reply":
      break;
  }
}
