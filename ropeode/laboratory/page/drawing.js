// @ts-check
// The picture of one moment, drawn with any pen.
import { clipped } from "./clip.js";
import { palette } from "./colours.js";
import { shortly } from "./numbers.js";
/** @typedef {import("./pens").Pen} Pen */
/** @typedef {import("./extent").Box} Box */
/** @typedef {import("./messages").Truth} Truth */
/** @typedef {{x: number, y: number, width: number, height: number}} Frame a part of the picture, in pixels */
/** @typedef {(x: number, y: number) => [number, number]} Place of the data in the picture */
/**
 * @typedef {object} Figure
 * @property {ArrayLike<number>} points x, y, x, y, ... in data units; none where the run has ended
 * @property {number[]} trail x, y, x, y, ...: the way of the chosen node, or of an orbit
 * @property {string} colour
 * @property {number[]} dash
 * @property {boolean} reference
 */

// Pixels; what is farther away is there.
const FAR = 1e9;

/**
 * The map from data to pixels which shows a box in the middle of a frame.
 *
 * @param {Box} box @param {Frame} frame
 * @param {boolean} square whether both axes have one scale
 * @returns {{place: Place, sx: number, sy: number}} and pixels for each unit
 */
export function placing(box, frame, square) {
  let sx = frame.width / (box.x1 - box.x0);
  let sy = frame.height / (box.y1 - box.y0);
  if (square) sx = sy = Math.min(sx, sy);
  const cx = frame.x + frame.width / 2 - (sx * (box.x0 + box.x1)) / 2;
  const cy = frame.y + frame.height / 2 + (sy * (box.y0 + box.y1)) / 2;
  return { place: (x, y) => [near(cx + sx * x), near(cy - sy * y)], sx, sy };
}

/** @param {number} pixels */
function near(pixels) {
  return Math.max(-FAR, Math.min(FAR, pixels));
}

/** @param {Place} place @param {ArrayLike<number>} xy @returns {Float64Array} */
export function placed(place, xy) {
  const pixels = new Float64Array(xy.length);
  for (let k = 0; k < xy.length; k += 2) [pixels[k], pixels[k + 1]] = place(xy[k], xy[k + 1]);
  return pixels;
}

/**
 * A rope, a pendulum, bodies on orbits or a point of a phase plane.
 *
 * @param {Pen} pen @param {Truth} truth @param {Figure} figure @param {Place} place
 * @param {number | null} chosen point
 * @param {Frame} frame
 */
export function drawFigure(pen, truth, figure, place, chosen, frame) {
  const { colour, dash, reference } = figure;
  const points = placed(place, figure.points);
  const { ink } = palette();
  if (figure.trail.length) {
    const trail = clipped(placed(place, figure.trail), null, frame);
    pen.lines(trail.xy, trail.links, {
      colour, width: reference ? 1.5 : 1.2, opacity: reference ? 0.7 : 0.6, dash: reference ? [] : dash,
    });
  }
  if (!points.length) return;
  const joined = clipped(points, truth.links, frame);
  if (truth.links.length)
    pen.lines(joined.xy, joined.links, { colour, width: reference ? 7 : 2.2, dash, opacity: reference ? 0.55 : 1 });
  const radius = radiusOf(truth, points.length / 2) + (reference ? 2 : 0);
  const fixed = new Set(truth.fixed);
  const moving = points.filter((_, k) => !fixed.has(Math.floor(k / 2)));
  pen.dots(moving, radius, { colour, opacity: reference ? 0.75 : 1 });
  if (reference)
    for (const i of fixed)
      pen.box(points[2 * i] - 5, points[2 * i + 1] - 5, 10, 10, { colour: ink });
  if (chosen !== null)
    pen.dots(points.slice(2 * chosen, 2 * chosen + 2), radius + 4, {
      colour: reference ? ink : colour, width: 1.8,
    });
}

/** @param {Truth} truth @param {number} points */
function radiusOf(truth, points) {
  if (truth.drawing === "pendulum") return 8;
  if (truth.drawing !== "rope") return 5.5;
  return Math.max(1, Math.min(4, 90 / points));
}

/**
 * Where points left the view: a cross at the edge.
 *
 * @param {Pen} pen @param {Place} place @param {import("./extent").Leaving[]} leaving
 * @param {string} colour @param {Frame} frame
 */
export function drawLeaving(pen, place, leaving, colour, frame) {
  const size = 5;
  for (const { x, y } of leaving) {
    const [px, py] = place(x, y);
    const cx = Math.max(frame.x + size, Math.min(frame.x + frame.width - size, px));
    const cy = Math.max(frame.y + size, Math.min(frame.y + frame.height - size, py));
    pen.lines([cx - size, cy - size, cx + size, cy + size, cx - size, cy + size, cx + size, cy - size],
      [[0, 1], [2, 3]], { colour, width: 2 });
  }
}

/**
 * How large things are: a bar of a round length, or axes where the plane is no space.
 *
 * @param {Pen} pen @param {Truth} truth @param {Box} box @param {Frame} frame
 * @param {{place: Place, sx: number, sy: number}} scale
 */
export function drawScale(pen, truth, box, frame, { place, sx }) {
  const { faint, line, ground } = palette();
  if (truth.drawing !== "phase") {
    const length = round(90 / sx);
    const x = frame.x + frame.width - 14 - length * sx;
    const y = frame.y + frame.height - 14;
    pen.lines([x, y - 4, x, y, x + length * sx, y, x + length * sx, y - 4], null, { colour: faint, width: 1.5 });
    pen.text(shortly(length), x + (length * sx) / 2, y - 6, { colour: faint, size: 12, align: "center", halo: ground });
    return;
  }
  for (const x of ticks(box.x0, box.x1)) {
    const [px] = place(x, 0);
    pen.lines([px, frame.y, px, frame.y + frame.height], null, { colour: line, width: 1 });
    pen.text(shortly(x), px, frame.y + frame.height - 4, { colour: faint, size: 11, align: "center" });
  }
  for (const y of ticks(box.y0, box.y1)) {
    const [, py] = place(0, y);
    pen.lines([frame.x, py, frame.x + frame.width, py], null, { colour: line, width: 1 });
    pen.text(shortly(y), frame.x + 4, py - 3, { colour: faint, size: 11 });
  }
  const [across, up] = truth.axes;
  pen.text(across, frame.x + frame.width - 8, frame.y + frame.height - 20, { colour: faint, size: 13, align: "right" });
  pen.text(up, frame.x + frame.width - 8, frame.y + 16, { colour: faint, size: 13, align: "right" });
}

/** @param {number} value @returns {number} the largest of 1, 2, 5, 10 ... that is not larger */
export function round(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return [5, 2].map((each) => each * decade).find((each) => each <= value) ?? decade;
}

/** @param {number} low @param {number} high @returns {number[]} round numbers between them */
function ticks(low, high) {
  const step = round((high - low) / 4);
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
}

/**
 * Who is who: a piece of line and a name for each, from the top.
 *
 * @param {Pen} pen @param {Frame} frame
 * @param {{name: string, colour: string, dash: number[], reference: boolean}[]} entries
 */
export function drawLegend(pen, frame, entries) {
  const { ink, ground } = palette();
  entries.forEach(({ name, colour, dash, reference }, i) => {
    const y = frame.y + 20 + 19 * i;
    const look = { colour, dash, width: reference ? 5 : 2.4, opacity: reference ? 0.55 : 1 };
    pen.lines([frame.x + 12, y - 4, frame.x + 46, y - 4], null, look);
    pen.text(name, frame.x + 54, y, { colour: ink, size: 13, halo: ground });
  });
}
