// What the recorder does, and its buttons.
import { signal } from "@preact/signals";
import { bytes, bytes_per_s, clock, duration, number } from "../format";
import { host_ms, now_ms, recorder } from "../store";
import type { RecorderStatus } from "../wire";
import { AnswerLine, may_control, no_answer, send, TokenField } from "./control";
import { Nothing, Panel } from "./panel";

const answer = signal(no_answer);
const event_text = signal("");

const STATES = {
  stopped: ["Stopped", "warn"],
  recording: ["Recording", "ok"],
  paused: ["Paused", "warn"],
  waiting: ["Waiting for an event", "ok"],
} as const;

const command = (name: string, argument = "") => send(answer, "recorder", name, argument);

function Buttons({ one }: { one: RecorderStatus }) {
  const able = may_control() && !answer.value.busy;
  const state = one.state;
  const running = one.file !== ""; // it may wait for an event without one
  return (
    <div class="buttons" role="group" aria-label="Recorder control">
      <button disabled={!able || running} onClick={() => void command("start")}>Start</button>
      <button disabled={!able || !running} onClick={() => void command("stop")}>Stop</button>
      {state === "paused" ? (
        <button disabled={!able} onClick={() => void command("resume")}>Go on</button>
      ) : (
        <button disabled={!able || !running} onClick={() => void command("pause")}>Pause</button>
      )}
      <button disabled={!able || one.file === ""} onClick={() => void command("protect", one.file)}>Protect this file</button>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void command("event", event_text.value.trim() || "by hand").then((done) => done && (event_text.value = ""));
        }}
      >
        <input aria-label="What happened" placeholder="What happened" maxLength={200} value={event_text.value}
          onInput={(event) => (event_text.value = event.currentTarget.value)} />
        <button disabled={!able || (!running && one.ring_s === 0)}>Mark event</button>
      </form>
    </div>
  );
}

function Disk({ one }: { one: RecorderStatus }) {
  const limit = one.quota_mb > 0 ? one.quota_mb : one.kept_mb + (one.disk_free_mb ?? 0);
  const share = limit > 0 ? Math.min(1, one.kept_mb / limit) : 0;
  const text = one.quota_mb > 0 ? `${bytes(one.kept_mb * 1e6)} of ${bytes(one.quota_mb * 1e6)} allowed` : `${bytes(one.kept_mb * 1e6)}, no limit`;
  return (
    <>
      <dt>Kept</dt>
      <dd>
        {text}, {one.files} {one.files === 1 ? "file" : "files"}, {one.protected_files} protected
        <meter min={0} max={1} value={share} high={0.9} aria-label="Share of the room used by recordings" />
      </dd>
      <dt>Disk free</dt>
      <dd>{bytes(one.disk_free_mb === null ? null : one.disk_free_mb * 1e6)}</dd>
    </>
  );
}

function Facts({ one }: { one: RecorderStatus }) {
  const [name, level] = STATES[one.state];
  const since = one.started_ns === 0 ? "" : ` since ${clock(host_ms(one.started_ns), now_ms.value)} (${duration((one.stamp_ns - one.started_ns) / 1e9)})`;
  return (
    <dl class="facts">
      <dt>State</dt>
      <dd>
        <span class={`state ${level}`}>{name}</span>
        {since}
      </dd>
      <dt>File</dt>
      <dd class="path">{one.file === "" ? "none open" : one.file}</dd>
      <dt>Written</dt>
      <dd>
        {bytes(one.bytes)}, {number(one.messages, 0)} messages, {bytes_per_s(one.bytes_per_s)}
      </dd>
      <dt>Waiting for the disk</dt>
      <dd>{bytes(one.queue_mb * 1e6)}</dd>
      <dt>An event reaches back</dt>
      <dd>{duration(one.ring_s)}</dd>
      <dt>Last event</dt>
      <dd>{one.event_ns === 0 ? "none" : `${one.event || "without a name"}, ${clock(host_ms(one.event_ns), now_ms.value)}`}</dd>
      <Disk one={one} />
    </dl>
  );
}

const CAUSES = { transport: "never came", encoder: "too fast to encode", queue: "waited too long", disk: "not written" } as const;

function Lost({ one }: { one: RecorderStatus }) {
  if (one.lost.length === 0) return <p class="fine">Nothing lost</p>;
  const causes = Object.keys(CAUSES) as (keyof typeof CAUSES)[];
  return (
    <div class="scroll" tabIndex={0} role="group" aria-label="Lost samples by cause">
      <table>
        <caption>Lost samples</caption>
        <thead>
          <tr>
            <th scope="col">Topic</th>
            {causes.map((cause) => (
              <th scope="col" class="n" key={cause}>{CAUSES[cause]}</th>
            ))}
          </tr>
        </thead>
        <tbody>
          {one.lost.map((lost) => (
            <tr key={lost.topic}>
              <th scope="row">{lost.topic}</th>
              {causes.map((cause) => (
                <td class={`n ${lost[cause] > 0 ? "warn" : ""}`} key={cause}>{number(lost[cause], 0)}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

export function Recorder() {
  const one = recorder.value.value;
  return (
    <Panel id="recorder" title="Recorder" topics={["recorder"]} kind={one?.absent ? undefined : "recorder"}>
      {one === null || one.absent ? (
        <Nothing>{one === null ? "Nothing heard of a recorder yet." : "No recorder runs on this train."}</Nothing>
      ) : (
        <>
          <Buttons one={one} />
          <TokenField />
          <AnswerLine answer={answer} />
          <Facts one={one} />
          <Lost one={one} />
        </>
      )}
    </Panel>
  );
}
