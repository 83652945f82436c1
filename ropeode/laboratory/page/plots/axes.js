// Axes with ticks and labels, and the box that they leave for the marks.

import { across, upright } from "./marks.js";
import { linear, logarithmic, signedLogarithmic } from "./scales.js";
import { svg, textOf } from "./svg.js";

/** @typedef {import("./chart.js").Axis} Axis */
/** @typedef {import("./chart.js").Chart} Chart */
/** @typedef {import("./marks.js").Box} Box */

const LETTER = 7;
const LINE = 14;
// To the right of the box.
const MARGIN = 14;
const [TICK_WIDTH, TICK_HEIGHT] = [68, 38];
const FEWEST = 3;

/** @param {Axis} axis */
function scaleOf(axis) {
  if (axis.kind === "log") return logarithmic(axis.low, axis.high);
  if (axis.kind === "signed") return signedLogarithmic(axis.low, axis.high, axis.threshold ?? 1);
  return linear(axis.low, axis.high);
}

/**
 * The box of a chart in a picture of so many pixels.
 * @param {Chart} chart @param {number} width @param {number} height
 * @returns {Box}
 */
export function boxFor(chart, width, height) {
  const y = scaleOf(chart.y);
  const top = LINE + 10;
  const inner = Math.max(20, height - top - 2 * LINE - 14);
  const longest = Math.max(0, ...y.ticks(inner / TICK_HEIGHT).map(({ label }) => label.length));
  const left = Math.min(width / 3, LETTER * longest + 12);
  const box = { x: scaleOf(chart.x), y, left, top, width: width - left - MARGIN, height: inner };
  return chart.equal ? withEqualScales(chart, box) : box;
}

/** So that circles are circles. @param {Chart} chart @param {Box} box @returns {Box} */
function withEqualScales({ x, y }, box) {
  const unit = Math.max((x.high - x.low) / box.width, (y.high - y.low) / box.height);
  return { ...box, width: (x.high - x.low) / unit, height: (y.high - y.low) / unit };
}

/**
 * @param {Chart} chart @param {Box} box
 * @returns {Element}
 */
export function axes(chart, box) {
  const [right, bottom] = [box.left + box.width, box.top + box.height];
  const all = svg("g", { class: "plot-axes", "aria-hidden": "true" });
  for (const { value, label } of box.x.ticks(Math.max(FEWEST, box.width / TICK_WIDTH))) {
    const x = across(box, value);
    // The last one keeps inside of the picture.
    const middle = Math.min(x, right + MARGIN - (LETTER * label.length) / 2);
    all.append(
      svg("line", { x1: x, x2: x, y1: box.top, y2: bottom, class: "plot-grid" }),
      svg("text", { x: middle, y: bottom + LINE + 2, "text-anchor": "middle" }, label),
    );
  }
  for (const { value, label } of box.y.ticks(box.height / TICK_HEIGHT)) {
    const y = upright(box, value);
    all.append(
      svg("line", { x1: box.left, x2: right, y1: y, y2: y, class: "plot-grid" }),
      svg("text", { x: box.left - 6, y: y + 4, "text-anchor": "end" }, label),
    );
  }
  all.append(
    svg("path", { d: `M${box.left},${box.top}V${bottom}H${right}`, class: "plot-frame" }),
    // The upright axis is named above it: nobody need turn the head.
    named(chart.y.label, { x: 2, y: LINE - 1 }),
    named(chart.x.label, { x: right, y: bottom + 2 * LINE + 6, "text-anchor": "end" }),
  );
  return all;
}

/** @param {import("./chart.js").Words} label @param {Record<string, string | number>} place */
function named(label, place) {
  const lang = typeof label === "string" ? null : "en";
  return svg("text", { ...place, lang, class: "plot-label" }, textOf(label));
}
