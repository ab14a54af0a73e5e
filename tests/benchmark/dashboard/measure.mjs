// What the dashboard costs, on a real train (./dev build first):
//   node tests/benchmark/dashboard/measure.mjs [MINUTES] [VIEWERS]     60 minutes, 10 viewers when not given
// Prints first paint, the processor time that so many viewers cost each service, and the page's memory while it stays open, then a
// verdict on each; ends with 1 when one of them is worse than wanted. Below 20 minutes growth is not judged.
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { browser, build, packages, Train } from "../../integration/dashboard/train.mjs";

const minutes = Number(process.argv[2] ?? 60);
const viewers = Number(process.argv[3] ?? 10);
const COST_S = 60; // each way
const SERVICES = ["frame_grabber", "sensor_gateway", "track_detector", "odometry", "map_matcher", "fusion", "tpr_publisher", "recorder", "monitor"];
const EVERYTHING = ["state", "services", "topics", "reports", "log", "recorder", "player", "curvature", "problems", "view:cam0"];
const WANTED = { paint_ms: 1000, more_percent: 3, kilobytes: 200 };
const WARM_MINUTES = 5; // until everything that is kept for a while is full
const NOISE_MB = 0.2;
const JUDGED_FROM_MINUTES = 20;
const TICKS_PER_S = 100; // of /proc/PID/stat
const sleep = (seconds) => new Promise((done) => setTimeout(done, seconds * 1000));
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

const verdicts = [];
function judge(good, what) {
  verdicts.push(good);
  console.log(`${good ? "PASS" : "FAIL"}: ${what}`);
}

/// Percent of one core, by service, over the next seconds.
async function load(train, seconds) {
  const ticks = () => SERVICES.map((service) => {
    const fields = readFileSync(`/proc/${train.pid(service)}/stat`, "utf8").split(") ")[1].split(" ");
    return Number(fields[11]) + Number(fields[12]);
  });
  const before = ticks();
  const began = performance.now();
  await sleep(seconds);
  const after = ticks();
  const passed_s = (performance.now() - began) / 1000;
  return after.map((value, i) => (100 * (value - before[i])) / TICKS_PER_S / passed_s);
}

async function cost_of_viewers(train) {
  const WebSocket = packages("ws");
  const without = await load(train, COST_S);
  let frames = 0;
  let bytes = 0;
  const sockets = Array.from({ length: viewers }, () => {
    const socket = new WebSocket(train.address.replace("http", "ws") + "api/live");
    socket.on("open", () => socket.send(JSON.stringify({ watch: EVERYTHING })));
    socket.on("message", (data) => {
      ++frames;
      bytes += data.length;
    });
    return socket;
  });
  await sleep(5);
  [frames, bytes] = [0, 0];
  const began = performance.now();
  const with_them = await load(train, COST_S);
  const passed_s = (performance.now() - began) / 1000;
  for (const socket of sockets) socket.close();
  console.log(`\n${viewers} viewers who watch everything: ${(frames / passed_s / viewers).toFixed(0)} frames and ${(bytes / passed_s / viewers / 1000).toFixed(0)} kB a second each`);
  console.log("service            without      with   (percent of one core)");
  SERVICES.forEach((service, i) => console.log(`${service.padEnd(17)} ${without[i].toFixed(1).padStart(8)} ${with_them[i].toFixed(1).padStart(9)}`));
  const sum = (values) => values.slice(0, -1).reduce((a, b) => a + b);
  const more = sum(with_them) - sum(without);
  console.log(`all but monitor   ${sum(without).toFixed(1).padStart(8)} ${sum(with_them).toFixed(1).padStart(9)}: ${more.toFixed(1)} more`);
  judge(more < WANTED.more_percent, `${viewers} viewers cost the services ${more.toFixed(1)} % of a core (wanted: < ${WANTED.more_percent})`);
}

