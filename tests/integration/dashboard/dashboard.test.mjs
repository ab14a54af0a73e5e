// What a dispatcher sees, asserted panel by panel on a running train. Pictures of it are kept in <build>/screenshots.
import assert from "node:assert/strict";
import { mkdirSync, readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { gzipSync } from "node:zlib";
import { browser, build, ELSEWHERE, packages, railfix, Train, until } from "./train.mjs";

const SERVICES = ["frame_grabber", "fusion", "map_matcher", "monitor", "odometry", "recorder", "sensor_gateway", "tpr_publisher", "track_detector"];
const DESK = { width: 1440, height: 900 };
const PHONE = { width: 390, height: 844 };
const TOKEN = "a word for the test";
const DRIVE_S = 420; // far longer than the test on a slow machine; it is cut short at the end

let train, chromium, page;
const errors = []; // of the page's own code
const watched = []; // lists that the page has sent

async function open(viewport, scheme, address = train.address) {
  const one = await chromium.newPage({ viewport, colorScheme: scheme });
  one.setDefaultTimeout(60000);
  one.on("pageerror", (error) => errors.push(String(error)));
  one.on("websocket", (socket) =>
    socket.on("framesent", ({ payload }) => {
      const list = JSON.parse(payload).watch;
      if (list !== undefined && one === page) watched.push(list);
    }),
  );
  await one.goto(address);
  return one;
}

const text = (selector) => page.locator(selector).first().innerText();
const label = (panel, i = 0) => page.locator(`#${panel} canvas`).nth(i).getAttribute("aria-label");
const show = (panel) => page.locator(`#${panel}`).scrollIntoViewIfNeeded();

/// How many pixels of a canvas are within 40 of a colour (0 to 255 each).
function pixels(panel, [r, g, b], i = 0) {
  return page.locator(`#${panel} canvas`).nth(i).evaluate((canvas, wanted) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let at = 0; at < data.length; at += 4) {
      if (data[at + 3] > 200 && wanted.every((value, k) => Math.abs(data[at + k] - value) < 40)) ++count;
    }
    return count;
  }, [r, g, b]);
}

async function picture(name, which = page) {
  mkdirSync(join(build, "screenshots"), { recursive: true });
  await which.screenshot({ path: join(build, "screenshots", `${name}.png`) });
}

before(async () => {
  train = await Train.start(DRIVE_S, [`monitor.token=${TOKEN}`]);
  chromium = await browser();
  page = undefined;
  page = await open(DESK, "light");
}, { timeout: 600000 });

after(async () => {
  await chromium?.close();
  await train?.stop();
});

