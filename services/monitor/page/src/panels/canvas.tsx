// A canvas that is drawn anew when something it reads changes, when its size changes, and when the theme does.
import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { theme } from "../theme";

interface Props {
  draw: (canvas: HTMLCanvasElement) => void;
  words: string; // for screen readers; never announced by itself
  class?: string;
}

export function Drawing({ draw, words, class: name }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const size = useSignal(0);
  const latest = useRef(draw);
  latest.current = draw;
  useEffect(() => {
    const observer = new ResizeObserver(() => size.value++);
    if (canvas.current !== null) observer.observe(canvas.current);
    return () => observer.disconnect();
  }, []);
  useSignalEffect(() => {
    size.value;
    theme.value;
    if (canvas.current !== null) latest.current(canvas.current);
  });
  useEffect(() => {
    if (canvas.current !== null) draw(canvas.current);
  }, [draw]);
  return <canvas ref={canvas} class={name} role="img" aria-label={words} />;
}
