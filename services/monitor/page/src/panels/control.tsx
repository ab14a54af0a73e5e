// Asking a service to do something, and what it answered.
import { type Signal, signal } from "@preact/signals";
import { token } from "../live";
import { about, connection } from "../store";
import type { Reply } from "../wire";

export type Ask = (service: string, command: string, argument?: string) => Promise<Reply>;

/// Set once by main: the socket's control().
export const ask = signal<Ask>(() => Promise.resolve({ id: 0, done: false, text: "There is no connection to the train." }));

export const may_control = () => connection.value.up && (about.value?.control === "open" || (about.value?.control === "token" && token.value !== ""));

export interface Answer {
  busy: boolean;
  done: boolean;
  text: string;
}
export const no_answer: Answer = { busy: false, done: true, text: "" };

export async function send(answer: Signal<Answer>, service: string, command: string, argument = ""): Promise<boolean> {
  answer.value = { busy: true, done: true, text: "" };
  const reply = await ask.value(service, command, argument);
  const text = reply.done ? `Done: ${reply.text || command}` : reply.text || `${command}: refused without a reason`;
  answer.value = { busy: false, done: reply.done, text };
  return reply.done;
}

export function AnswerLine({ answer }: { answer: Signal<Answer> }) {
  return (
    <p class={`answer ${answer.value.done ? "" : "bad"}`} role="status">
      {answer.value.text}
    </p>
  );
}

/// Stands in one panel at a time: a train that replays has no recorder to control.
export function TokenField() {
  if (about.value?.control === "off") return <p class="nothing">Control is switched off (monitor.control).</p>;
  if (about.value?.control === "no_token") return <p class="nothing">Control from here needs a token, and none is set (monitor.token).</p>;
  if (about.value?.control !== "token") return null;
  return (
    <span class="field">
      <label for="token">Token for control</label>
      <input id="token" type="password" autocomplete="off" value={token.value} onInput={(event) => (token.value = event.currentTarget.value)} />
    </span>
  );
}
