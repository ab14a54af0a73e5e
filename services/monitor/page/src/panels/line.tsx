// The train on its line: the map, and the track ahead and behind.
import { computed, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { type Camera, draw_map, map_in_words } from "../draw/map";
import { draw_strip, strip_in_words } from "../draw/strip";
import { about, fresh, map, map_failed, state } from "../store";
import { TrackMap } from "../track_map";
import type { TrainState } from "../wire";
import { Drawing } from "./canvas";
import { Nothing, Panel } from "./panel";

const track = computed(() => (map.value === null ? null : new TrackMap(map.value)));
const following = signal(true);
const metres_per_px = signal(1.5);
const centre = signal<[number, number] | null>(null);

const NEAREST = 0.02;
const FARTHEST = 2000;

const FOLLOWED_UP_TO = 5;
const BUTTONS_PX = 44; // they lie over the upper edge of the map

function follow(): void {
  following.value = true;
  metres_per_px.value = Math.min(metres_per_px.value, FOLLOWED_UP_TO);
}

function stay(): void {
  centre.value = middle();
  following.value = false;
}

function zoom(factor: number): void {
  metres_per_px.value = Math.min(FARTHEST, Math.max(NEAREST, metres_per_px.value * factor));
}

function move(dx_px: number, dy_px: number): void {
  const here = middle();
  following.value = false;
  centre.value = [here[0] - dx_px * metres_per_px.value, here[1] + dy_px * metres_per_px.value];
}

/// The train while it is followed; the middle of the line when it is nowhere yet.
function middle(): [number, number] {
  const one = state.value.value;
  if (following.value && one !== null && track.value !== null) {
    const at = one.track_known ? track.value.at(one) : null;
    if (at !== null) return at;
  }
  if (centre.value !== null) return centre.value;
  const box = track.value?.box() ?? { west: 0, east: 1, south: 0, north: 1 };
  return [(box.west + box.east) / 2, (box.south + box.north) / 2];
}

/// All of the line, below the buttons.
function around_line(lines: TrackMap, width: number, height: number): Camera {
  const box = lines.box();
  const m = Math.max((box.east - box.west) / (width - 40), (box.north - box.south) / (height - 40 - BUTTONS_PX), NEAREST);
  return { easting_m: (box.west + box.east) / 2, northing_m: (box.south + box.north + BUTTONS_PX * m) / 2, metres_per_px: m };
}

function whole_line(width: number, height: number): void {
  if (track.value === null) return;
  following.value = false;
  const all = around_line(track.value, width, height);
  metres_per_px.value = all.metres_per_px;
  centre.value = [all.easting_m, all.northing_m];
}

function key(event: KeyboardEvent): void {
  const step = 60;
  const actions: Record<string, () => void> = {
    "+": () => zoom(0.7),
    "-": () => zoom(1.4),
    ArrowLeft: () => move(step, 0),
    ArrowRight: () => move(-step, 0),
    ArrowUp: () => move(0, step),
    ArrowDown: () => move(0, -step),
    Home: follow,
  };
  const action = actions[event.key];
  if (action === undefined) return;
  event.preventDefault();
  action();
}

/// All places that are possible, while the track is not known.
function around_all(one: TrainState | null, lines: TrackMap, canvas: HTMLCanvasElement): Camera | null {
  if (one === null) return following.value ? around_line(lines, canvas.clientWidth, canvas.clientHeight) : null;
  const points = one.alternatives.map((place) => lines.at(place)).filter((point) => point !== null);
  if (one.track_known || !following.value || points.length === 0) return null;
  const [east, north] = [points.map((point) => point[0]), points.map((point) => point[1])];
  const spread = (values: number[]) => Math.max(...values) - Math.min(...values);
  return {
    easting_m: (Math.max(...east) + Math.min(...east)) / 2,
    northing_m: (Math.max(...north) + Math.min(...north)) / 2,
    metres_per_px: Math.max(metres_per_px.value, (1.6 * spread(east)) / (canvas.clientWidth || 1), (1.6 * spread(north)) / (canvas.clientHeight || 1)),
  };
}

function draw(canvas: HTMLCanvasElement): void {
  const lines = track.value;
  if (lines === null) return;
  const one = state.value.value;
  const [easting_m, northing_m] = middle();
  const near: Camera = { easting_m, northing_m, metres_per_px: metres_per_px.value };
  draw_map(canvas, lines, one, fresh("state") === "live", around_all(one, lines, canvas) ?? near);
}

function draw_near(canvas: HTMLCanvasElement): void {
  const one = state.value.value;
  if (track.value !== null && one !== null && one.track_known) draw_strip(canvas, track.value, one, fresh("state") === "live");
}

/// Drag with one finger or the mouse, zoom with the wheel and Ctrl (a plain wheel scrolls the page).
function hold(frame: HTMLElement): () => void {
  let from: [number, number] | null = null;
  const down = (event: PointerEvent) => {
    from = [event.clientX, event.clientY];
    frame.setPointerCapture(event.pointerId);
  };
  const drag = (event: PointerEvent) => {
    if (from === null) return;
    move(event.clientX - from[0], event.clientY - from[1]);
    from = [event.clientX, event.clientY];
  };
  const up = () => (from = null);
  const wheel = (event: WheelEvent) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.2 : 1 / 1.2);
  };
  frame.addEventListener("pointerdown", down);
  frame.addEventListener("pointermove", drag);
  frame.addEventListener("pointerup", up);
  frame.addEventListener("pointercancel", up);
  frame.addEventListener("wheel", wheel, { passive: false });
  return () => {
    frame.removeEventListener("pointerdown", down);
    frame.removeEventListener("pointermove", drag);
    frame.removeEventListener("pointerup", up);
    frame.removeEventListener("pointercancel", up);
    frame.removeEventListener("wheel", wheel);
  };
}

