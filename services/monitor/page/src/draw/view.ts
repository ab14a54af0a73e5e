// The camera's picture with what was seen in this very picture drawn over it.
import { capital, number, words } from "../format";
import { type Box, overlap } from "../track_map";
import type { Picture } from "../store";
import type { PicturePoint, View } from "../wire";
import { polyline } from "./canvas";

// Over a picture the theme does not count: these are seen on grass, gravel and snow.
const RAIL = "#18e0ff";
const RAIL_RIM = "rgba(0, 20, 40, 0.75)";
const MARK = "#ffd24a";
const NAMED_UP_TO_M = 120;

export function draw_view(canvas: HTMLCanvasElement, picture: Picture): void {
  const { image, view } = picture;
  if (canvas.width !== image.width || canvas.height !== image.height) {
    canvas.width = image.width;
    canvas.height = image.height;
  }
  const context = canvas.getContext("2d");
  if (context === null) return;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.drawImage(image, 0, 0);
  if (view === null) return;
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
  draw_marks(context, view.landmarks.map((one) => ({ at: place([one.x, one.y]), one })), size);
}

const name_of = (one: View["landmarks"][number]) => (one.name.startsWith(words(one.kind)) ? one.name : `${words(one.kind)} ${one.name}`.trim());

/// The nearest first; names only where they cover no other.
function draw_marks(context: CanvasRenderingContext2D, marks: { at: [number, number]; one: View["landmarks"][number] }[], size: number): void {
  const taken: Box[] = [];
  context.font = `600 ${12 * size}px system-ui, sans-serif`;
  context.lineWidth = 2 * size;
  for (const { at, one } of [...marks].sort((a, b) => a.one.ahead_m - b.one.ahead_m)) {
    const half = Math.max(3, Math.min(9, 220 / one.ahead_m)) * size;
    context.strokeStyle = MARK;
    context.strokeRect(at[0] - half, at[1] - half, 2 * half, 2 * half);
    const text = `${name_of(one)}, ${number(one.ahead_m, 0)} m`;
    const width = context.measureText(text).width;
    const left = Math.min(at[0] + half + 4 * size, context.canvas.width - width - 6 * size);
    const box = { west: left - 4 * size, east: left + width + 4 * size, south: at[1] - 9 * size, north: at[1] + 7 * size };
    if (one.ahead_m > NAMED_UP_TO_M || taken.some((other) => overlap(box, other))) continue;
    taken.push(box);
    context.fillStyle = "rgba(10, 16, 24, 0.72)";
    context.fillRect(box.west, box.south, box.east - box.west, box.north - box.south);
    context.fillStyle = MARK;
    context.fillText(text, left, at[1] + 3.5 * size);
  }
}

/// "Rails not seen", "Left rail not seen", "Rails not seen: no answer of ...".
export function not_seen(view: View): string {
  if (view.why === null || view.why === "" || view.why === "not seen") return "Rails not seen";
  return view.why.endsWith("rail not seen") ? capital(view.why) : `Rails not seen: ${view.why}`;
}

export function view_in_words(view: View | null): string {
  if (view === null) return "Camera picture. Nothing is known about what it shows.";
  const rails = view.seen ? "Both rails are seen." : `${not_seen(view)}.`;
  const marks = view.landmarks.slice(0, 5).map((one) => `${name_of(one)} in ${number(one.ahead_m, 0)} m`);
  const health = view.health.length === 0 ? "" : ` The picture is ${view.health.map(words).join(", ")}.`;
  return `Camera picture. ${rails}${marks.length === 0 ? "" : ` By the map there come ${marks.join(", ")}.`}${health}`;
}