async function first_paint(train, chromium) {
  const times = [];
  for (let i = 0; i < 7; ++i) {
    const context = await chromium.newContext({ viewport: { width: 1440, height: 900 } });
    const page = await context.newPage();
    await page.goto(train.address);
    await page.locator("#figure-speed").waitFor();
    await page.waitForFunction(() => performance.getEntriesByName("first-contentful-paint").length > 0);
    times.push(await page.evaluate(() => ({ paint: performance.getEntriesByName("first-contentful-paint")[0].startTime, figures: performance.now() })));
    await context.close();
  }
  console.log(`first paint: median ${median(times.map((one) => one.paint)).toFixed(0)} ms, worst ${Math.max(...times.map((one) => one.paint)).toFixed(0)} ms; `
    + `with the train's figures: median ${median(times.map((one) => one.figures)).toFixed(0)} ms (7 loads, empty cache)`);
  const paint_ms = median(times.map((one) => one.paint));
  judge(paint_ms < WANTED.paint_ms, `first paint ${paint_ms.toFixed(0)} ms (wanted: < ${WANTED.paint_ms})`);
}

async function memory(train, chromium) {
  const page = await chromium.newPage({ viewport: { width: 1440, height: 3000 } }); // so high that every panel is live
  await page.goto(train.address);
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Performance.enable");
  console.log("\nminutes open   heap MB   DOM nodes   listeners");
  const heap_mb = [];
  for (let minute = 0; minute <= minutes; ++minute) {
    await sleep(minute === 0 ? 15 : 60);
    await devtools.send("HeapProfiler.collectGarbage");
    const { metrics } = await devtools.send("Performance.getMetrics");
    const of = (name) => metrics.find((one) => one.name === name).value;
    heap_mb.push(of("JSHeapUsedSize") / 1e6);
    const row = [(of("JSHeapUsedSize") / 1e6).toFixed(2).padStart(9), String(of("Nodes")).padStart(11), String(of("JSEventListeners")).padStart(11)];
    console.log(`${String(minute).padStart(12)} ${row.join(" ")}`);
  }
  judge_growth(heap_mb);
}

/// Medians of the first and the last third, without the time in which what is kept for a while fills.
function judge_growth(heap_mb) {
  if (minutes < JUDGED_FROM_MINUTES) return console.log(`not judged: growth; that takes ${JUDGED_FROM_MINUTES} minutes or more, 60 are wanted`);
  const warm = heap_mb.slice(WARM_MINUTES);
  const third = Math.floor(warm.length / 3);
  const [first, last] = [median(warm.slice(0, third)), median(warm.slice(-third))];
  judge(last - first < NOISE_MB, `heap ${first.toFixed(2)} MB in the first third after minute ${WARM_MINUTES}, ${last.toFixed(2)} MB in the last of ${minutes} minutes (wanted: no growth, noise ${NOISE_MB} MB)`);
}

const page = join(build, "share/monitor/page");
const files = ["index.html", ...readdirSync(join(page, "assets")).map((file) => join("assets", file))];
const size = files.reduce((sum, file) => sum + gzipSync(readFileSync(join(page, file))).length, 0);
console.log(`page, styles and scripts: ${(size / 1000).toFixed(1)} kB compressed`);
judge(size / 1000 < WANTED.kilobytes, `page ${(size / 1000).toFixed(1)} kB (wanted: < ${WANTED.kilobytes})`);
console.log(`drawing a drive of ${minutes + 5} minutes, which takes a while ...`);
const train = await Train.start(minutes * 60 + 3 * COST_S + 120);
try {
  const chromium = await browser();
  await first_paint(train, chromium);
  await cost_of_viewers(train);
  await memory(train, chromium);
  await chromium.close();
} finally {
  await train.stop();
}
const failed = verdicts.filter((good) => !good).length;
console.log(failed === 0 ? "\nPASS: all as wanted" : `\nFAIL: ${failed} of ${verdicts.length} worse than wanted`);
process.exit(failed === 0 ? 0 : 1);
