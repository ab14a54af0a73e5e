// Every topic: how often, how much, how old, how late, what was lost.
import { bytes_per_s, duration, hertz, milliseconds, number } from "../format";
import { topics } from "../store";
import type { Topic } from "../wire";
import { Nothing, Panel } from "./panel";

function Row({ one }: { one: Topic }) {
  const measured = one.measured;
  const latency = [one.latency_p50_ms, one.latency_p95_ms, one.latency_p99_ms];
  return (
    <tr>
      <th scope="row">
        {one.topic}
        {one.writers !== 1 && <span class="muted"> {one.writers === 0 ? "no writer" : `${one.writers} writers`}</span>}
      </th>
      {measured ? (
        <>
          <td class="n">{one.age_s === null ? "–" : hertz(one.hz)}</td>
          <td class="n">{one.age_s === null ? "–" : bytes_per_s(one.bytes_per_s)}</td>
          <td class="n">{one.age_s === null ? "never" : duration(one.age_s)}</td>
          {latency.map((ms, i) => (
            <td class="n" key={i}>{ms === null ? "–" : milliseconds(ms)}</td>
          ))}
          <td class={`n ${one.lost > 0 ? "warn" : ""}`}>{number(one.lost, 0)}</td>
          <td class={`n ${one.gaps > 0 ? "warn" : ""}`}>
            {number(one.gaps, 0)}
            {one.gaps > 0 && one.longest_gap_s !== null && <span class="muted"> ≤ {duration(one.longest_gap_s)}</span>}
          </td>
        </>
      ) : (
        <td colSpan={8} class="muted">known, not listened to: it would cost the train too much</td>
      )}
    </tr>
  );
}

export function Topics() {
  const list = topics.value.value ?? [];
  const total = list.reduce((sum, one) => sum + (one.bytes_per_s ?? 0), 0);
  return (
    <Panel id="topics" title="Topics" topics={["topics"]} kind="topics"
      aside={list.length > 0 ? <span class="muted">{list.length} · {bytes_per_s(total)} seen here</span> : undefined}>
      {list.length === 0 ? (
        <Nothing>No topic is known yet.</Nothing>
      ) : (
        <div class="scroll" tabIndex={0} role="group" aria-label="Topics">
          <table>
            <thead>
              <tr>
                <th scope="col">Topic</th>
                <th scope="col" class="n">Rate</th>
                <th scope="col" class="n">Bandwidth</th>
                <th scope="col" class="n">Age</th>
                <th scope="col" class="n">Latency p50</th>
                <th scope="col" class="n">p95</th>
                <th scope="col" class="n">p99</th>
                <th scope="col" class="n">Lost</th>
                <th scope="col" class="n">Gaps</th>
              </tr>
            </thead>
            <tbody>
              {list.map((one) => (
                <Row key={one.topic} one={one} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Panel>
  );
}
