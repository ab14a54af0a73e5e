// Whose train this is, and whether what is shown is live.
import { clock, duration } from "../format";
import { about, connection, is_late, late_s, now_ms } from "../store";
import { choice, type Choice } from "../theme";

function Connection() {
  const { up, since_ms, ever } = connection.value;
  const since = `${clock(since_ms, now_ms.value)} (${duration((now_ms.value - since_ms) / 1000)})`;
  const text = up ? (is_late.value ? `Connected, ${duration(late_s.value)} late` : "Connected") : ever ? `No connection to the train since ${since}` : "Connecting …";
  return <p class={`connection ${up ? (is_late.value ? "warn" : "ok") : ever ? "bad" : "warn"}`} title={up ? `connected since ${since}` : undefined}>{text}</p>;
}

export function Header() {
  const one = about.value;
  return (
    <header class="top">
      <h1>
        <span class="mark" aria-hidden="true" />
        <span class="brand">Railfix</span> <span class="train">{one === null ? "" : `train ${one.train}`}</span>
      </h1>
      <Connection />
      <p class="muted host">{one === null ? "" : `${one.host} · version ${one.version}`}</p>
      <p class="muted time">{clock(now_ms.value, now_ms.value)}</p>
      <label class="choice">
        <span class="unseen">Colours</span>
        <select value={choice.value} onChange={(event) => (choice.value = event.currentTarget.value as Choice)}>
          <option value="system">Auto</option>
          <option value="light">Light</option>
          <option value="dark">Dark</option>
        </select>
      </label>
    </header>
  );
}
