// The figures a dispatcher reads first.
import type { ComponentChildren } from "preact";
import { capital, duration, kmh, metres, number, outward, words } from "../format";
import { age_of, fresh, map, state } from "../store";
import { is_sure, track_note } from "../track_note";
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

function Where({ one }: { one: TrainState }) {
  const known = one.track_known;
  const bounded = known && one.over_m !== null && one.under_m !== null;
  const widest = Math.max(one.over_m ?? 0, one.under_m ?? 0);
  const digits = widest < 0.995 ? 2 : widest < 9.95 ? 1 : 0;
  const geo = one.lat === null || one.lon === null ? "" : `${one.lat.toFixed(5)}°, ${one.lon.toFixed(5)}°`;
  return (
    <>
      <Figure id="position" name={known ? `Position on ${edge_name(one.edge)}` : "Position"} value={known ? number(one.offset_m, 1) : "Unknown"}
        unit={known ? "m" : undefined} note={known ? [reference(one), geo].filter(Boolean).join(" · ") : `${metres(one.distance_m)} since the start`}
        level={known ? "" : "warn"} />
      <Figure id="interval" name="True position within" value={!bounded ? "Unknown" : `${number(-outward(one.over_m, digits), digits)} / +${number(outward(one.under_m, digits), digits)}`}
        unit={bounded ? "m" : undefined} level={bounded ? "" : "warn"}
        note={bounded ? `${metres(one.over_m)} behind to ${metres(one.under_m)} ahead` : "no bound can be given"} />
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
