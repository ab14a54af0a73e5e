// A line of 6 km with bends, a second track from a switch at 1,650 m, and things beside it.
export const curvature_at = (s) => (s > 600 && s < 1200 ? 1 / 900 : s > 1900 && s < 2900 ? -1 / 620 : s > 3300 && s < 4200 ? 1 / 1100 : 0);

function walk(from, to, start, bend) {
  let [e, n, heading] = start;
  const line = [[0, e, n, 430, bend(from)]];
  for (let s = from + 10; s <= to; s += 10) {
    heading -= bend(s - 5) * 10;
    e += Math.sin(heading) * 10;
    n += Math.cos(heading) * 10;
    line.push([s - from, e, n, 430, bend(s)]);
  }
  return { line, end: [e, n, heading] };
}

export function line_map() {
  const main = walk(0, 6000, [600000, 200000, 1.1], curvature_at).line;
  const heading_at = (i) => Math.atan2(main[i + 1][1] - main[i][1], main[i + 1][2] - main[i][2]);
  const at_switch = main[165];
  const side = walk(0, 700, [at_switch[1], at_switch[2], heading_at(165)], (s) => (s < 60 ? -1 / 300 : s < 120 ? 1 / 300 : 0)).line;
  const beside = (id, kind, name, offset_m, across_m) => ({
    id, kind, name, edge: 1, offset_m, across_m, easting_m: main[Math.round(offset_m / 10)][1], northing_m: main[Math.round(offset_m / 10)][2],
  });
  return {
    edges: [{ id: 1, name: "track 1", length_m: 6000, line: main }, { id: 2, length_m: 700, line: side }],
    switches: [{ id: 1, edge: 1, offset_m: 1650, easting_m: at_switch[1], northing_m: at_switch[2] }],
    landmarks: [
      beside(1, "platform", "Oberwil", 900, 3), beside(2, "platform", "Talheim", 2300, -3), beside(3, "balise", "123-4567", 1600, 0),
      beside(4, "balise", "123-4568", 2050, 0), beside(5, "frog", "", 1680, 0), beside(6, "portal_in", "Burgtunnel", 3100, 0),
      beside(7, "portal_out", "Burgtunnel", 3600, 0), beside(8, "bridge", "Aarebrücke", 4300, 0),
      ...Array.from({ length: 60 }, (_, i) => beside(100 + i, "mast", `${Math.floor(i / 10)}/${i % 10}`, 1000 + i * 60, i % 2 ? 3 : -3)),
    ],
    at(edge, offset) {
      const line = edge === 1 ? main : side;
      const i = Math.min(line.length - 2, Math.floor(offset / 10));
      const share = offset / 10 - i;
      const [a, b] = [line[i], line[i + 1]];
      return [a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]), Math.atan2(b[1] - a[1], b[2] - a[2])];
    },
  };
}
