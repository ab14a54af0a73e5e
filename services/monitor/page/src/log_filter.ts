// Which lines of the log are shown.
import type { LogLevel, LogRecord } from "./wire";

export const LEVELS: readonly LogLevel[] = ["trace", "debug", "info", "warning", "error", "critical"];

export interface Filter {
  service: string; // empty = all
  least: LogLevel;
  text: string;
}

export function filtered(records: readonly LogRecord[], filter: Filter): LogRecord[] {
  const least = LEVELS.indexOf(filter.least);
  const text = filter.text.trim().toLowerCase();
  return records.filter(
    (one) =>
      (filter.service === "" || one.service === filter.service) &&
      LEVELS.indexOf(one.level) >= least &&
      (text === "" || `${one.service} ${one.host} ${one.text}`.toLowerCase().includes(text)),
  );
}
