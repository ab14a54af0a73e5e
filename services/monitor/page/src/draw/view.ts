// The camera's picture with what was seen in this very picture drawn over it.
import { metres, words } from "../format";
import type { Picture } from "../store";
import type { PicturePoint, View } from "../wire";
import { polyline } from "./canvas";

// Over a picture the theme does not count: these are seen on grass, gravel and snow.
const RAIL = "#18e0ff";
const RAIL_RIM = "rgba(0, 20, 40, 0.75)";
const MARK = "#ffd24a";

/// What is drawn must belong to the picture shown.
export const belongs = (view: View | null, picture: Picture): view is View =>
  view !== null && view.camera === picture.camera && view.stamp_ns === picture.stamp_ns;

export function draw_view(canvas: HTMLCanvasElement, picture: Picture, view: View | null): void {
  const { image } = picture;
  if (canvas.width !== image.width || canvas.height !== image.height) {
    canvas.width = image.width;
    canvas.height = image.height;
  }
  const context = canvas.getContext("2d");
  if (context === null) return;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.drawImage(image, 0, 0);
  if (!belongs(view, picture)) return;
  const size = image.width / 640; // line widths and text as on a picture of 640 pixels
  const scale = image.width / view.width;
  const place = ([x, y]: PicturePoint): [number, number] => [x * scale, y * scale];
  for (const rail of view.rails === null ? [] : [view.rails.left, view.rails.right]) {
    polyline(context, rail.map(place));
    context.strokeStyle = RAIL_RIM;
    context.lineWidth = 5 * size;
    context.stroke();
    context.strokeStyle = RAIL;
    context.lineWidth = 2.5 * size;
    context.stroke();
  }
  context.font = `600 ${13 * size}px system-ui, sans-serif`;
  for (const one of view.landmarks) {
    const [x, y] = place([one.x, one.y]);
    context.strokeStyle = MARK;
    context.lineWidth = 2.5 * size;
    context.strokeRect(x - 8 * size, y - 8 * size, 16 * size, 16 * size);
    name_mark(context, `${one.name || words(one.kind)} ${metres(one.ahead_m)}`, x + 12 * size, y, size);
  }
}

function name_mark(context: CanvasRenderingContext2D, text: string, x: number, y: number, size: number): void {
  const width = context.measureText(text).width;
  const left = Math.min(x, context.canvas.width - width - 6 * size);
  context.fillStyle = "rgba(10, 16, 24, 0.72)";
  context.fillRect(left - 4 * size, y - 11 * size, width + 8 * size, 17 * size);
  context.fillStyle = MARK;
  context.fillText(text, left, y + 2 * size);
}

export function view_in_words(view: View | null): string {
  if (view === null) return "Camera picture. Nothing is known about what it shows.";
  const rails = view.seen ? "Both rails are seen." : `Rails not seen: ${view.why || "no reason given"}.`;
  const marks = view.landmarks.map((one) => `${one.name || words(one.kind)} in ${metres(one.ahead_m)}`);
  const health = view.health.length === 0 ? "" : ` The picture is ${view.health.map(words).join(", ")}.`;
  return `Camera picture. ${rails}${marks.length === 0 ? "" : ` In sight: ${marks.join(", ")}.`}${health}`;
}

