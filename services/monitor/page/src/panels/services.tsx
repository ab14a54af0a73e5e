// Health of every service on every host, the worst first.
import { duration, milliseconds, number, percent } from "../format";
import { by_need, level_of, state_of } from "../health";
import { host_now_ms, services } from "../store";
import type { Service } from "../wire";
import { Nothing, Panel } from "./panel";

function Row({ one, hosts }: { one: Service; hosts: number }) {
  const state = state_of(one);
  const since_s = (host_now_ms.value - one.since_ns / 1e6) / 1000;
  return (
    <tr>
      <th scope="row">
        {one.service}
        {hosts > 1 && <span class="muted"> {one.host}</span>}
      </th>
      <td class="nowrap">
        <span class={`state ${level_of(state)}`}>{state}</span> <span class="muted">{duration(since_s)}</span>
      </td>
      <td class="reason">{state !== "dead" ? one.reason : `silent for ${duration(one.age_s)}${one.reason === "" ? "" : `; last said: ${one.reason}`}`}</td>
      <td class="n">{one.latency_p50_ms ? milliseconds(one.latency_p50_ms) : "–"}</td>
      <td class="n">{one.latency_p99_ms ? milliseconds(one.latency_p99_ms) : "–"}</td>
      <td class="n">{percent(one.cpu_percent, 0)}</td>
      <td class="n">{number(one.rss_mb, 0)} MB</td>
      <td class={`n ${one.dropped > 0 ? "warn" : ""}`}>{number(one.dropped, 0)}</td>
      <td class="n more">{number(one.frames_in, 0)}</td>
      <td class="n more">{number(one.frames_out, 0)}</td>
      <td class="n more">{one.pid}</td>
    </tr>
  );
}

export function Services() {
  const list = services.value.value ?? [];
  const hosts = new Set(list.map((one) => one.host));
  const well = list.filter((one) => level_of(state_of(one)) === "ok").length;
  const cpu = list.reduce((sum, one) => sum + (one.alive ? one.cpu_percent : 0), 0);
  const summary = `${well} of ${list.length} well · ${percent(cpu, 0)} of a core · ${[...hosts].join(", ")}`;
  return (
    <Panel id="services" title="Services" topics={["services"]} kind="services" aside={list.length > 0 ? <span class="muted">{summary}</span> : undefined}>
      {list.length === 0 ? (
        <Nothing>No service has said anything yet.</Nothing>
      ) : (
        <div class="scroll" tabIndex={0} role="group" aria-label="Services">
          <table>
            <thead>
              <tr>
                <th scope="col">Service</th>
                <th scope="col">State, since</th>
                <th scope="col">Reason</th>
                <th scope="col" class="n"><abbr title="latency from the input's grab to the output, median">Latency p50</abbr></th>
                <th scope="col" class="n"><abbr title="99 of 100 are faster">p99</abbr></th>
                <th scope="col" class="n"><abbr title="of one core">CPU</abbr></th>
                <th scope="col" class="n">Memory</th>
                <th scope="col" class="n">Dropped</th>
                <th scope="col" class="n more">In</th>
                <th scope="col" class="n more">Out</th>
                <th scope="col" class="n more">Process</th>
              </tr>
            </thead>
            <tbody>
              {by_need(list).map((one) => (
                <Row key={`${one.service} ${one.host}`} one={one} hosts={hosts.size} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Panel>
  );
}
