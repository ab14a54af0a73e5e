import "./style.css";
import { effect } from "@preact/signals";
import { render } from "preact";
import { Live } from "./live";
import { CameraPanel } from "./panels/camera";
import { ask } from "./panels/control";
import { CurvaturePanel } from "./panels/curvature";
import { Header } from "./panels/header";
import { History } from "./panels/history";
import { Line } from "./panels/line";
import { Log } from "./panels/log";
import { Numbers } from "./panels/numbers";
import { Player } from "./panels/player";
import { all_problems, Problems } from "./panels/problems";
import { Recorder } from "./panels/recorder";
import { Reports } from "./panels/reports";
import { Services } from "./panels/services";
import { Topics } from "./panels/topics";
import { about, connection, map, map_failed, remember_moment, state, tick } from "./store";
import { page_visible, wanted } from "./visible";
import type { About, MapData } from "./wire";

const RADIUS_M = 20000; // of the part of a long map around the train
const LONG_MAP_M = 300000;

async function fetched<T>(path: string): Promise<T | null> {
  try {
    const answer = await fetch(path);
    return answer.ok ? ((await answer.json()) as T) : null;
  } catch {
    return null; // the socket will be lost too, and says so
  }
}

let map_of = { edge: 0, travelled_m: 0 };

/// Once a connection, and on a long line again when the train has left the part that is here.
async function fetch_map(): Promise<void> {
  const line = about.value?.map;
  if (!line) {
    map.value = null;
    return;
  }
  const one = state.value.value;
  const around = line.length_m > LONG_MAP_M && one?.track_known ? `?edge=${one.edge}&offset=${Math.round(one.offset_m)}&radius=${RADIUS_M}` : "";
  map_of = { edge: one?.track_known ? one.edge : 0, travelled_m: one?.distance_m ?? 0 };
  const got = await fetched<MapData>(`api/map${around}`);
  map_failed.value = got === null;
  map.value = got ?? map.value;
}

function left_the_map(): boolean {
  const one = state.value.value;
  const line = about.value?.map;
  if (!line || line.length_m <= LONG_MAP_M || !one?.track_known) return false;
  return map_of.edge === 0 || Math.abs((one.distance_m ?? 0) - map_of.travelled_m) > RADIUS_M / 2;
}

async function fetch_about(): Promise<void> {
  const got = await fetched<About>("api/about");
  if (got !== null) about.value = got;
}

async function greeted(): Promise<void> {
  await fetch_about();
  await fetch_map();
}

function Page() {
  return (
    <>
      <a class="skip" href="#numbers">To the train</a>
      <Header />
      <main>
        <Problems />
        <Numbers />
        <div class="panels">
          <Player />
          <Line />
          <CameraPanel />
          <CurvaturePanel />
          <History />
          <Reports />
          <Recorder />
          <Services />
          <Topics />
          <Log />
        </div>
      </main>
    </>
  );
}

const address = new URL("api/live", location.href);
address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
const live = new Live(address.href, () => void greeted());
ask.value = (service, command, argument) => live.control(service, command, argument);
effect(() => live.watch([...wanted.value, ...(page_visible.value ? ["player"] : [])]));
effect(() => {
  const count = all_problems().length;
  const train = about.value?.train ?? "";
  document.title = `${connection.value.up ? "" : "not connected – "}${count > 0 ? `(${count}) ` : ""}${train} Railfix`.trim();
});
setInterval(() => {
  if (page_visible.value) tick();
}, 500);
setInterval(() => {
  remember_moment(Date.now());
  if (left_the_map()) void fetch_map();
}, 1000);

/// Over what index.html shows until here.
function show(): void {
  const page = document.getElementById("page") as HTMLElement;
  page.replaceChildren();
  render(<Page />, page);
}

// That is painted first; a page in the background is not painted at all.
if (document.hidden) show();
else requestAnimationFrame(() => setTimeout(show));
