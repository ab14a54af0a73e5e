// Position reports as they leave, newest first, with the message unfolded.
import { signal } from "@preact/signals";
import { unfold } from "../etcs";
import { capital, day, duration, metres, number, time_of_day, words } from "../format";
import { host_ms, host_now_ms, now_ms, reports } from "../store";
import type { Report } from "../wire";
import { Nothing, Panel } from "./panel";

const chosen = signal<number | null>(null);
const group = (nid: number | null) => (nid === null || nid === 16777215 ? "unknown" : `${nid >> 14}-${nid & 16383}`);

function Row({ one }: { one: Report }) {
  const open = chosen.value === one.sent_ns;
  return (
    <tr class={open ? "chosen" : ""}>
      <th scope="row">
        <button class="link" aria-expanded={open} onClick={() => (chosen.value = open ? null : one.sent_ns)}>
          {time_of_day(host_ms(one.sent_ns))}
        </button>
      </th>
      <td>{capital(words(one.reason))}</td>
      <td>{group(one.nid_lrbg)}</td>
      <td class="n">{metres(one.d_lrbg_m)}</td>
      <td class="n">
        {one.l_doubtover_m === null && one.l_doubtunder_m === null
          ? "unknown"
          : `−${metres(one.l_doubtover_m)} / +${metres(one.l_doubtunder_m)}`}
      </td>
      <td class="n">{one.v_train_kmh === null ? "unknown" : `${number(one.v_train_kmh, 0)} km/h`}</td>
    </tr>
  );
}

function Message({ one }: { one: Report }) {
  const { fields, problem } = unfold(one.hex, one.baseline);
  return (
    <div class="unfolded">
      <h3>
        Message 136, packet {one.nid_packet}, baseline {one.baseline}
      </h3>
      <p class="hex">{one.hex.replace(/(..)/g, "$1 ").trim()}</p>
      {problem !== "" && <p class="nothing">It cannot be read further: {problem}.</p>}
      <div class="scroll" tabIndex={0} role="group" aria-label="Fields of the message">
        <table>
          <thead>
            <tr>
              <th scope="col">Field</th>
              <th scope="col" class="n">Bits</th>
              <th scope="col" class="n">Value</th>
              <th scope="col">Meaning</th>
            </tr>
          </thead>
          <tbody>
            {fields.map((field) => (
              <tr key={field.name}>
                <th scope="row">{field.name}</th>
                <td class="n">{field.bits}</td>
                <td class="n">{field.value}</td>
                <td>{field.meaning}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </div>
  );
}

export function Reports() {
  const list = [...reports.value].reverse();
  const open = list.find((one) => one.sent_ns === chosen.value);
  const last = list[0];
  // Recorded data keeps its own date.
  const other_day = last === undefined || day(host_ms(last.sent_ns)) === day(now_ms.value) ? "" : day(host_ms(last.sent_ns));
  const ago = last === undefined || other_day !== "" ? "" : `, sent ${duration(Math.max(0, (host_now_ms.value - last.sent_ns / 1e6) / 1000))} ago`;
  return (
    <Panel id="reports" title="Position reports" topics={["reports"]}
      aside={last === undefined ? undefined : <span class="muted">newest of the last {list.length} first{ago}; press a time for the message</span>}>
      {last === undefined ? (
        <Nothing>None has left since the monitor listens.</Nothing>
      ) : (
        <div class="scroll tall" tabIndex={0} role="group" aria-label="Position reports">
          <table>
            <thead>
              <tr>
                <th scope="col">Sent{other_day === "" ? "" : ` on ${other_day}`}</th>
                <th scope="col">Because</th>
                <th scope="col">Balise group</th>
                <th scope="col" class="n">Distance</th>
                <th scope="col" class="n">Doubt behind / ahead</th>
                <th scope="col" class="n">Speed</th>
              </tr>
            </thead>
            <tbody>
              {list.map((one) => (
                <Row key={`${one.sent_ns} ${one.seq}`} one={one} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {open !== undefined && <Message one={open} />}
    </Panel>
  );
}
