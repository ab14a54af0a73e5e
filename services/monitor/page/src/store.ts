// All that the page knows. Everything is bounded: an hour open holds no more than a minute does.
import { computed, signal } from "@preact/signals";
import { age_s, appended, FRESH_S, freshness, type Freshness, type Held, LATE_S, LinkDelay, nothing } from "./stale";
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
export const picture = signal<Held<Picture>>(nothing());
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
/// How long what comes now has waited: on the link, or for this browser.
export const late_s = signal(0);
export const is_late = computed(() => late_s.value > LATE_S);
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
const held: Record<Kind, { value: Held<unknown> }> = { state, curvature, picture, services, topics, recorder, player };

export function age_of(kind: Kind, at_ms = passed_ms.value): number {
  const one = held[kind].value;
  return age_s(one, at_ms, kind === "state" ? ((one.value as TrainState | null)?.age_s ?? 0) : 0);
}
export const fresh = (kind: Kind, at_ms = passed_ms.value): Freshness => freshness(age_of(kind, at_ms), FRESH_S[kind], connection.value.up);

const link = new LinkDelay();
const note_sending = (sent_ns: number | undefined, at_ms: number) => {
  if (sent_ns !== undefined) late_s.value = link.late_s(sent_ns / 1e6, at_ms);
};

const CLOCK_SET_MS = 1000;
/// A clock may be set, here or there; what merely trembles changes nothing that is shown.
function note_clock(now_ns: number): void {
  const offset_ms = Date.now() - late_s.value * 1000 - now_ns / 1e6;
  if (Math.abs(offset_ms - clock_offset_ms.value) > CLOCK_SET_MS) clock_offset_ms.value = offset_ms;
}

/// A monitor that has just begun knows of none; what we hold grows old.
function take_state(message: Partial<TrainState>, at_ms: number): void {
  if (message.edge === undefined) return;
  state.value = { value: message as TrainState, at_ms, late_s: late_s.value };
}

let train: string | null = null;
/// On this address there is another train now.
function forget(): void {
  for (const one of Object.values(held)) one.value = nothing();
  last_image?.close();
  last_image = null;
  views = [];
  about.value = null;
  map.value = null;
  reports.value = [];
  log.value = [];
  history.value = [];
}

/// Called once a second.
export function remember_moment(at_ms: number): void {
  const live = fresh("state", performance.now()) === "live" ? state.value.value : null; // also while nobody sees the page
  const moment = { at_ms, speed_mps: live?.speed_mps ?? null, over_m: live?.over_m ?? null, under_m: live?.under_m ?? null };
  history.value = history.value.concat(moment).slice(-HISTORY_LIMIT);
}

let last_image: ImageBitmap | null = null;
/// `at_ms`, `waited_s`: when it came, and how long it had waited then; it is as old as that however long its decoding takes.
export function show_picture(next: Omit<Picture, "view">, at_ms: number, waited_s: number): void {
  const seen = views.find((one) => one.camera === next.camera && one.stamp_ns === next.stamp_ns) ?? null;
  picture.value = { value: { ...next, view: seen }, at_ms, late_s: waited_s };
  last_image?.close();
  last_image = next.image;
}

const report_key = (report: Report) => `${report.stamp_ns} ${report.seq}`;
const log_key = (record: LogRecord) => `${record.stamp_ns} ${record.host} ${record.service} ${record.text}`;

/// In this browser's time.
function take_problems(list: Problem[], now_ns: number | undefined): void {
  const offset_ms = now_ns === undefined ? clock_offset_ms.value : Date.now() - late_s.value * 1000 - now_ns / 1e6;
  problems.value = list.map((one) => ({ ...one, since_ns: one.since_ns + offset_ms * 1e6 }));
}

function take_beat(message: Extract<Message, { kind: "beat" }>): void {
  note_clock(message.now_ns);
  const known = about.value;
  if (known !== null && known.cameras.join() !== message.cameras.join()) about.value = { ...known, cameras: message.cameras };
}

/// Notes how late a message is; at once when it comes, so that waiting here counts, too.
export function note_arrival(message: Message, at_ms: number): void {
  if (message.kind === "beat" || message.kind === "state") note_sending(message.sent_ns, at_ms);
}

/// Everything but replies, which belong to whoever asked.
export function take(message: Message, at_ms = performance.now()): void {
  const came = { at_ms, late_s: late_s.value };
  switch (message.kind) {
    case "hello":
      if (train !== null && train !== message.train) forget();
      train = message.train;
      problems.value = null; // of the connection before
      link.reset();
      late_s.value = 0;
      clock_offset_ms.value = Date.now() - message.now_ns / 1e6;
      break;
    case "beat":
      take_beat(message);
      break;
    case "state":
      take_state(message, at_ms);
      break;
    case "curvature":
      curvature.value = { value: message, ...came };
      break;
    case "view":
      views = views.concat(message).slice(-VIEWS_KEPT);
      break;
    case "services":
      services.value = { value: message.services, ...came };
      break;
    case "topics":
      topics.value = { value: message.topics, ...came };
      break;
    case "report":
      reports.value = appended(reports.value, [message], REPORT_LIMIT, report_key, (report) => report.sent_ns);
      break;
    case "log":
      log.value = appended(log.value, message.records, LOG_LIMIT, log_key);
      break;
    case "recorder":
      recorder.value = { value: message, ...came };
      break;
    case "player":
      player.value = { value: message, ...came };
      break;
    case "problems":
      take_problems(message.problems, message.now_ns);
      break;
    case "reply":
      break;
  }
}
