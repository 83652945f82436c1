// The stability region of a stepper, and the eigenvalues of the problem times the step size.

import { regionBelow } from "./contour.js";
import { written } from "../numbers.js";
import { quantity, timeAxis } from "./samples.js";

/** @typedef {import("./chart.js").Mark} Mark */
/** @typedef {import("./view.js").View} View */
/** @typedef {NonNullable<import("./view.js").Shown["stability"]>} Stability */
/** @typedef {{real: [number, number], imaginary: [number, number]}} Edges */

// A stepper that keeps an oscillation's size is stable, whatever the last digit of float32 says.
const STABLE = 1 + 1e-6;
const INK = "var(--plot-text)";

/** The region depends on the answer alone, and the eigenvalues move. @type {WeakMap<Stability, ReturnType<typeof regionOf>>} */
const regions = new WeakMap();

/** @param {View} view @returns {import("./chart.js").Chart | import("./chart.js").Missing} */
export function stabilityChart(view) {
  const { say, dt, truth } = view;
  const each = view.shown[Number(view.choices.region)] ?? view.shown[0];
  if (!each) return { why: say("plots.none") };
  const choices = [
    {
      name: "region", label: say("plots.stability.choice"), value: String(view.shown.indexOf(each)),
      options: view.shown.map(({ name }, i) => ({ value: String(i), label: name })),
    },
  ];
  const { stability } = each;
  if (!stability) return { why: each.absent.stability, choices };
  const { real, imaginary, largest_stable_dt: largest } = stability;
  const box = real && imaginary ? { real, imaginary } : around(stability, dt);
  const moving = movingEigenvalues(stability, dt, box);
  const known = regions.get(stability) ?? regionOf(stability);
  regions.set(stability, known);
  /** @type {Mark[]} */
  const marks = [
    ...(known ? [{ kind: /** @type {const} */ ("region"), ...known, color: each.color }] : []),
    { kind: "rule", x: 0, label: "" },
    { kind: "rule", y: 0, label: "" },
  ];
  const numbers = {
    dt: quantity(dt, truth.time_unit),
    largest: quantity(largest ?? NaN, truth.time_unit),
  };
  return {
    title: say("plots.stability.title", { stepper: each.name }),
    x: { label: say("plots.stability.real"), kind: "linear", low: box.real[0], high: box.real[1] },
    y: {
      label: say("plots.stability.imaginary"), kind: "linear",
      low: box.imaginary[0], high: box.imaginary[1],
    },
    equal: true,
    choices,
    marks,
    legend: known
      ? [{ color: each.color, dash: "", shape: null, text: say("plots.stability.region") }]
      : [],
    meanings: [
      { color: INK, dash: null, shape: "disc", text: say("plots.stability.eigenvalues", numbers) },
      { color: INK, dash: null, shape: "ring", text: say("plots.stability.outside") },
    ],
    notes: [
      { english: stability.words },
      ...(stability.why_none && stability.why_none !== stability.words ? [{ english: stability.why_none }] : []),
      ...(largest === null
        ? []
        : [say(dt > largest ? "plots.stability.above" : "plots.stability.below", numbers)]),
    ],
    table: {
      head: [
        timeAxis(view).label,
        say("plots.stability.lowest"), say("plots.stability.highest"), say("plots.stability.fastest"),
      ],
      rows: Array.from(stability.arrays.times.data, (time, i) => {
        const values = eigenvaluesAt(stability, i).map(([re, im]) => [re * dt, im * dt]);
        const real_parts = values.map(([re]) => re);
        return [time, Math.min(...real_parts), Math.max(...real_parts), Math.max(...values.map(([, im]) => im))]
          .map((each) => written(each));
      }),
    },
    moving,
  };
}

/** The eigenvalues at one of the times at which they are known. @param {Stability} stability @param {number} i */
function eigenvaluesAt({ arrays: { eigenvalues } }, i) {
  const { data, shape } = eigenvalues;
  const first = 2 * shape[1] * i;
  return Array.from({ length: shape[1] }, (_, k) => [data[first + 2 * k], data[first + 2 * k + 1]]);
}

/** @param {Stability} stability @param {number} dt @param {Edges} box */
function movingEigenvalues(stability, dt, box) {
  const times = stability.arrays.times.data;
  let last = -1;
  /** @type {import("./chart.js").Moving[]} */
  let points = [];
  return (/** @type {number} */ time) => {
    let i = times.findIndex((each) => each > time);
    i = i < 0 ? times.length - 1 : Math.max(0, i - 1);
    if (i !== last) {
      points = eigenvaluesAt(stability, i).map((value) => inBox(value, dt, box));
      last = i;
    }
    return points;
  };
}

/** @param {Stability} stability @param {number} dt @returns {Edges} */
function around({ arrays: { eigenvalues } }, dt) {
  let farthest = 1e-9;
  for (const part of eigenvalues.data) farthest = Math.max(farthest, 1.1 * dt * Math.abs(part));
  return { real: [-farthest, farthest], imaginary: [-farthest, farthest] };
}

/** An eigenvalue times the step size; at the edge of the box if it lies outside. @param {number[]} value @param {number} dt @param {Edges} box */
function inBox([re, im], dt, { real, imaginary }) {
  const [x, y] = [re * dt, im * dt];
  const clamped = {
    x: Math.min(real[1], Math.max(real[0], x)),
    y: Math.min(imaginary[1], Math.max(imaginary[0], y)),
  };
  return { ...clamped, color: INK, outside: clamped.x !== x || clamped.y !== y };
}

/** @param {Stability} stability */
function regionOf({ real, imaginary, arrays: { radius } }) {
  if (!real || !imaginary || !radius) return null;
  const [rows, columns] = radius.shape;
  const { polygons, edges } = regionBelow(radius.data, rows, columns, STABLE);
  /** @param {[number, number]} place @returns {[number, number]} */
  const at = ([column, row]) => [
    real[0] + (column / (columns - 1)) * (real[1] - real[0]),
    imaginary[0] + (row / (rows - 1)) * (imaginary[1] - imaginary[0]),
  ];
  return {
    polygons: polygons.map((each) => each.map(at)),
    edges: edges.map(([from, to]) => /** @type {[[number, number], [number, number]]} */ ([at(from), at(to)])),
  };
}
