// A recording is played to this train: a bar over its time.
import { signal } from "@preact/signals";
import { clock, duration, number, played } from "../format";
import { now_ms, player } from "../store";
import type { PlayerStatus } from "../wire";
import { AnswerLine, may_control, no_answer, send, TokenField } from "./control";
import { Panel } from "./panel";

const answer = signal(no_answer);
const held_s = signal<number | null>(null); // where the bar is being dragged to

const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16];
const command = (name: string, argument = "") => send(answer, "player", name, argument);

export const at_s = (one: PlayerStatus) => (one.at_ns - one.from_ns) / 1e9;
export const length_s = (one: PlayerStatus) => Math.max(0, (one.to_ns - one.from_ns) / 1e9);

function Bar({ one, able }: { one: PlayerStatus; able: boolean }) {
  const at = held_s.value ?? at_s(one);
  const let_go = (seconds: number) => {
    held_s.value = seconds;
    void command("seek", seconds.toFixed(3)).then(() => (held_s.value = null));
  };
  return (
    <div class="timebar">
      <span class="played">{played(at)}</span>
      <input type="range" min={0} max={length_s(one)} step={0.1} value={at} disabled={!able} aria-label="Place in the recording"
        aria-valuetext={`${played(at)} of ${played(length_s(one))}`}
        onInput={(event) => (held_s.value = Number(event.currentTarget.value))}
        onChange={(event) => let_go(Number(event.currentTarget.value))} />
      <span class="played">{played(length_s(one))}</span>
    </div>
  );
}

function Buttons({ one, able }: { one: PlayerStatus; able: boolean }) {
  const rates = RATES.includes(one.rate) ? RATES : [...RATES, one.rate].sort((a, b) => a - b);
  return (
    <div class="buttons" role="group" aria-label="Player control">
      {one.state === "playing" ? (
        <button disabled={!able} onClick={() => void command("pause")}>Pause</button>
      ) : (
        <button disabled={!able} onClick={() => void command("play")}>Play</button>
      )}
      <button disabled={!able || one.state === "playing"} onClick={() => void command("step")}>Step</button>
      <span class="field">
        <label for="player-rate">Rate</label>
        <select id="player-rate" value={String(one.rate)} disabled={!able || one.lock_step} onChange={(event) => void command("rate", event.currentTarget.value)}>
          {rates.map((rate) => (
            <option key={rate} value={String(rate)}>{number(rate, rate < 1 ? 2 : 0)} ×</option>
          ))}
        </select>
      </span>
      <label>
        <input type="checkbox" checked={one.looped} disabled={!able} onChange={(event) => void command("loop", event.currentTarget.checked ? "on" : "off")} />
        Again at the end
      </label>
      <span class="muted">{one.lock_step ? "lock step: each picture waits for its consumers" : ""}</span>
    </div>
  );
}

/// Only there when a recording is played.
export function Player() {
  const one = player.value.value;
  if (one === null || one.absent) return null;
  const able = may_control() && !answer.value.busy;
  const word = { playing: "Playing", paused: "Paused", ended: "At the end" }[one.state];
  return (
    <Panel id="player" title="Replay" topics={["player"]} kind="player"
      aside={<span class="muted">{word} · {one.file} · recorded {clock(one.at_ns / 1e6, now_ms.value)} · {duration(length_s(one))}</span>}>
      <Bar one={one} able={able} />
      <Buttons one={one} able={able} />
      <TokenField />
      <AnswerLine answer={answer} />
    </Panel>
  );
}
