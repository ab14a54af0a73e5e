// A made-up train that speaks the monitor's protocol, to work on the page without one:
//   npm run build && npm run mock -- [PORT] [well|no_gnss|blind|dead|unknown|disk_full|no_recorder|replay|silent|unheard]
import { createReadStream, existsSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";
import { curvature_at, line_map } from "./mock_line.mjs";
import { problems_of, recorder_of, services_of, topics_of } from "./mock_health.mjs";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };
const here = fileURLToPath(new URL(".", import.meta.url));
const now_ns = () => Date.now() * 1e6;

export function start_train({ port = 0, scenario = "well", page = join(here, "..", "dist"), picture = null } = {}) {
  const map = line_map();
  const began = Date.now();
  const commands = [];
  let recorder_state = scenario === "disk_full" ? "stopped" : "recording";

  const server = createServer((request, response) => {
    const path = new URL(request.url, "http://x").pathname;
    const json = (value) => response.setHeader("content-type", "application/json").end(JSON.stringify(value));
    if (path === "/api/about") {
      return json({ train: "re460-042", version: "0.1.0", host: "cab", now_ns: now_ns(), cameras: ["cam0"], control: "open",
        map: { name: "Made-up valley line", edges: map.edges.length, length_m: 12000 } });
    }
    if (path === "/api/map") return json(map);
    const file = join(page, normalize(path === "/" ? "/index.html" : path));
    if (!existsSync(file)) return response.writeHead(404).end();
    response.setHeader("content-type", TYPES[extname(file)] ?? "application/octet-stream");
    createReadStream(file).pipe(response);
  });

  function state() {
    const t = (Date.now() - began) / 1000;
    const offset_m = 1400 + ((t * 20) % 2500);
    const at = map.at(1, offset_m);
    const unknown = scenario === "unknown";
    const wide = scenario === "blind" ? 14 : 0.6;
    return {
      kind: "state", stamp_ns: now_ns(), age_s: 0.03, sent_ns: performance.now() * 1e6, edge: 1, offset_m, distance_m: offset_m - 1400, speed_mps: 20 + Math.sin(t / 9),
      acceleration_mps2: 0.11 * Math.cos(t / 9), over_m: wide + 0.2 * Math.sin(t / 4), under_m: wide + 0.3 + 0.2 * Math.sin(t / 4), sigma_m: wide / 4,
      integrity: unknown ? "unusable" : scenario === "blind" ? "degraded" : "ok", track_known: !unknown,
      track_probability: unknown ? 0.55 : 0.99993, direction: "forward", standstill: false,
      sources: ["wheel", "imu", ...(scenario === "blind" ? [] : ["camera", "curvature", "landmark"]), ...(scenario === "no_gnss" ? [] : ["gnss"])],
      reference: "123-4567", since_reference_m: 182.4, lat: 46.9481 + offset_m * 1e-6, lon: 7.4474, easting_m: at[0], northing_m: at[1], heading_rad: at[2],
      pose: null,
      alternatives: unknown ? [{ edge: 1, offset_m, probability: 0.55 }, { edge: 2, offset_m: 300, probability: 0.41 }] : [],
    };
  }

  function curvature() {
    const offset = state().offset_m;
    const steps = Array.from({ length: 61 }, (_, i) => i * 2 - 90);
    return {
      kind: "curvature", stamp_ns: now_ns(), edge: 1, offset_m: offset,
      measured: steps.filter((a) => a <= 20).map((a) => [a, curvature_at(offset + a) + 6e-5 * Math.sin((offset + a) / 5), 1e-4]),
      map: steps.map((a) => [a, curvature_at(offset + a)]),
    };
  }

  function view() {
    const blind = scenario === "blind";
    const bend = curvature_at(state().offset_m) * 4e4;
    const rail = (x0, x1) => // roughly where the picture of a simulated line has them
      Array.from({ length: 16 }, (_, i) => [x0 + ((x1 - x0) * i) / 15 - bend * (i / 15) ** 2, 500 - i * 15]);
    return {
      kind: "view", camera: "cam0", stamp_ns: now_ns(), width: 640, height: 512,
      rails: blind ? null : { left: rail(180, 300), right: rail(460, 340) }, seen: !blind, why: blind ? "no edges found" : "",
      landmarks: blind ? [] : [{ kind: "mast", name: "Mast 12/7", ahead_m: 31.2, across_m: -3.1, x: 430, y: 250, side: "right" }],
      health: blind ? ["covered", "blurred"] : [],
    };
  }

  const hex = "880601D6F345402AF34000E48F68EB84D250014010C38830";
  const report = (seq, ago_s = 0) => ({
    kind: "report", stamp_ns: now_ns() - ago_s * 1e9, sent_ns: now_ns() - ago_s * 1e9, seq, reason: seq % 5 === 0 ? "balise_group" : "cycle_time", nid_packet: 0, baseline: 3,
    nid_lrbg: seq < 3 ? null : 2019799, d_lrbg_m: seq < 3 ? null : 1234, q_dirlrbg: 1, q_dlrbg: 1, l_doubtover_m: 10, l_doubtunder_m: 67, v_train_kmh: 140, hex,
  });

  const sockets = new WebSocketServer({ server, path: "/api/live" });
  sockets.on("connection", (socket) => {
    let watch = new Set();
    let ticks = 0;
    let seq = 20;
    const say = (value) => socket.send(JSON.stringify(value));
    say({ kind: "hello", train: "re460-042", version: "0.1.0", host: "cab", now_ns: now_ns() });
    const jpeg = picture === null ? null : readFileSync(picture);

    const speak = {
      state: [1, () => say(scenario === "unheard" ? { kind: "state", age_s: null } : scenario === "silent" && ticks > 30 ? { ...state(), age_s: (ticks - 30) / 10 } : state())],
      curvature: [2, () => say(curvature())],
      services: [5, () => say({ kind: "services", services: services_of(scenario, began) })],
      topics: [10, () => say({ kind: "topics", topics: topics_of(scenario) })],
      recorder: [10, () => say(recorder_of(scenario, recorder_state, began))],
      player: [1, () => say(player())],
      reports: [60, () => say(report(++seq))],
      log: [17, () => say({ kind: "log", records: [line(ticks)] })],
      "view:cam0": [2, () => {
        const now = view();
        say(now);
        if (jpeg === null) return;
        const header = Buffer.from(JSON.stringify({ kind: "picture", camera: "cam0", stamp_ns: now.stamp_ns }));
        const length = Buffer.alloc(4);
        length.writeUInt32LE(header.length);
        socket.send(Buffer.concat([length, header, jpeg]));
      }],
    };
    const timer = setInterval(() => {
      ++ticks;
      if (ticks % 10 === 0) say({ kind: "beat", sent_ns: performance.now() * 1e6, now_ns: now_ns(), cameras: ["cam0"] });
      for (const one of watch) if (speak[one] && ticks % speak[one][0] === 0) speak[one][1]();
    }, 100);
    socket.on("close", () => clearInterval(timer));
    socket.on("message", (data) => {
      const message = JSON.parse(data);
      if (message.watch) {
        const fresh = message.watch.filter((one) => !watch.has(one));
        watch = new Set(message.watch);
        if (fresh.includes("problems")) say({ kind: "problems", now_ns: now_ns(), problems: problems_of(scenario, began) });
        if (fresh.includes("reports")) for (let i = 0; i < 20; ++i) say(report(i + 1, 120 - i * 6));
        if (fresh.includes("log")) say({ kind: "log", records: Array.from({ length: 40 }, (_, i) => line(i - 40)) });
        for (const one of fresh) if (["services", "topics", "recorder"].includes(one)) speak[one][1]();
      }
      if (message.control) {
        commands.push(message.control);
        const next = { start: "recording", stop: "stopped", pause: "paused", resume: "recording" }[message.control.command];
        if (message.control.service === "recorder" && next) recorder_state = next;
        say({ kind: "reply", id: message.control.id, done: true, text: `${message.control.command}: done` });
        if (watch.has("recorder")) speak.recorder[1]();
      }
    });
  });

  function player() {
    if (scenario !== "replay") return { kind: "player", absent: true };
    const t = ((Date.now() - began) / 1000) % 600;
    const from = 1763700000e9;
    return { kind: "player", stamp_ns: now_ns(), from_ns: from, to_ns: from + 600e9, at_ns: from + t * 1e9, rate: 1, state: "playing", looped: true, lock_step: false, file: "drive-2026-11-20.mcap" };
  }

  return new Promise((resolve) =>
    server.listen(port, "127.0.0.1", () =>
      resolve({
        address: `http://127.0.0.1:${server.address().port}/`,
        commands,
        close: () => {
          for (const socket of sockets.clients) socket.terminate();
          return new Promise((done) => server.close(done));
        },
      }),
    ),
  );
}

const LINES = [
  ["info", "fusion", "Reference is now balise group 123-4567."],
  ["info", "recorder", "A new file is begun: drive-0007.mcap."],
  ["warning", "track_detector", "The left rail is not seen for 12 pictures."],
  ["debug", "odometry", "Back to frame-to-frame tracking."],
  ["error", "tpr_publisher", "The ground link is closed by the other side; trying again."],
];
function line(i) {
  const [level, service, text] = LINES[((i % 5) + 5) % 5];
  return { stamp_ns: Math.round(now_ns() + Math.min(0, i) * 2e9 + i), service, host: "cab", level, text };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [port = "8090", scenario = "well", picture = null] = process.argv.slice(2);
  const train = await start_train({ port: Number(port), scenario, picture });
  console.log(`a made-up train (${scenario}) at ${train.address}`);
}
