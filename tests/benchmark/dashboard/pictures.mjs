// Makes the dashboard's pictures of the documentation anew, from a running train (./dev build first):
//   node tests/benchmark/dashboard/pictures.mjs [FOLDER]     docs/images when not given
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { browser, railfix, Train, until } from "../../integration/dashboard/train.mjs";

const folder = process.argv[2] ?? fileURLToPath(new URL("../../../docs/images", import.meta.url));
const DRIVE_S = 150;
const LOOK_FROM_S = 35; // enough of the drive lies behind the train for the plots
const QUALITY = 82;
const DESK = { width: 1440, height: 1240 };
const TABLET = { width: 820, height: 1180 };
const PHONE = { width: 390, height: 1180 };
const sleep = (seconds) => new Promise((done) => setTimeout(done, seconds * 1000));

/// The ground, masts and bridges drawn as far as they are seen.
const draw = (to, seconds) => railfix("simulate", "--out", to, "--start", "1:250", "--duration-s", String(seconds), "--speed-kmh", "60",
  "--rate-hz", "10", "--size", "640x512", "--format", "jpg", "--seed", "21", "--threads", "2", "--quiet");

async function picture(page, name) {
  const devtools = await page.context().newCDPSession(page);
  const { data } = await devtools.send("Page.captureScreenshot", { format: "webp", quality: QUALITY });
  writeFileSync(join(folder, `dashboard-${name}.webp`), Buffer.from(data, "base64"));
  console.log(`dashboard-${name}.webp: ${Math.round((data.length * 3) / 4 / 1000)} kB`);
}

async function open(viewport, colorScheme) {
  const page = await chromium.newPage({ viewport, colorScheme });
  await page.goto(train.address);
  await page.locator("#figure-speed").waitFor();
  await until("the camera is shown", async () => /rails? (are|is)/i.test((await page.locator("#camera canvas").first().getAttribute("aria-label")) ?? ""));
  return page;
}

mkdirSync(folder, { recursive: true });
const train = await Train.start(DRIVE_S, [], draw);
const chromium = await browser();
try {
  const desk = await open(DESK, "light");
  await sleep(LOOK_FROM_S);
  await picture(desk, "desk-light");
  for (const [name, viewport] of [["tablet", TABLET], ["phone", PHONE]]) {
    const page = await open(viewport, "light");
    await sleep(3);
    await picture(page, name);
    await page.close();
  }
  train.signal("tpr_publisher", "SIGSTOP");
  await desk.locator(".problem.error", { hasText: "tpr_publisher" }).first().waitFor();
  await desk.emulateMedia({ colorScheme: "dark" });
  await sleep(2);
  await picture(desk, "desk-dark");
  train.signal("tpr_publisher", "SIGCONT");
  await train.end_run();
  train.start_replay();
  await desk.emulateMedia({ colorScheme: "light" });
  await desk.locator("#player:not(.stale)").waitFor();
  await sleep(12);
  await picture(desk, "replay");
} finally {
  await chromium.close();
  await train.stop();
}
