// Looks at a monitor as a browser or Foxglove does. Says "ok" and ends with 0 once everything has come, else with 1.
//   node client.mjs ACTION PORT [ARGUMENT]
import { readFileSync } from "node:fs";
import https from "node:https";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import WebSocket from "ws";
import foxglove from "@foxglove/ws-protocol";

const [action, port, argument] = process.argv.slice(2);
const http = `http://127.0.0.1:${port}`;
const live = `ws://127.0.0.1:${port}/api/live`;
const seen = new Set();
const patience = setTimeout(() => fail(`after 60 s only: ${[...seen].join(", ")}`), 60_000);

function fail(why) {
  console.log(why);
  process.exit(1);
}
function note(what, wanted) {
  seen.add(what);
  if (wanted.every((one) => seen.has(one))) {
    console.log("ok");
    process.exit(0);
  }
}

const actions = {
  async get() {
    const answer = await fetch(http + argument);
    console.log(answer.status);
    console.log(await answer.text());
    process.exit(0);
  },

  // As somebody at another computer, behind a proxy.
  async get_from_elsewhere() {
    const answer = await fetch(http + argument, { headers: { "x-forwarded-for": "192.0.2.1" } });
    console.log(await answer.text());
    process.exit(0);
  },

  // Whether the monitor is there under another address.
  async reach() {
    console.log(await fetch(`http://${argument}:${port}/healthz`).then(() => "reached", () => "not reached"));
    process.exit(0);
  },

  // The page, its WebSocket and Foxglove's with TLS; the argument is the certificate to trust.
  async tls() {
    const wanted = ["page", "live", "foxglove"];
    const ca = readFileSync(argument);
    https.get(`https://127.0.0.1:${port}/healthz`, { ca }, (answer) => answer.statusCode > 0 && note("page", wanted)).on("error", (error) => fail(error.message));
    for (const [name, path, protocols] of [["live", "/api/live", []], ["foxglove", "/", ["foxglove.sdk.v1"]]]) {
      const socket = new WebSocket(`wss://127.0.0.1:${port}${path}`, protocols, { ca });
      socket.on("message", () => note(name, wanted));
      socket.on("error", (error) => fail(error.message));
    }
  },

  // Everything that the page watches, and a command to the recorder.
  live() {
    const wanted = ["hello", "state", "services", "topics", "log", "view", "picture", "report", "reply"];
    const socket = new WebSocket(live);
    socket.on("error", (error) => fail(error.message));
    socket.on("close", (code, why) => fail(`closed ${code} ${why}`));
    socket.on("open", () => {
      socket.send(JSON.stringify({ watch: ["state", "services", "topics", "log", "reports", "view:cam0"] }));
      socket.send(JSON.stringify({ control: { id: 7, service: "recorder", command: "event", argument: "test" } }));
    });
    socket.on("message", (data, binary) => {
      if (binary) {
        const length = data.readUInt32LE(0);
        const header = JSON.parse(data.subarray(4, 4 + length));
        const jpeg = data.subarray(4 + length);
        if (header.camera === "cam0" && jpeg[0] === 0xff && jpeg[1] === 0xd8) note("picture", wanted);
        return;
      }
      const message = JSON.parse(data);
      const right = {
        hello: () => message.train === argument,
        state: () => message.speed_mps === 12.5 && message.acceleration_mps2 === null && message.track_known,
        services: () => message.services.some((one) => one.service === "fusion" && one.alive),
        topics: () =>
          message.topics.some((one) => one.topic === "train_state" && one.measured && one.hz > 1) &&
          message.topics.some((one) => one.topic === "camera_frame/cam0" && !one.measured),
        log: () => message.records.some((one) => one.text === "a word" && one.level === "warning"),
        view: () => message.seen && message.rails.left.length === 2 && message.width === 320,
        report: () => message.hex === "88AB" && message.nid_lrbg === null,
        reply: () => message.id === 7 && message.done && message.text === "event test",
      }[message.kind];
      if (right?.()) note(message.kind, wanted);
    });
  },

  // Refused with this HTTP status.
  refused() {
    const [status, path, ...more] = argument.split(" ");
    const protocols = more.filter((one) => !one.startsWith("origin="));
    const origin = more.find((one) => one.startsWith("origin="))?.slice(7);
    const socket = new WebSocket(`ws://127.0.0.1:${port}${path}`, protocols, { origin });
    socket.on("open", () => fail("was let in"));
    socket.on("error", (error) =>
      error.message.includes(`Unexpected server response: ${status}`) ? note("refused", ["refused"]) : fail(error.message));
  },

  // The protocol's own client, and the readers of Foxglove and Lichtblick: what is advertised, and messages as cdr and protobuf.
  foxglove() {
    const wanted = ["open", "serverInfo", "train_state", "picture/cam0", "rails/cam0", "place", "log", "camera_calibration"];
    const protocols = argument.split(",");
    foxglove.FoxgloveClient.SUPPORTED_SUBPROTOCOL = protocols[0]; // the client knows the old name only
    const client = new foxglove.FoxgloveClient({ ws: new WebSocket(`ws://127.0.0.1:${port}`, protocols) });
    const names = new Map();
    const readers = new Map();
    client.on("open", () => note("open", wanted)); // only with the subprotocol that it knows
    client.on("error", (error) => fail(error.message));
    client.on("close", () => fail("closed"));
    client.on("serverInfo", (info) => info.capabilities.length === 0 && note("serverInfo", wanted));
    client.on("advertise", (channels) => {
      for (const channel of channels) {
        const text = channel.encoding === "cdr";
        if (channel.schemaEncoding !== (text ? "omgidl" : "protobuf")) fail(`schema of ${channel.topic}`);
        if (text) readers.set(channel.topic, new MessageReader(channel.schemaName, parseIDL(channel.schema)));
        if (!text && !Buffer.from(channel.schema, "base64").includes(channel.schemaName.split(".").pop())) fail(`types of ${channel.topic}`);
        if (wanted.includes(channel.topic)) names.set(client.subscribe(channel.id), channel.topic);
      }
    });
    client.on("message", ({ subscriptionId, data }) => {
      const topic = names.get(subscriptionId);
      const bytes = Buffer.from(data.buffer, data.byteOffset, data.byteLength);
      const right = {
        train_state: () => readers.get(topic).readMessage(bytes).speed_mps === 12.5,
        camera_calibration: () => readers.get(topic).readMessage(bytes).camera === "cam0",
        "picture/cam0": () => bytes.includes(Buffer.from([0xff, 0xd8, 0x4a])) && bytes.includes("jpeg"),
        log: () => bytes.includes("a word"),
      }[topic];
      if (!right || right()) note(topic, wanted);
    });
  },

  // What looking costs: "VIEWERS SECONDS" -> processor time of the monitor and of all other services, in % of a core. No test: a figure.
  cost() {
    clearTimeout(patience);
    const [viewers, seconds] = argument.split(" ").map(Number);
    const all = ["state", "services", "topics", "reports", "log", "recorder", "player", "curvature", "problems", "view:cam0"];
    for (let i = 0; i < viewers; ++i) {
      const socket = new WebSocket(live);
      socket.on("open", () => socket.send(JSON.stringify({ watch: all })));
      socket.on("message", () => {});
    }
    const used = { monitor: [], others: [] };
    const socket = new WebSocket(live);
    socket.on("open", () => socket.send(JSON.stringify({ watch: ["services"] })));
    socket.on("message", (data) => {
      const { services } = JSON.parse(data);
      if (!services) return;
      const sum = (chosen) => services.filter(chosen).reduce((total, one) => total + one.cpu_percent, 0);
      used.monitor.push(sum((one) => one.service === "monitor"));
      used.others.push(sum((one) => one.service !== "monitor"));
    });
    setTimeout(() => {
      const mean = (values) => (values.reduce((a, b) => a + b, 0) / values.length).toFixed(2);
      console.log(`${viewers} viewers: monitor ${mean(used.monitor)} %, all other services ${mean(used.others)} % of a core`);
      process.exit(0);
    }, seconds * 1000);
  },

  // Asks for pictures and takes none: is let go, and says why it may think so.
  slow() {
    const socket = new WebSocket(live);
    socket.on("error", (error) => note(error.message ? "closed" : "", ["closed"]));
    socket.on("open", () => {
      socket.send(JSON.stringify({ watch: ["view:cam0"] }));
      socket._socket.pause();
      const poll = setInterval(async () => {
        const metrics = await (await fetch(`${http}/metrics`)).text();
        if (!metrics.includes("railfix_monitor_slow_viewers_total 1")) return;
        clearInterval(poll);
        socket._socket.resume();
      }, 200);
    });
    socket.on("close", () => note("closed", ["closed"]));
  },
};
await actions[action]();