function Picture() {
  const frame = useRef<HTMLDivElement>(null);
  useEffect(() => (frame.current === null ? undefined : hold(frame.current)), []);
  const one = state.value.value;
  const lines = track.value as TrackMap;
  const fit = () => whole_line(frame.current?.clientWidth ?? 600, frame.current?.clientHeight ?? 300);
  return (
    <>
      <div class="map-frame">
        <div class="map-hold" ref={frame} tabIndex={0} role="group" aria-label="Map: arrow keys move it, plus and minus zoom, Home follows the train" onKeyDown={key}>
          <Drawing class="map" draw={draw} words={map_in_words(lines, one)} />
        </div>
        <div class="map-buttons" role="group" aria-label="Map view">
          <button aria-label="Zoom in" onClick={() => zoom(0.6)}>+</button>
          <button aria-label="Zoom out" onClick={() => zoom(1.6)}>−</button>
          <button onClick={fit}>Whole line</button>
          <button aria-pressed={following.value} onClick={() => (following.value ? stay() : follow())}>Follow</button>
        </div>
      </div>
      {one !== null && one.track_known && lines.has(one.edge) ? (
        <Drawing class="strip" draw={draw_near} words={strip_in_words(one)} />
      ) : (
        <Nothing>{one === null ? "No position yet." : one.track_known ? "The train is outside of this map." : "Which track is not yet known: circles show where the train may be."}</Nothing>
      )}
    </>
  );
}

export function Line() {
  const name = about.value?.map?.name;
  return (
    <Panel id="line" title="Line" topics={["state"]} kind="state" aside={name ? <span class="muted">{name}</span> : undefined}>
      {track.value === null ? (
        <Nothing>{about.value === null ? "Waiting for the map." : about.value.map === null ? "The monitor has no map (monitor.map). Edge and metres, where they are known, are right all the same." : map_failed.value ? "The monitor does not give its map; it is asked for again at the next connection." : "Loading the map."}</Nothing>
      ) : (
        <Picture />
      )}
    </Panel>
  );
}
