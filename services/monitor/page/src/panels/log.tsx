// What the services say, newest last, filtered by service, level and text.
import { computed, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { clock } from "../format";
import { type Filter, filtered, LEVELS } from "../log_filter";
import { host_ms, log, LOG_LIMIT, now_ms } from "../store";
import type { LogLevel } from "../wire";
import { Nothing, Panel } from "./panel";

const filter = signal<Filter>({ service: "", least: "info", text: "" });
const names = computed(() => [...new Set(log.value.map((one) => one.service))].sort());
const shown = computed(() => filtered(log.value, filter.value));
const change = (some: Partial<Filter>) => (filter.value = { ...filter.value, ...some });

function Filters() {
  return (
    <form class="filters" role="search" aria-label="Log filter" onSubmit={(event) => event.preventDefault()}>
      <span class="field">
        <label for="log-service">Service</label>
        <select id="log-service" value={filter.value.service} onChange={(event) => change({ service: event.currentTarget.value })}>
          <option value="">all</option>
          {names.value.map((one) => (
            <option key={one}>{one}</option>
          ))}
        </select>
      </span>
      <span class="field">
        <label for="log-level">From level</label>
        <select id="log-level" value={filter.value.least} onChange={(event) => change({ least: event.currentTarget.value as LogLevel })}>
          {LEVELS.map((one) => (
            <option key={one}>{one}</option>
          ))}
        </select>
      </span>
      <span class="field">
        <label for="log-text">Text</label>
        <input id="log-text" type="search" value={filter.value.text} onInput={(event) => change({ text: event.currentTarget.value })} />
      </span>
      <span class="muted">
        {shown.value.length} of {log.value.length}
        {log.value.length === LOG_LIMIT ? ", older ones are gone" : ""}
      </span>
    </form>
  );
}

/// Stays at the newest line unless the person scrolled up.
function Lines() {
  const frame = useRef<HTMLDivElement>(null);
  const at_end = useRef(true);
  const records = shown.value;
  useEffect(() => {
    if (frame.current !== null && at_end.current) frame.current.scrollTop = frame.current.scrollHeight;
  }, [records]);
  const scrolled = (event: Event) => {
    const box = event.currentTarget as HTMLElement;
    at_end.current = box.scrollHeight - box.scrollTop - box.clientHeight < 30;
  };
  return (
    <div class="scroll tall log" ref={frame} tabIndex={0} role="group" aria-label="Log lines" onScroll={scrolled}>
      <ol>
        {records.map((one) => (
          <li key={`${one.stamp_ns} ${one.host} ${one.service} ${one.text}`} class={one.level}>
            <time>{clock(host_ms(one.stamp_ns), now_ms.value)}</time> <b>{one.level}</b> <i>{one.service}</i> <span>{one.text}</span>
          </li>
        ))}
      </ol>
    </div>
  );
}

export function Log() {
  return (
    <Panel id="log" title="Log" topics={["log"]}>
      <Filters />
      {shown.value.length === 0 ? <Nothing>{log.value.length === 0 ? "Nothing was said yet." : "Nothing matches the filter."}</Nothing> : <Lines />}
    </Panel>
  );
}
