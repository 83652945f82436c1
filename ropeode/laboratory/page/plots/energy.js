// The energy of each run minus that of the reference, against time.

import { shortly, written } from "../numbers.js";
import { errorWords, frameSamples, goneWords, quantity, sampleAt, timeAxis, timesOf, withUnit } from "./samples.js";

/** @typedef {import("./chart.js").Mark} Mark */
/** @typedef {import("./view.js").Shown} Shown */
/** @typedef {import("./view.js").View} View */

// Of the runs that do not gain or lose more than this times the size of the true energy, the one
// with the largest difference fills the plot.
const TAME = 0.1;
const ROOM = 1.08;
// Decades between the largest difference and the part of a signed axis that is linear.
const SHOWN_DECADES = 6;

/** @param {View} view @returns {import("./chart.js").Chart | import("./chart.js").Missing} some problems have none */
export function energyChart(view) {
  const { say, truth, shown } = view;
  const energy = truth.arrays.energy?.data;
  if (!energy) return { why: say("plots.energy.none") };
  const largest = shown.map(({ run }) => largestOf(run?.arrays.energy_differences?.data));
  const most = rangeOf(largest, TAME * sizeOf(energy));
  const kind = view.choices.energy;
  const high = ROOM * most;
  const threshold = Math.min(most / 10, Math.max(most / 10 ** SHOWN_DECADES, smallest(largest) / 10));
  const bound = truth.arrays.energy_bound.data;
  const worst = Math.max(...bound);
  /** @type {Mark} */
  const band = {
    kind: "band", x: truth.arrays.times.data.subarray(0, bound.length),
    y: bound, low: bound.map((each) => -each),
  };
  return {
    title: say("plots.energy.title"),
    x: timeAxis(view),
    y: { label: withUnit(say("plots.energy.axis"), truth.energy_unit), kind, low: -high, high, threshold },
    choices: [
      {
        name: "energy", label: say("plots.scale"), value: kind,
        options: ["linear", "signed"].map((value) => ({ value, label: say(`plots.scale.${value}`) })),
      },
    ],
    marks: [{ kind: "rule", y: 0, label: "" }, ...shown.flatMap((each) => lineOf(view, each)), band],
    legend: shown.map((each, i) => ({
      color: each.color, dash: each.dash, shape: null, text: each.name,
      more: [each.run ? say("plots.energy.largest", { value: errorWords(largest[i], worst) }) : each.absent.run],
    })),
    notes: [
      say("plots.energy.true", {
        first: quantity(energy[0], truth.energy_unit),
        last: quantity(energy[energy.length - 1], truth.energy_unit),
      }),
      say("plots.energy.band"),
      ...(largest.some((each) => each > most) ? [say("plots.energy.outside", { value: shortly(high, 2) })] : []),
    ],
    table: {
      head: [timeAxis(view).label, ...shown.map(({ name }) => name)],
      rows: frameSamples(truth).filter((sample) => sample < energy.length).map((sample) => [
        written(truth.arrays.times.data[sample]),
        ...shown.map((each) => valueAt(view, each, sample)),
      ]),
    },
    at: (time) => shown.map((each) => valueAt(view, each, sampleAt(truth, time))),
  };
}

/** @param {View} view @param {Shown} each @returns {Mark[]} */
function lineOf({ truth }, { run, color, dash }) {
  const y = run?.arrays.energy_differences?.data;
  if (!run || !y) return [];
  return [{ kind: "line", x: timesOf(truth, run.every, y.length), y, color, dash, width: 2 }];
}

/** @param {View} view @param {Shown} each @param {number} sample */
function valueAt({ say, truth }, { run }, sample) {
  const values = run?.arrays.energy_differences?.data;
  if (!run || !values) return "";
  const own = Math.round(sample / run.every);
  if (own * run.every >= truth.arrays.energy_bound.data.length) return say("plots.untrusted");
  const [value, bound] = [values[own], truth.arrays.energy_bound.data[own * run.every]];
  if (!Number.isFinite(value)) return goneWords(say, run);
  return Math.abs(value) <= bound ? `± ${written(bound)}` : written(value);
}

/** @param {Float32Array | undefined} values */
function largestOf(values) {
  let most = 0;
  for (const value of values ?? []) if (Number.isFinite(value)) most = Math.max(most, Math.abs(value));
  return most;
}

/** Runs that blow up do not stretch the axis. @param {number[]} largest @param {number} tame */
function rangeOf(largest, tame) {
  const shown = largest.filter((each) => each > 0 && each <= tame);
  return shown.length ? Math.max(...shown) : Math.min(tame, Math.max(...largest) || tame);
}

/** @param {number[]} values */
function smallest(values) {
  return Math.min(...values.filter((each) => each > 0));
}

/** How much of the energy moves, or what there is of it. @param {Float32Array} energy */
function sizeOf(energy) {
  const [low, high] = [Math.min(...energy), Math.max(...energy)];
  return Math.max(high - low, Math.abs(high), Math.abs(low)) || 1;
}
