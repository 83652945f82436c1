// What several plots know of samples, times and errors.

import { written } from "../numbers.js";

/** @typedef {import("./view.js").View} View */
/** @typedef {View["truth"]} Truth */

// An error is believed where it is so many times the reference's bound.
export const BELIEVED = 10;

/** The label of the time axis. @param {View} view */
export function timeLabel({ say, truth }) {
  return withUnit(say("plots.time"), truth.time_unit);
}

/** @param {string} words @param {string} unit */
export function withUnit(words, unit) {
  return unit ? `${words} [${unit}]` : words;
}

/** A number with its unit. @param {number} value @param {string} unit */
export function quantity(value, unit) {
  return unit ? `${written(value)} ${unit}` : written(value);
}

/** The axis of time, over all of the motion. @param {View} view */
export function timeAxis(view) {
  const times = view.truth.arrays.times.data;
  const [low, high] = [times[0], times[times.length - 1]];
  return { label: timeLabel(view), kind: /** @type {const} */ ("linear"), low, high };
}

/** The times of every so many-th sample. @param {Truth} truth @param {number} every @param {number} count */
export function timesOf(truth, every, count) {
  const times = truth.arrays.times.data;
  const known = Math.min(count, Math.ceil(times.length / every));
  return Float32Array.from({ length: known }, (_, i) => times[i * every]);
}

/** The number of the sample nearest to a time. @param {Truth} truth @param {number} time */
export function sampleAt(truth, time) {
  const times = truth.arrays.times.data;
  const last = times.length - 1;
  const part = (time - times[0]) / (times[last] - times[0]);
  return Math.max(0, Math.min(last, Math.round(part * last)));
}

/** Numbers of the samples at frames. @param {Truth} truth */
export function frameSamples(truth) {
  return Array.from({ length: truth.frames + 1 }, (_, i) => i * truth.samples_per_frame);
}

/** Whether a run was read from a file. @param {import("../messages.js").Run | null} run */
export function isFile(run) {
  return run !== null && run.steps_per_frame === null;
}

/** How far any point gets from its start: the size of the motion. @param {Truth} truth */
export function motionOf({ arrays: { points } }) {
  const { data, shape } = points;
  const each = shape[1] * shape[2];
  let farthest = 0;
  for (let i = each; i < data.length; i += 2) {
    const start = i % each;
    farthest = Math.max(farthest, Math.hypot(data[i] - data[start], data[i + 1] - data[start + 1]));
  }
  return farthest || 1;
}

/** An error as a reader may believe it. @param {number} error @param {number} resolution */
export function errorWords(error, resolution) {
  return error < resolution ? `< ${written(resolution)}` : written(error);
}

/** Why there is no number: the run has ended, or float32 does not hold it. @param {View["say"]} say @param {import("../messages.js").Run} run */
export function goneWords(say, { status }) {
  if (status === "unsolved") return say("plots.unsolved");
  return status === "diverged" ? say("plots.gone") : "> 3 × 10³⁸";
}

/** The largest error of a run: null, for one that stayed finite, is below what can be resolved. @param {View} view @param {import("../messages.js").Run} run */
export function largestErrorWords({ say }, run) {
  const frame = run.diverged_at ?? "–";
  if (run.status === "diverged") return say("plots.diverged", { frame });
  if (run.status === "unsolved") return say("plots.unsolved.at", { frame });
  return errorWords(run.error_max ?? 0, run.resolution);
}

/** Whole powers of ten around some values. @param {Iterable<number>} values @param {number} highest */
export function decadesAround(values, highest = Infinity) {
  let [low, high] = [Infinity, 0];
  for (const value of values) {
    if (!(value > 0) || !Number.isFinite(value)) continue;
    low = Math.min(low, value, highest);
    high = Math.max(high, Math.min(value, highest));
  }
  if (!high) return { low: 1e-3, high: 1 };
  const power = Math.floor(Math.log10(low) + 1e-9);
  const above = 10 ** Math.max(power + 1, Math.ceil(Math.log10(high) - 1e-9));
  return { low: 10 ** power, high: Math.max(10 ** (power + 1), Math.min(above, highest)) };
}
