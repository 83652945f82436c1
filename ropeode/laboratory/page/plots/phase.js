// The phase plane of one component of a node, or of a mode.

import { written } from "../numbers.js";
import { frameSamples, isFile, sampleAt, timeAxis } from "./samples.js";

/** @typedef {import("./chart.js").Mark} Mark */
/** @typedef {import("./view.js").View} View */
/** @typedef {NonNullable<View["truthPhase"]>} Phase */

// Times the range of the reference: a run that leaves it has blown up.
const HIGHEST = 1.5;
const ROOM = 1.08;
const MODES = 6;
const TRUTH = "var(--plot-truth)";

/** @param {View} view @returns {import("./chart.js").Chart | import("./chart.js").Missing} */
export function phaseChart(view) {
  const { say, truth, truthPhase, shown } = view;
  if (!truthPhase) return { why: view.absentPhase, choices: [phaseChoice(view)] };
  const { x: positions, v: velocities } = truthPhase.arrays;
  const paths = shown.map(({ phase }) => phase);
  const known = paths.filter((each) => each !== null);
  const x = range(positions.data, known.map((each) => each.arrays.x.data));
  const v = range(velocities.data, known.map((each) => each.arrays.v.data));
  /** @type {Mark[]} */
  const marks = [
    line(truthPhase, TRUTH, "", 3, Infinity),
    ...shown.flatMap(({ phase, color, dash }) =>
      phase ? [line(phase, color, dash, 1.6, leavesAt(phase, x, v))] : []),
  ];
  const leaves = known.some((each) => leavesAt(each, x, v) < each.arrays.x.data.length);
  /** @param {Phase | null} path @param {number} time */
  const placeAt = (path, time) => {
    const i = Math.round(sampleAt(truth, time) / (path?.every ?? 1));
    return { x: path?.arrays.x.data[i] ?? NaN, y: path?.arrays.v.data[i] ?? NaN };
  };
  /** @param {Phase | null} path @param {number} sample */
  const words = (path, sample) => {
    const { x, y } = placeAt(path, truth.arrays.times.data[sample]);
    return Number.isFinite(x) ? `${written(x)}; ${written(y)}` : "–";
  };
  return {
    title: say("plots.phase.title"),
    x: { label: { english: truthPhase.x_label }, kind: "linear", ...x },
    y: { label: { english: truthPhase.v_label }, kind: "linear", ...v },
    choices: [phaseChoice(view)],
    marks,
    legend: [
      { color: TRUTH, dash: "", shape: null, text: say("plots.truth") },
      ...shown.map(({ name, color, dash, phase, run, absent }) => ({
        color, dash, shape: null, text: name,
        more: phase || isFile(run) ? undefined : [absent.phase],
      })),
    ],
    notes: leaves ? [say("plots.phase.leaves")] : [],
    table: {
      head: [timeAxis(view).label, say("plots.truth"), ...shown.map(({ name }) => name)],
      rows: frameSamples(truth).map((sample) => [
        written(truth.arrays.times.data[sample]),
        ...[truthPhase, ...paths].map((path) => words(path, sample)),
      ]),
    },
    moving: (time) => [
      { ...placeAt(truthPhase, time), color: TRUTH },
      ...shown.map(({ phase, color }) => ({ ...placeAt(phase, time), color })),
    ],
  };
}

/** Components of the chosen node, and the slowest modes of a rope. @param {View} view */
function phaseChoice({ say, truth, choices }) {
  const flat = truth.drawing === "rope" || truth.drawing === "orbit";
  const modes = truth.drawing === "rope" ? MODES : 0;
  return {
    name: "phase",
    label: say("plots.phase.choice"),
    value: choices.phase,
    options: [
      ...Array.from({ length: flat ? 2 : 1 }, (_, i) => ({
        value: `component ${i}`,
        label: flat ? say("plots.phase.component", { component: "xy"[i] }) : say("plots.phase.only"),
      })),
      ...Array.from({ length: modes }, (_, i) => ({
        value: `mode ${i}`, label: say("plots.phase.mode", { mode: i + 1 }),
      })),
    ],
  };
}

/** @param {Phase} path @param {string} color @param {string} dash @param {number} width @param {number} end @returns {Mark} */
function line({ arrays: { x, v } }, color, dash, width, end) {
  return { kind: "line", x: x.data.subarray(0, end + 1), y: v.data.subarray(0, end + 1), color, dash, width, smooth: true };
}

/** @typedef {{low: number, high: number}} Range */

/** The first sample outside of the plot. @param {Phase} path @param {Range} x @param {Range} v */
function leavesAt({ arrays }, x, v) {
  /** @type {(value: number, range: Range) => boolean} */
  const inside = (value, { low, high }) => value >= low && value <= high;
  const found = arrays.x.data.findIndex((each, i) => !inside(each, x) || !inside(arrays.v.data[i], v));
  return found < 0 ? arrays.x.data.length : found;
}

/** The range of the reference, and of runs that stay near it. @param {Float32Array} truth @param {Float32Array[]} runs */
function range(truth, runs) {
  let [low, high] = [Math.min(...truth), Math.max(...truth)];
  const middle = (low + high) / 2;
  const most = (HIGHEST * (high - low)) / 2 || 1;
  for (const value of runs.flatMap((run) => Array.from(run))) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, Math.max(value, middle - most));
    high = Math.max(high, Math.min(value, middle + most));
  }
  const more = ((ROOM - 1) * (high - low)) / 2 || 1;
  return { low: low - more, high: high + more };
}
