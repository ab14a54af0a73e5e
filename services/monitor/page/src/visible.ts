// What the person can see decides what is asked for: open panels near the window's part of the page, and nothing but the problems while
// the page is hidden.
import { computed, signal } from "@preact/signals";

const NEAR = "300px"; // a panel that close is asked for before it scrolls in

export const page_visible = signal(document.visibilityState === "visible");
const shown = signal<ReadonlyMap<string, readonly string[]>>(new Map());

/// The list for the monitor: state and problems are on every screen, above all panels.
export const wanted = computed(() => {
  if (!page_visible.value) return ["problems"];
  return [...new Set(["state", "problems", ...[...shown.value.values()].flat()])].sort();
});

document.addEventListener("visibilitychange", () => {
  page_visible.value = document.visibilityState === "visible";
});

export function show(panel: string, topics: readonly string[] | null): void {
  const next = new Map(shown.value);
  if (topics === null) next.delete(panel);
  else next.set(panel, topics);
  shown.value = next;
}

/// Calls back whenever the element comes near the window or leaves it. Returns how to stop.
export function observe(element: Element, seen: (near: boolean) => void): () => void {
  const observer = new IntersectionObserver((entries) => seen(entries.some((entry) => entry.isIntersecting)), { rootMargin: NEAR });
  observer.observe(element);
  return () => observer.disconnect();
}
