// The figures a dispatcher reads first.
import type { ComponentChildren } from "preact";
import { bounds, capital, duration, kmh, metres, number, words } from "../format";
import { age_of, fresh, map, state } from "../store";
import { is_sure, place_level, track_note } from "../track_note";
import type { TrainState } from "../wire";

function Figure({ id, name, value, unit, note, level = "" }: {
  id: string;
  name: string;
  value: ComponentChildren;
  unit?: string;
  note: ComponentChildren;
  level?: "" | "ok" | "warn" | "bad";
}) {
  return (
    <div class={`figure ${level} ${unit === undefined ? "worded" : ""}`} id={`figure-${id}`}>
      <dt>{name}</dt>
      <dd class="value">
        {value}
        {unit !== undefined && <span class="unit"> {unit}</span>}
      </dd>
      <dd class="note">{note}</dd>
    </div>
  );
}

const SOURCES = ["camera", "wheel", "imu", "gnss", "landmark", "curvature"];

function Sources({ used }: { used: string[] }) {
  return (
    <ul class="sources" aria-label="What holds the position">
      {SOURCES.map((one) => (
        <li key={one} class={used.includes(one) ? "on" : "off"}>
          {words(one)}
          <span class="unseen">{used.includes(one) ? " used" : " not used"}</span>
        </li>
      ))}
    </ul>
  );
}

export function motion(one: TrainState): string {
  if (one.standstill) return "Standing still";
  if (one.speed_mps === null) return "Unknown";
  return one.speed_mps < 0 ? "Moving back" : "Moving";
}

function Speed({ one }: { one: TrainState }) {
  const gain = one.acceleration_mps2;
  const along = one.direction === "unknown" ? "direction on the track not known" : `${one.direction} on the edge`;
  const change = one.standstill || gain === null ? "" : `, ${number(gain, 2)} m/s²`;
  return (
    <>
      <Figure id="speed" name="Speed" value={number(kmh(one.speed_mps), 1)} unit={one.speed_mps === null ? undefined : "km/h"}
        note={`${number(one.speed_mps, 2)}${one.speed_mps === null ? "" : " m/s"}${change}`} level={one.speed_mps === null ? "warn" : ""} />
      <Figure id="motion" name="Motion" value={motion(one)} note={along} level={one.speed_mps === null ? "warn" : ""} />
    </>
  );
}

function edge_name(edge: number): string {
  return map.value?.edges.find((one) => one.id === edge)?.name || `edge ${edge}`;
}

function reference(one: TrainState): string {
  return one.reference === null ? "no landmark passed yet" : `${metres(one.since_reference_m)} since ${words(one.reference)}`;
}

// With words: signs would read as offsets on the edge, which grow the other way when the train runs in reverse.
function Bounds({ behind, ahead }: { behind: string; ahead: string }) {
  return (
    <>
      <span class="bound">
        {behind}
        <span class="unit"> m behind</span>
      </span>
      {" / "}
      <span class="bound">
        {ahead}
        <span class="unit"> m ahead</span>
      </span>
    </>
  );
}

function Where({ one }: { one: TrainState }) {
  const known = one.track_known;
  const bounded = known && one.over_m !== null && one.under_m !== null;
  const { behind, ahead } = bounds(one.over_m, one.under_m);
  const geo = one.lat === null || one.lon === null ? "" : `${one.lat.toFixed(5)}°, ${one.lon.toFixed(5)}°`;
  return (
    <>
      <Figure id="position" name={known ? `Position on ${edge_name(one.edge)}` : "Position"} value={known ? number(one.offset_m, 1) : "Unknown"}
        unit={known ? "m" : undefined} note={known ? [reference(one), geo].filter(Boolean).join(" · ") : `${metres(one.distance_m)} since the start`}
        level={place_level(one, known)} />
      <Figure id="interval" name="True position within" level={place_level(one, bounded)}
        value={bounded ? <Bounds behind={behind} ahead={ahead} /> : "Unknown"}
        note={bounded ? "of where it is shown, as its cab looks" : "no bound can be given"} />
    </>
  );
}

function Trust({ one }: { one: TrainState }) {
  const level = { ok: "ok", degraded: "warn", unusable: "bad" } as const;
  const known = one.track_known;
  return (
    <>
      <Figure id="track" name="Track" value={known ? capital(edge_name(one.edge)) : "Not yet known"}
        note={track_note(one, edge_name)} level={is_sure(one) ? "ok" : "warn"} />
      <Figure id="integrity" name="Integrity" value={capital(one.integrity === "ok" ? "good" : one.integrity)} note={<Sources used={one.sources} />}
        level={level[one.integrity]} />
    </>
  );
}

export function Numbers() {
  const one = state.value.value;
  const now = fresh("state");
  return (
    <section id="numbers" tabIndex={-1} class={now === "live" ? "" : "stale"} aria-labelledby="numbers-title">
      <h2 id="numbers-title" class="unseen">
        The train now
      </h2>
      {one === null ? (
        <p class="nothing">The train has not said yet where it is.</p>
      ) : (
        <>
          {now === "stale" && <p class="age">Not live: {duration(age_of("state"))} old</p>}
          <dl>
            <Speed one={one} />
            <Where one={one} />
            <Trust one={one} />
          </dl>
        </>
      )}
    </section>
  );
}
