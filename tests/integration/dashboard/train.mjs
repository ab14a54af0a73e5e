// A real train for tests and measurements of the page: every service on simulated pictures at their own pace, and a browser.
//   RAILFIX_BUILD   build folder (build/release of this checkout when not set)
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export const build = process.env.RAILFIX_BUILD ?? fileURLToPath(new URL("../../../build/release", import.meta.url));
export const packages = createRequire(join(build, "services/monitor/page/work/package.json"));
const program = (name) => join(build, "bin", name);
export const ELSEWHERE = "train.example"; // a name of this computer that a monitor takes for another one's
const CHROMIUM = "/usr/bin/chromium";
const START_MS = 120000;
const DEFAULT_LINE_S = 500; // how long the drive takes over the shorter line

export const railfix = (...args) => execFileSync(program("railfix"), args, { encoding: "utf8" });

/// Until `test` gives something true; `what` is the sentence when it never does.
export async function until(what, test, patience_ms = 60000) {
  const end = Date.now() + patience_ms;
  for (;;) {
    const found = await test();
    if (found) return found;
    if (Date.now() > end) throw new Error(`${what}: not within ${patience_ms / 1000} s`);
    await new Promise((done) => setTimeout(done, 100));
  }
}

function free_port() {
  return new Promise((resolve) => {
    const server = createServer().listen(0, "127.0.0.1", () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });
}

/// A slow drive of so many seconds from before the first curve of a built-in line on: only the own track is drawn, which is quick.
export function simulate(folder, seconds) {
  railfix("simulate", "--out", folder, "--line", seconds > DEFAULT_LINE_S ? "long" : "default", "--start", "1:250", "--duration-s", String(seconds), "--speed-kmh", "25", "--rate-hz", "4",
    "--size", "640x512", "--format", "jpg", "--seed", "21", "--threads", "2", "--only-ahead-m", "40", "--only-beside-m", "2", "--quiet");
}

export class Train {
  lonely = [];
  nobodies = 0;

  static async start(seconds, settings = [], draw = simulate) {
    const train = new Train();
    train.settings = settings;
    train.folder = mkdtempSync(join(tmpdir(), "railfix-dashboard-"));
    try {
      draw(train.path("line"), seconds);
      train.port = await free_port();
      await train.run();
    } catch (error) {
      await train.stop();
      throw error;
    }
    return train;
  }

  path = (name) => join(this.folder, name);

  async run() {
    this.process = spawn(program("railfix"), ["run", "--dataset", this.path("line"), "--start", "1:250:+", "--pace", "real", "--out", this.path("out"),
      ...[`monitor.port=${this.port}`, ...this.settings].flatMap((one) => ["--set", one])]);
    let said = "";
    for (const stream of [this.process.stdout, this.process.stderr]) stream.on("data", (data) => (said += data));
    this.ended = new Promise((done) => this.process.on("exit", done));
    this.address = await until("railfix run says where its page is", () => {
      if (this.process.exitCode !== null) throw new Error(`railfix run has ended:\n${said}`);
      return /http:\/\/\S+/.exec(said)?.[0];
    }, START_MS);
  }

  /// Process number of one of its services.
  pid(service) {
    const wanted = program(`railfix-${service.replaceAll("_", "-")}`);
    const run = this.process.pid;
    const children = readdirSync(`/proc/${run}/task`).flatMap((task) => readFileSync(`/proc/${run}/task/${task}/children`, "utf8").split(" ")).filter(Boolean);
    const found = children.find((child) => readFileSync(`/proc/${child}/cmdline`, "utf8").split("\0")[0] === wanted);
    if (found === undefined) throw new Error(`${service} does not run`);
    return Number(found);
  }

  signal = (service, signal) => process.kill(this.pid(service), signal);

  start_monitor(...settings) {
    const set = settings.flatMap((one) => ["--set", one]);
    this.monitor = spawn(program("railfix-monitor"), ["--config", this.path("out/run.yaml"), ...set], { stdio: "ignore" });
  }

  /// A monitor of a train that nobody has heard; returns where its page is, and what starts a service beside it.
  async start_lonely_monitor(...settings) {
    const port = await free_port();
    const name = `nobody-${process.pid}-${++this.nobodies}`;
    const start = (service, ...settings) =>
      this.lonely.push(spawn(program(`railfix-${service}`), [`common.train_id=${name}`, ...settings].flatMap((one) => ["--set", one]), { stdio: "ignore" }));
    start("monitor", `monitor.port=${port}`, "monitor.expected=[]", "monitor.foxglove_port=-1", ...settings);
    const address = `http://127.0.0.1:${port}/`;
    await until("the lonely monitor answers", () => fetch(address).then((answer) => answer.ok, () => false), START_MS);
    return { address, start };
  }

  /// Ends the services; what was recorded stays until stop().
  async end_run() {
    this.monitor?.kill("SIGKILL");
    if (this.process !== undefined && this.process.exitCode === null) {
      this.process.kill("SIGTERM");
      await this.ended;
    }
  }

  /// The run's recording played to a train of another name, and a monitor for that one on the same address.
  start_replay() {
    const name = `replay-${process.pid}`;
    this.player = spawn(program("railfix"), ["replay", this.path("out/recording.mcap"), "--train", name, "--controlled", "--loop"], { stdio: "ignore" });
    this.start_monitor(`common.train_id=${name}`);
  }

  async stop() {
    for (const one of [this.player, ...this.lonely]) one?.kill("SIGKILL");
    await this.end_run();
    rmSync(this.folder, { recursive: true, force: true });
  }
}

export function browser() {
  if (!existsSync(CHROMIUM)) throw new Error(`${CHROMIUM} is missing: ./dev setup installs it`);
  return packages("playwright-core").chromium.launch({
    executablePath: CHROMIUM,
    args: [`--host-resolver-rules=MAP ${ELSEWHERE} 127.0.0.1`, "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
  });
}
