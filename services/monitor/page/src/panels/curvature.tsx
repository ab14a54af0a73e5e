// The track's curvature as the camera measures it, against the map's.
import { colours } from "../draw/canvas";
import { draw_plot, range_of, round_ticks } from "../draw/plot";
import { bend, number } from "../format";
import { at_train, misfit } from "../misfit";
import { curvature } from "../store";
import type { Curvature } from "../wire";
import { Drawing } from "./canvas";
import { Nothing, Panel } from "./panel";

const PER_KM = 1000;

function draw(canvas: HTMLCanvasElement): void {
  const one = curvature.value.value;
  if (one === null) return;
  const c = colours();
  const all = [...one.measured.map(([ahead]) => ahead), ...one.map.map(([ahead]) => ahead)];
  const from = Math.min(...all, 0);
  const to = Math.max(...all, from + 1);
  const values = [...one.measured.flatMap(([, k, s]) => [(k - s) * PER_KM, (k + s) * PER_KM]), ...one.map.map(([, k]) => k * PER_KM)];
  draw_plot(
    canvas,
    {
      x: { from, to, ticks: round_ticks(from, to, 3), name: (x) => (Math.abs(x) < 1e-9 ? "train" : `${x > 0 ? "+" : ""}${number(x, 0)} m`) },
      y: { ...range_of(values, 0.8, true), unit: "1/km" },
    },
    [{ colour: c.band, points: one.measured.map(([ahead, k, s]) => [ahead, (k - s) * PER_KM, (k + s) * PER_KM]) }],
    [
      { colour: c.landmark, width: 2, dash: [5, 4], points: one.map.map(([ahead, k]) => [ahead, k * PER_KM]) },
      { colour: c.train, width: 2, points: one.measured.map(([ahead, k]) => [ahead, k * PER_KM]) },
    ],
  );
}

function in_words(one: Curvature): string {
  const measured = at_train(one.measured);
  return `Measured ${bend(measured?.[1], measured?.[2])}, map ${bend(at_train(one.map)?.[1])}`;
}

export function CurvaturePanel() {
  const one = curvature.value.value;
  const worst = one === null ? null : misfit(one);
  return (
    <Panel id="curvature" title="Curvature against the map" topics={["curvature"]} kind="curvature">
      {one === null || (one.measured.length === 0 && one.map.length === 0) ? (
        <Nothing>No curvature is measured, and none is known from the map.</Nothing>
      ) : (
        <>
          <Drawing class="plot" draw={draw} words={`Curvature over the way. ${in_words(one)}.`} />
          <p class="legend">
            <span class="key measured">measured ± 1 sigma</span>
            <span class="key reference">map</span>
            <span class="muted">
              {in_words(one)}
              {worst !== null && `; farthest apart ${number(worst.sigmas, 1)} sigma at ${worst.ahead_m >= 0 ? "+" : ""}${number(worst.ahead_m, 0)} m`}
            </span>
          </p>
        </>
      )}
    </Panel>
  );
}
