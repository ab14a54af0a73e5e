// Small choices that outlive the page: theme, which panels are closed. Private windows may refuse; then nothing is kept.
import { effect, type Signal, signal } from "@preact/signals";

export function kept<T extends string>(name: string, start: T): Signal<T> {
  let first = start;
  try {
    first = (localStorage.getItem(`railfix.${name}`) as T | null) ?? start;
  } catch {
    // as said above
  }
  const one = signal<T>(first);
  effect(() => {
    const value = one.value;
    try {
      localStorage.setItem(`railfix.${name}`, value);
    } catch {
      // as said above
    }
  });
  return one;
}
