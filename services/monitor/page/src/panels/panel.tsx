// The frame of every panel: title, open or closed, how old what it shows is, and what it needs from the monitor.
import { useSignal, useSignalEffect } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { duration } from "../format";
import { kept } from "../keep";
import { age_of, connection, fresh, is_late } from "../store";
import { observe, show } from "../visible";

interface Props {
  id: string;
  title: string;
  topics: readonly string[];
  kind?: Parameters<typeof age_of>[0] | undefined; // whose age is shown and greys the content; without one the connection does
  aside?: ComponentChildren;
  children: ComponentChildren;
}

export function Panel({ id, title, topics, kind, aside, children }: Props) {
  const open = useMemo(() => kept<"open" | "closed">(`panel.${id}`, "open"), [id]);
  const near = useSignal(false);
  const frame = useRef<HTMLElement>(null);
  useEffect(() => (frame.current === null ? undefined : observe(frame.current, (now) => (near.value = now))), []);
  const list = topics.join();
  useSignalEffect(() => show(id, open.value === "open" && near.value ? list.split(",") : null));
  useEffect(() => show(id, open.value === "open" && near.value ? list.split(",") : null), [list]);
  useEffect(() => () => show(id, null), []);
  const is_open = open.value === "open";
  const unheard = (!connection.value.up && connection.value.ever) || is_late.value;
  const old = is_open && (kind === undefined ? unheard : fresh(kind) === "stale");
  return (
    <section class={`panel ${old ? "stale" : ""}`} id={id} ref={frame} aria-labelledby={`${id}-title`}>
      <header>
        <h2 id={`${id}-title`}>
          <button aria-expanded={is_open} aria-controls={`${id}-body`} onClick={() => (open.value = is_open ? "closed" : "open")}>
            <span class="turn" aria-hidden="true" />
            {title}
          </button>
        </h2>
        {is_open && kind !== undefined && <Age kind={kind} />}
        {is_open && aside !== undefined && <div class="aside">{aside}</div>}
      </header>
      <div class="body" id={`${id}-body`} hidden={!is_open}>
        {is_open && children}
      </div>
    </section>
  );
}

/// Says nothing while the values are live.
function Age({ kind }: { kind: Parameters<typeof age_of>[0] }) {
  const now = fresh(kind);
  if (now === "live") return null;
  return <span class="age">{now === "none" ? "waiting" : `${duration(age_of(kind))} old`}</span>;
}

export function Nothing({ children }: { children: ComponentChildren }) {
  return <p class="nothing">{children}</p>;
}