describe("the page", { timeout: 600000 }, () => {
  it("is small", () => {
    const folder = join(build, "share/monitor/page/assets");
    const bytes = readdirSync(folder).reduce((sum, file) => sum + gzipSync(readFileSync(join(folder, file))).length, 0);
    assert.ok(bytes < 200000, `${bytes} bytes`);
  });

  it("says speed, place, interval, track and integrity with their units", async () => {
    await until("the train moves", async () => /^\d+\.\d\skm\/h$/.test(await text("#figure-speed .value")) && parseFloat(await text("#figure-speed .value")) > 1);
    assert.match(await text("#figure-motion .value"), /^Moving$/);
    assert.match(await text("#figure-position .value"), /^\d+\.\d\sm$/);
    assert.match(await text("#figure-interval .value"), /^\d+(\.\d+)?\sm behind \/ \d+(\.\d+)?\sm ahead$/);
    assert.match(await text("#figure-track .note"), /certain, (> )?\d/);
    assert.match(await text("#figure-integrity .value"), /^(Good|Degraded)$/);
    await until("the camera holds the position", async () => (await page.locator("#figure-integrity .sources .on", { hasText: "camera" }).count()) === 1);
    await until("it is live", async () => (await page.locator("#numbers.stale").count()) === 0);
    assert.match(await text(".connection"), /Connected/);
    await until("the title names the train", async () => /run-\d+ Railfix/.test(await page.title()));
  });

  it("draws the train on its line, with its interval along the track", async () => {
    await until("the train is on the map", async () => /Train on .+ at [\d.]+\sm/.test((await label("line")) ?? ""));
    assert.match(await label("line", 1), /at most [\d.]+\sm behind and [\d.]+\sm ahead/);
    await until("the train is drawn", async () => (await pixels("line", [10, 88, 168])) > 30 && (await pixels("line", [10, 88, 168], 1)) > 30);
    assert.ok((await pixels("line", [118, 129, 143])) > 100, "the track");
    await page.getByRole("button", { name: "Whole line" }).click();
    assert.equal(await page.getByRole("button", { name: "Follow" }).getAttribute("aria-pressed"), "false");
    await picture("whole-line");
    await page.getByRole("button", { name: "Follow" }).click();
  });

  it("shows the camera with the rails drawn over it", async () => {
    await until("both rails are seen", async () => /Both rails are seen/.test((await label("camera")) ?? ""));
    await until("rails are drawn", async () => (await pixels("camera", [24, 224, 255])) > 200);
    assert.equal(await page.locator("#camera canvas").evaluate((canvas) => `${canvas.width}x${canvas.height}`), "640x512");
  });

  it("plots the measured curvature against the map's, speed and interval over time", async () => {
    await show("curvature");
    await until("curvature is measured", async () => /Measured (left|right|straight).*, map (left|right|straight)/.test((await label("curvature")) ?? ""));
    await until("the curve is drawn", async () => (await pixels("curvature", [10, 88, 168])) > 50);
    await show("history");
    await until("speed is drawn", async () => (await pixels("history", [10, 88, 168])) > 10);
    assert.match(await label("history", 1), /behind and [\d.]+\sm ahead/);
  });

  it("lists the position reports and unfolds a message as the decoder does", async () => {
    await show("reports");
    const first = page.locator("#reports tbody tr").first();
    await first.waitFor();
    assert.match(await first.innerText(), /km\/h/);
    await page.locator("#reports tbody button").first().click();
    const hex = (await text("#reports .hex")).replaceAll(" ", "");
    const decoded = JSON.parse(railfix("tpr", "decode", hex, "--json"));
    const shown = Object.fromEntries(await page.locator("#reports .unfolded tbody tr").evaluateAll((rows) => rows.map((row) => [row.cells[0].textContent, Number(row.cells[2].textContent)])));
    assert.equal(shown.NID_MESSAGE, 136);
    assert.ok(Object.keys(shown).length >= 16);
    for (const [name, value] of Object.entries(shown)) assert.equal(decoded[name], value, name);
    await picture("report-unfolded");
    await page.locator("#reports tbody button").first().click();
  });

  it("shows the health of every service", async () => {
    await show("services");
    await until("every service is there", async () => (await page.locator("#services tbody tr").count()) === SERVICES.length);
    const names = await page.locator("#services tbody th").allInnerTexts();
    assert.deepEqual(names.map((name) => name.split(/\s/)[0]).sort(), SERVICES);
    assert.match(await text("#services tbody tr"), /MB/);
    assert.match(await text("#services .aside"), /^\d of 9 well · \d+\s% of a core/);
    await until("all of them are alive", async () => (await page.locator("#services .state").allInnerTexts()).every((state) => /^(active|ready|degraded)$/.test(state)));
  });

  it("shows every topic with its rate", async () => {
    await show("topics");
    const row = page.locator("#topics tbody tr", { hasText: "train_state" });
    await until("train_state flows", async () => parseFloat(await row.locator("td").first().innerText()) > 1);
    assert.match(await row.innerText(), /\d\sms/);
    const heads = await page.locator("#topics thead th").allInnerTexts();
    const cell = async (name) => row.locator("th, td").nth(heads.findIndex((head) => head.startsWith(name))).innerText();
    assert.match(await cell("Bandwidth"), /^[\d.]+\s[kM]?B\/s$/);
    assert.match(await cell("Age"), /^[\d.]+\s(ms|s)$/);
    assert.match(await cell("Gaps"), /^\d+/);
    assert.match(await page.locator("#topics tbody tr", { hasText: "camera_frame" }).innerText(), /not listened to/);
  });

  it("filters the log by service, level and text", async () => {
    await show("log");
    const lines = page.locator("#log li");
    await lines.first().waitFor();
    const all = await lines.count();
    const service = await lines.locator("i").last().innerText();
    await page.getByLabel("Service", { exact: true }).selectOption(service);
    assert.ok((await lines.count()) <= all);
    for (const said of await lines.locator("i").allInnerTexts()) assert.equal(said, service);
    const words = (await lines.locator("span").last().innerText()).slice(0, 12);
    await page.getByLabel("Text", { exact: true }).fill(words);
    for (const said of await lines.locator("span").allInnerTexts()) assert.ok(said.toLowerCase().includes(words.toLowerCase()), said);
    await page.getByLabel("Text", { exact: true }).fill("no such words");
    await page.getByText("Nothing matches the filter.").waitFor();
    await page.getByLabel("Text", { exact: true }).fill("");
    await page.getByLabel("Service", { exact: true }).selectOption("");
    await page.getByLabel("From level", { exact: true }).selectOption("warning");
    for (const level of await lines.locator("b").allInnerTexts()) assert.match(level, /^(warning|error|critical)$/);
    await page.getByLabel("From level", { exact: true }).selectOption("info");
    assert.equal(await lines.count() >= all, true, "everything is there again");
  });

  it("controls the recorder and shows what it does", async () => {
    await show("recorder");
    const state = page.locator("#recorder .facts .state");
    const press = (name) => page.locator("#recorder").getByRole("button", { name, exact: true }).click();
    const becomes = (word) => page.locator("#recorder .facts .state", { hasText: word }).waitFor();
    await becomes("Recording");
    const stop = page.locator("#recorder").getByRole("button", { name: "Stop", exact: true });
    assert.ok(await stop.isDisabled(), "nobody controls anything without the token");
    await page.getByLabel("Token for control").fill("a guess");
    await press("Pause");
    await until("a wrong token is refused", async () => (await text("#recorder .answer")) === "the token is wrong");
    assert.match(await state.innerText(), /Recording/);
    await page.getByLabel("Token for control").fill(TOKEN);
    assert.match(await text("#recorder .facts"), /recording\.mcap[\s\S]*\d+ messages[\s\S]*Disk free\s+[\d.]+\s[MGT]B/);
    await press("Pause");
    await becomes("Paused");
    await page.locator(".problem", { hasText: "Nothing is being recorded" }).waitFor();
    await press("Go on");
    await becomes("Recording");
    await page.getByLabel("What happened").fill("Deer on the track");
    await press("Mark event");
    await until("the event is shown", async () => /Last event\s+Deer on the track, /.test(await text("#recorder .facts")));
    await press("Protect this file");
    await until("the recorder answers", async () => /recording\.mcap/.test(await text("#recorder .answer")));
    assert.match(await state.innerText(), /Recording/);
    await press("Stop");
    await becomes("Stopped");
    await page.locator(".problem", { hasText: "Nothing is being recorded" }).waitFor();
    await press("Start");
    await becomes("Recording");
    await until("another file is written beside the first", async () => /recording-2\.mcap/.test(await text("#recorder .facts")));
    await page.locator(".problem", { hasText: "Nothing is being recorded" }).waitFor({ state: "detached" });
    await picture("recorder");
  });

  it("asks only for what can be seen", async () => {
    await page.evaluate(() => scrollTo(0, 0));
    await until("the camera is watched", () => watched.at(-1)?.includes("view:cam0"));
    await until("the log below is not", () => !watched.at(-1)?.includes("log"));
    await page.getByRole("button", { name: "Camera", exact: true }).click();
    await until("a closed panel is not watched", () => !watched.at(-1)?.includes("view:cam0"));
    await page.getByRole("button", { name: "Camera", exact: true }).click();
    const hide = (state) =>
      page.evaluate((value) => {
        Object.defineProperty(document, "visibilityState", { value, configurable: true });
        document.dispatchEvent(new Event("visibilitychange"));
      }, state);
    await hide("hidden");
    await until("a hidden page asks for the problems only", () => watched.at(-1)?.join() === "problems");
    await hide("visible");
    await until("it comes back", async () => watched.at(-1)?.includes("state") && (await page.locator("#numbers.stale").count()) === 0);
  });

  it("is used with the keyboard", async () => {
    const skip = page.getByRole("link", { name: "To the train" });
    await skip.focus();
    assert.ok((await skip.boundingBox()).x >= 0, "the skip link is seen when it has the focus");
    await page.keyboard.press("Enter");
    assert.equal(await page.evaluate(() => document.activeElement.id), "numbers");
    const camera = page.getByRole("button", { name: "Camera", exact: true });
    await camera.focus();
    assert.notEqual(await camera.evaluate((button) => getComputedStyle(button).outlineStyle), "none");
    await page.keyboard.press("Enter");
    assert.equal(await camera.getAttribute("aria-expanded"), "false");
    await page.keyboard.press("Space");
    assert.equal(await camera.getAttribute("aria-expanded"), "true");
    await page.locator(".map-hold").focus();
    await page.keyboard.press("ArrowLeft");
    assert.equal(await page.getByRole("button", { name: "Follow" }).getAttribute("aria-pressed"), "false");
    await page.keyboard.press("Home");
    assert.equal(await page.getByRole("button", { name: "Follow" }).getAttribute("aria-pressed"), "true");
  });

  for (const [name, viewport, scheme] of [["desk-light", DESK, "light"], ["desk-dark", DESK, "dark"], ["phone", PHONE, "light"], ["phone-dark", PHONE, "dark"]]) {
    it(`has no barrier that axe finds (${name}) and fits its window`, async () => {
      const one = await open(viewport, scheme);
      await one.locator("#figure-speed").waitFor();
      await one.locator("#camera canvas").waitFor();
      await one.evaluate(packages("axe-core").source);
      const found = await one.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
      const said = found.violations.map((rule) => `${rule.id}: ${rule.nodes.map((node) => `${node.target} ${node.failureSummary}`).join("; ")}`);
      assert.deepEqual(said, []);
      assert.ok(await one.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), "it must not scroll sideways");
      await picture(name, one);
      await one.close();
    });
  }

  it("says plainly when a service is frozen, and when it is back", async () => {
    train.signal("tpr_publisher", "SIGSTOP");
    const problem = page.locator(".problem.error", { hasText: "tpr_publisher" }).first();
    await problem.waitFor();
    assert.match(await problem.innerText(), /Error[\s\S]*tpr_publisher[\s\S]*since \d\d:\d\d:\d\d/);
    await show("services");
    await page.locator("#services tr", { hasText: "tpr_publisher" }).locator(".state.bad").first().waitFor();
    await page.evaluate(() => scrollTo(0, 0));
    await page.emulateMedia({ colorScheme: "dark" });
    await picture("service-frozen-dark");
    await page.emulateMedia({ colorScheme: "light" });
    train.signal("tpr_publisher", "SIGCONT");
    await problem.waitFor({ state: "detached" });
  });

  it("tells a missing token from control that is switched off", async () => {
    const said = { "": "Control from here needs a token, and none is set", "monitor.control=false": "Control is switched off" };
    for (const [setting, words] of Object.entries(said)) {
      const { address, start } = await train.start_lonely_monitor(...(setting === "" ? [] : [setting]));
      start("recorder", `recorder.folder=${train.path("lonely")}`);
      const one = await open(DESK, "light", address.replace("127.0.0.1", ELSEWHERE));
      await one.locator("#recorder").scrollIntoViewIfNeeded();
      await one.locator("#recorder .nothing", { hasText: words }).waitFor();
      assert.ok(await one.locator("#recorder").getByRole("button", { name: "Stop", exact: true }).isDisabled());
      await one.close();
    }
  });

  it("does not call a train well of which nothing, or no position, was heard", async () => {
    const { address, start } = await train.start_lonely_monitor();
    const one = await open(DESK, "light", address);
    const nobody = one.locator(".problem", { hasText: "No service of this train has been heard yet" });
    await nobody.waitFor();
    assert.equal(await one.locator("#problems .fine").count(), 0);
    await picture("nobody-heard", one);
    start("fusion");
    await nobody.waitFor({ state: "detached" });
    await one.locator("#problems .asking", { hasText: "No position of the train has been heard yet" }).waitFor();
    assert.equal(await one.locator("#problems .fine").count(), 0);
    await one.locator(".problem.error", { hasText: "No position of this train has been heard yet" }).waitFor();
    await picture("no-position-heard", one);
    await one.close();
  });

  it("says that the picture is old when those that come cannot be decoded", async () => {
    const one = await open(DESK, "light");
    await until("the picture is live", async () => (await one.locator("#camera canvas").count()) === 1 && (await one.locator("#camera.stale").count()) === 0);
    await one.evaluate(() => (window.createImageBitmap = () => Promise.reject(new Error("broken"))));
    await one.locator("#camera.stale .age").waitFor();
    await one.locator("#camera .banner", { hasText: "Old picture" }).waitFor();
    await one.close();
  });

  it("names a slow link, and shows nothing that came over it as live", async () => {
    const one = await chromium.newPage({ viewport: DESK });
    let delay_ms = 0;
    await one.routeWebSocket(/api\/live/, (socket) => {
      const server = socket.connectToServer();
      server.onMessage((message) => void setTimeout(() => socket.send(message), delay_ms));
    });
    await one.goto(train.address);
    await until("it is live", async () => (await one.locator("#numbers:not(.stale) dl").count()) === 1);
    delay_ms = 2200; // with what a busy machine adds shorter than a silence that is a lost connection
    await one.locator(".problem.error", { hasText: /What is shown is \d+(\.\d)?\ss old: the link to the train or this browser is slow/ }).waitFor();
    for (const part of ["numbers", "line", "camera", "curvature"]) await one.locator(`#${part}.stale`).waitFor();
    assert.match(await one.locator(".connection").innerText(), /Connected, .+ late/);
    delay_ms = 0;
    await one.locator(".problem.error", { hasText: "What is shown is" }).waitFor({ state: "detached" });
    await one.locator("#numbers:not(.stale)").waitFor();
    await one.close();
  });

  it("says in the title of a page in the background that nobody answers", async () => {
    const one = await open(DESK, "light");
    const connected = async () => /Connected/.test(await one.locator(".connection").innerText());
    await until("it is connected", connected);
    await one.evaluate(() => {
      Object.defineProperty(document, "visibilityState", { value: "hidden", configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    });
    train.signal("monitor", "SIGSTOP");
    try {
      await until("the title says so", async () => /not connected/.test(await one.title()));
    } finally {
      train.signal("monitor", "SIGCONT");
    }
    await until("it is connected again", connected);
    await until("the other page is, too", async () => /Connected/.test(await text(".connection")));
    await one.close();
  });

  it("greys everything out when the connection is lost, and comes back by itself", async () => {
    train.signal("monitor", "SIGKILL");
    await until("the page says so", async () => /No connection to the train since \d\d:\d\d:\d\d/.test(await text(".connection")));
    assert.match(await text(".problem"), /No connection to the train/);
    await page.locator("#numbers.stale").waitFor();
    assert.match(await text("#numbers .age"), /Not live: .+ old/);
    for (const panel of ["line", "camera"]) await page.locator(`#${panel}.stale .age`).waitFor();
    for (const panel of ["history", "reports", "log"]) await page.locator(`#${panel}.stale`).waitFor();
    assert.match(await page.title(), /not connected/);
    assert.equal(await page.locator("#problems .fine").count(), 0);
    await picture("no-connection");
    train.start_monitor();
    await until("it is connected again", async () => /Connected/.test(await text(".connection")));
    await page.locator("#numbers:not(.stale) dl").waitFor();
    await page.locator("#camera:not(.stale)").waitFor();
    await until("it is no problem any more", async () => (await page.locator(".problem", { hasText: "No connection" }).count()) === 0);
  });

  it("leads a replay with its time bar", async () => {
    await train.end_run();
    train.start_replay();
    const panel = page.locator("#player");
    await panel.waitFor();
    await until("the other train is named", async () => /train replay-/.test(await text("header .train")));
    await until("the replay is live", async () => (await page.locator("#player.stale").count()) === 0 && /Playing/.test(await text("#player .aside")));
    await panel.getByRole("button", { name: "Pause" }).click();
    await until("it is paused", async () => /Paused/.test(await text("#player .aside")));
    const bar = panel.getByLabel("Place in the recording");
    await bar.fill("5");
    await until("it stands at five seconds", async () => Math.abs(Number(await bar.inputValue()) - 5) < 1);
    const at = Number(await bar.inputValue());
    await until("single pictures are played", async () => {
      await panel.getByRole("button", { name: "Step" }).click();
      return Number(await bar.inputValue()) > at;
    });
    await panel.getByLabel("Again at the end").click();
    await until("it will not begin again", async () => /loop off/.test(await text("#player .answer")));
    await panel.getByLabel("Again at the end").click();
    await until("it will", async () => /loop on/.test(await text("#player .answer")));
    await panel.getByLabel("Rate").selectOption("2");
    await panel.getByRole("button", { name: "Play", exact: true }).click();
    await until("it plays twice as fast", async () => /Playing/.test(await text("#player .aside")) && (await panel.getByLabel("Rate").inputValue()) === "2");
    await until("the recorded train is live", async () => /Both rails are seen/.test((await label("camera")) ?? "") && (await page.locator("#numbers.stale").count()) === 0);
    await picture("replay");
  });

  it("had no error of its own", () => assert.deepEqual(errors, []));
});
