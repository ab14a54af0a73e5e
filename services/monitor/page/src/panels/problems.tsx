// What is wrong, first thing on the page; a lost connection before all else.
import { computed, useSignal, useSignalEffect } from "@preact/signals";
import { useRef } from "preact/hooks";
import { clock, duration } from "../format";
import { age_of, connection, fresh, is_late, late_s, now_ms, problems } from "../store";
import { verdict } from "../verdict";
import type { Problem } from "../wire";

export const LOST = "connection";
const LATE = "late";
const late_since_ms = computed(() => (is_late.value ? Date.now() : 0));

function late(): Problem {
  return {
    id: LATE,
    level: "error",
    what: `What is shown is ${duration(late_s.value)} old: the link to the train or this browser is slow`,
    what_to_do: "The train itself may be well. Close other pages and panels, or use a faster link or computer.",
    since_ns: late_since_ms.value * 1e6,
  };
}

/// The monitor's problems, and our own when there is no connection or a slow one: then the monitor's are old news.
export function all_problems(): Problem[] {
  const known = problems.value ?? [];
  const { up, since_ms, ever } = connection.value;
  if (up && is_late.value) return [late(), ...known];
  if (up || (!ever && now_ms.value - since_ms < 1500)) return known;
  const lost: Problem = {
    id: LOST,
    level: "error",
    what: ever ? "No connection to the train" : "No connection to the train yet",
    what_to_do: "Nothing on this page is live. It comes back by itself; if not, check the network and the monitor service.",
    since_ns: since_ms * 1e6,
  };
  return [lost, ...known];
}

function One({ problem, old }: { problem: Problem; old: boolean }) {
  const since_ms = problem.since_ns / 1e6;
  return (
    <li class={`problem ${problem.level} ${old ? "stale" : ""}`}>
      <span class="badge">{problem.level === "error" ? "Error" : "Warning"}</span>
      <span class="what">{problem.what}</span>
      <span class="since">
        since {clock(since_ms, now_ms.value)} ({duration((now_ms.value - since_ms) / 1000)})
      </span>
      <span class="todo">{problem.what_to_do}</span>
    </li>
  );
}

function NoProblem() {
  const { level, text } = verdict(problems.value !== null, fresh("state"), age_of("state"));
  return <p class={level}>{text}</p>;
}

export function Problems() {
  const list = all_problems();
  const old = !connection.value.up || is_late.value;
  const own = (problem: Problem) => problem.id === LOST || problem.id === LATE;
  return (
    <section id="problems" aria-labelledby="problems-title">
      <h2 id="problems-title" class="unseen">
        Problems
      </h2>
      {list.length > 0 ? (
        <ul>
          {list.map((problem) => (
            <One key={problem.id} problem={problem} old={old && !own(problem)} />
          ))}
        </ul>
      ) : (
        <NoProblem />
      )}
      <Announcements />
    </section>
  );
}

const QUIET_MS = 5000; // between two announcements

/// For screen readers: only what began or ended, not more often than every five seconds.
function Announcements() {
  const text = useSignal("");
  const said = useRef(new Map<string, string>());
  const last_ms = useRef(0);
  useSignalEffect(() => {
    if (connection.value.up && problems.value === null) return; // just asked for: not over
    const current = new Map(all_problems().map((one) => [one.id, one.what]));
    if (now_ms.value - last_ms.current < QUIET_MS) return;
    const begun = [...current].filter(([id]) => !said.current.has(id)).map(([, what]) => what);
    const ended = [...said.current].filter(([id]) => !current.has(id)).map(([, what]) => `Over: ${what}`);
    if (begun.length + ended.length === 0) return;
    said.current = current;
    last_ms.current = now_ms.value;
    text.value = [...begun, ...ended].join(". ");
  });
  return (
    <p class="unseen" role="status">
      {text}
    </p>
  );
}
