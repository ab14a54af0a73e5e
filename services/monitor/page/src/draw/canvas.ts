// A canvas as sharp as the screen, in the colours of the style sheet.

export interface Sheet {
  context: CanvasRenderingContext2D;
  width: number; // CSS pixels
  height: number;
}

/// Cleared and scaled to CSS pixels; null while it has no size.
export function sheet(canvas: HTMLCanvasElement): Sheet | null {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  const context = canvas.getContext("2d");
  if (context === null || width < 2 || height < 2) return null;
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = `11px ${getComputedStyle(canvas).fontFamily}`;
  context.lineJoin = "round";
  context.lineCap = "butt";
  return { context, width, height };
}

export interface Colours {
  text: string;
  muted: string;
  faint: string; // grids
  panel: string;
  track: string;
  train: string;
  band: string; // the confidence interval
  maybe: string; // tracks that are possible
  landmark: string;
  bad: string;
}

let known: { theme: string; colours: Colours } | null = null;

export function colours(): Colours {
  const theme = document.documentElement.dataset.theme ?? "";
  if (known?.theme !== theme) {
    const style = getComputedStyle(document.documentElement);
    const of = (name: string) => style.getPropertyValue(`--${name}`).trim();
    known = {
      theme,
      colours: {
        text: of("text"), muted: of("muted"), faint: of("line"), panel: of("panel"), track: of("track"), train: of("accent"),
        band: of("band"), maybe: of("warn"), landmark: of("landmark"), bad: of("bad"),
      },
    };
  }
  return known.colours;
}

export function polyline(context: CanvasRenderingContext2D, points: readonly (readonly [number, number])[]): void {
  context.beginPath();
  points.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
}

/// Text with a rim in the panel's colour, readable over lines.
export function label(context: CanvasRenderingContext2D, text: string, x: number, y: number, colour: string): void {
  context.lineWidth = 3;
  context.strokeStyle = colours().panel;
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

/// 1, 2 or 5 times a power of ten, not larger than `largest`.
export function round_step(largest: number): number {
  const power = 10 ** Math.floor(Math.log10(largest));
  const rest = largest / power;
  return (rest >= 5 ? 5 : rest >= 2 ? 2 : 1) * power;
}
