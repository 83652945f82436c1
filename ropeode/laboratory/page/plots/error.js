// Error against time, with what the reference can resolve.

import { written } from "../numbers.js";
import {
  BELIEVED,
  decadesAround,
  errorWords,
  frameSamples,
  goneWords,
  largestErrorWords,
  motionOf,
  sampleAt,
  timeAxis,
  timesOf,
} from "./samples.js";

/** @typedef {import("./chart.js").Mark} Mark */
/** @typedef {import("./view.js").Shown} Shown */
/** @typedef {import("./view.js").View} View */

// Times the motion; an error above it is that of a run that has blown up.
const HIGHEST = 10;
// How much is shown of what lies below the resolution.
const BELOW = 20;

/** @param {View} view @returns {import("./chart.js").Chart} */
export function errorChart(view) {
  const { say, truth, shown, node } = view;
  const resolution = truth.arrays.bound.data.map((each) => BELIEVED * each);
  const lowest = Math.min(...resolution.filter((each) => each > 0)) / BELOW;
  const errors = shown.flatMap(({ run }) => (run ? Array.from(run.arrays.errors.data) : []))
    .filter((each) => each > lowest);
  const y = decadesAround([...errors, ...resolution], HIGHEST * motionOf(truth));
  /** @type {Mark[]} */
  const marks = shown.flatMap((each) => linesOf(view, each, y.high));
  // Over the lines: they fade where they say nothing.
  marks.push({ kind: "band", x: truth.arrays.times.data.subarray(0, resolution.length), y: resolution });
  if (truth.horizon !== null) {
    marks.push({ kind: "rule", x: truth.horizon, label: say("plots.horizon") });
  }
  const horizon = truth.horizon === null ? [] : [say("plots.error.horizon", { time: written(truth.horizon) })];
  return {
    title: say("plots.error.title"),
    x: timeAxis(view),
    y: { label: say("plots.error.axis"), kind: "log", ...y },
    marks,
    legend: shown.map((each) => ({
      color: each.color, dash: each.dash, shape: null, text: each.name, more: [summary(view, each)],
    })),
    notes: [
      say("plots.error.norm", { norm: truth.norm }),
      ...(node === null ? [] : [say("plots.error.node", { node })]),
      say("plots.error.band"),
      ...horizon,
    ],
    table: {
      head: [timeAxis(view).label, say("plots.error.resolution"), ...shown.map(({ name }) => name)],
      rows: frameSamples(truth)
        .filter((sample) => sample < resolution.length)
        .map((sample) => [
          written(truth.arrays.times.data[sample]),
          written(resolution[sample]),
          ...shown.map((each) => errorAt(view, each, resolution, sample)),
        ]),
    },
    at: (time) => shown.map((each) => errorAt(view, each, resolution, sampleAt(truth, time))),
  };
}

/** @param {View} view @param {Shown} each @param {number} high @returns {Mark[]} */
function linesOf({ truth, node }, { run, color, dash }, high) {
  if (!run) return [];
  const errors = run.arrays.errors.data;
  /** @type {Mark[]} */
  const marks = [line(truth, run.every, errors, { color, dash, width: 2 })];
  if (node !== null) {
    const own = drawnDistances(run, truth.nodes.indexOf(node));
    marks.push(line(truth, run.every, own, { color, dash: "1 4", width: 1.5 }));
  }
  if (run.status !== "ok") {
    let last = errors.length - 1;
    while (last > 0 && !(errors[last] < high)) last -= 1;
    const x = truth.arrays.times.data[last * run.every];
    marks.push({ kind: "point", x, y: high, shape: "up", color, words: null });
  }
  return marks;
}

/**
 * @param {View["truth"]} truth @param {number} every @param {Float32Array} errors
 * @param {{color: string, dash: string, width: number}} look
 * @returns {Mark}
 */
function line(truth, every, errors, look) {
  // A logarithm has no place for zero.
  const y = errors.map((each) => (each > 0 ? each : NaN));
  return { kind: "line", x: timesOf(truth, every, y.length), y, ...look };
}

/** How far a point is from its true place, in the picture. @param {NonNullable<Shown["run"]>} run @param {number} index */
function drawnDistances({ arrays: { differences } }, index) {
  const { data, shape } = differences;
  const [samples, points] = shape;
  return Float32Array.from({ length: samples }, (_, sample) => {
    const at = 2 * (sample * points + index);
    return Math.hypot(data[at], data[at + 1]);
  });
}

/** @param {View} view @param {Shown} each */
function summary(view, { run, absent }) {
  if (!run) return absent.run;
  const value = largestErrorWords(view, run);
  return run.status !== "ok" ? value : view.say("plots.error.max", { value });
}

/** @param {View} view @param {Shown} each @param {ArrayLike<number>} resolution @param {number} sample */
function errorAt({ say }, { run }, resolution, sample) {
  if (!run) return "";
  const own = Math.round(sample / run.every);
  if (own * run.every >= resolution.length) return say("plots.untrusted");
  const error = run.arrays.errors.data[own];
  if (!Number.isFinite(error)) return goneWords(say, run);
  return errorWords(error, resolution[own * run.every]);
}
