// The live picture with rails and landmarks drawn over it.
import { signal } from "@preact/signals";
import { draw_view, not_seen, view_in_words } from "../draw/view";
import { capital, words } from "../format";
import { about, fresh, picture } from "../store";
import { Drawing } from "./canvas";
import { Nothing, Panel } from "./panel";

const chosen = signal("");
/// The one that is shown: the chosen one, while it is there.
const shown = (cameras: string[]) => (cameras.includes(chosen.value) ? chosen.value : cameras[0]);

function draw(canvas: HTMLCanvasElement): void {
  if (picture.value.value !== null) draw_view(canvas, picture.value.value);
}

function Choice({ cameras }: { cameras: string[] }) {
  return (
    <label class="choice">
      <span class="unseen">Camera</span>
      <select value={shown(cameras)} onChange={(event) => (chosen.value = event.currentTarget.value)}>
        {cameras.map((one) => (
          <option key={one}>{one}</option>
        ))}
      </select>
    </label>
  );
}

/// What must not be overlooked stands on the picture itself.
function Banner() {
  if (fresh("picture") === "stale") return <p class="banner">Old picture</p>;
  const one = picture.value.value?.view;
  if (!one) return null;
  const health = one.health.length === 0 ? "" : ` · picture ${one.health.map(words).join(", ")}`;
  if (one.seen && health === "") return null;
  return <p class="banner">{one.seen ? capital(health.slice(3)) : `${not_seen(one)}${health}`}</p>;
}

export function CameraPanel() {
  const cameras = about.value?.cameras ?? [];
  const camera = shown(cameras);
  const one = picture.value.value?.view ?? null;
  return (
    <Panel id="camera" title="Camera" topics={camera === undefined ? [] : [`view:${camera}`]} kind="picture"
      aside={cameras.length > 1 ? <Choice cameras={cameras} /> : <span class="muted">{camera}</span>}>
      {picture.value.value === null ? (
        <Nothing>{cameras.length === 0 ? "No camera is known." : "No picture has come yet."}</Nothing>
      ) : (
        <figure class="view">
          <Drawing draw={draw} words={view_in_words(one)} />
          <Banner />
        </figure>
      )}
      <p class="legend">
        <span class="key rail">rails as seen</span>
        <span class="key mark">landmarks where the map puts them</span>
        <span class="muted">{one === null || fresh("picture") !== "live" ? "" : one.seen ? "both rails seen" : not_seen(one).toLowerCase()}</span>
      </p>
    </Panel>
  );
}
