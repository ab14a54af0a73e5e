// Speed and interval of the last ten minutes, as far as this page was open.
import { computed } from "@preact/signals";
import { colours } from "../draw/canvas";
import { draw_plot, range_of } from "../draw/plot";
import { bounds_in_words, duration, kmh, number } from "../format";
import { fresh, history, state } from "../store";
import { Drawing } from "./canvas";
import { Nothing, Panel } from "./panel";

const span = computed(() => {
  const to = history.value[history.value.length - 1]?.at_ms ?? 0;
  const first = history.value[0]?.at_ms ?? 0;
  return { from: Math.min(first, to - 60000), to };
});
const STEPS_S = [10, 20, 30, 60, 120, 300];
/// Full minutes or tens of seconds before now.
function ticks(): number[] {
  const { from, to } = span.value;
  const step_s = STEPS_S.find((step) => (to - from) / 1000 / step <= 5) ?? 300;
  return Array.from({ length: Math.floor((to - from) / 1000 / step_s) + 1 }, (_, i) => to - i * step_s * 1000);
}
const ago = (at_ms: number) => (span.value.to - at_ms < 1000 ? "now" : `−${duration((span.value.to - at_ms) / 1000)}`);

function draw_speed(canvas: HTMLCanvasElement): void {
  const points = history.value.map((one): [number, number | null] => [one.at_ms, kmh(one.speed_mps)]);
  draw_plot(canvas, { x: { ...span.value, ticks: ticks(), name: ago }, y: { ...range_of(points.map((point) => point[1]), 20, true), unit: "km/h" } }, [],
    [{ colour: colours().train, width: 2, points }]);
}

function draw_interval(canvas: HTMLCanvasElement): void {
  const under = history.value.map((one): [number, number | null] => [one.at_ms, one.under_m]);
  const over = history.value.map((one): [number, number | null] => [one.at_ms, one.over_m === null ? null : -one.over_m]);
  const c = colours();
  draw_plot(canvas, { x: { ...span.value, ticks: ticks(), name: ago }, y: { ...range_of(under.concat(over).map((point) => point[1]), 2, true), unit: "m" } }, [],
    [{ colour: c.train, width: 1.5, points: under }, { colour: c.landmark, width: 1.5, points: over }]);
}

export function History() {
  const one = fresh("state") === "live" ? state.value.value : null;
  const length = history.value.length;
  return (
    <Panel id="history" title="Speed and interval over time" topics={["state"]}>
      {length < 2 ? (
        <Nothing>Begins when the page has been open for a few seconds.</Nothing>
      ) : (
        <>
          <Drawing class="plot half" draw={draw_speed} words={`Speed over the last ${duration(length)}, now ${number(kmh(one?.speed_mps), 1)} km/h`} />
          <Drawing class="plot half" draw={draw_interval}
            words={`Confidence interval over the last ${duration(length)}, now ${bounds_in_words(one?.over_m, one?.under_m)}`} />
          <p class="legend">
            <span class="key measured">speed; ahead</span>
            <span class="key reference solid">behind</span>
            <span class="muted">gaps: not live</span>
          </p>
        </>
      )}
    </Panel>
  );
}
