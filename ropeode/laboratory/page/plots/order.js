// Error against step size: every run so far, the fitted order, and what theory predicts.

import { raised, shortly, written } from "../numbers.js";
import { BELIEVED, decadesAround, isFile, largestErrorWords, motionOf, quantity, withUnit } from "./samples.js";

/** @typedef {import("./chart.js").Mark} Mark */
/** @typedef {import("./chart.js").Shape} Shape */
/** @typedef {import("../messages.js").Run} Run */
/** @typedef {import("./view.js").Shown} Shown */
/** @typedef {import("./view.js").View} View */

/** Why the fit leaves a point out, in Python's words, and how it is drawn. @type {Record<string, Shape>} */
const SHAPES = {
  unstable: "cross",
  "below the reference's bound": "down",
  "round-off": "star",
  "pre-asymptotic": "plus",
};
const ROOM = 1.6;
const LEAST_SPAN = 12;
const GREY = "var(--plot-text)";

/** @param {View} view @returns {import("./chart.js").Chart | import("./chart.js").Missing} */
export function orderChart(view) {
  const { say, truth } = view;
  if (!view.shown.length) return { why: say("plots.none") };
  const shown = view.shown.map(withFile);
  const places = shown.flatMap(({ ladder }) => ladder.map((run) => place(view, run)));
  const y = limits({ ...view, shown });
  const points = shown.flatMap((each) => pointsOf(view, each, y));
  const shapes = [...new Set(points.map(({ shape }) => shape))];
  const x = spread(places.filter((each) => each > 0));
  const missing = places.some((each) => !(each > 0));
  const longest = Math.max(0, ...shown.map(({ ladder }) => ladder.length));
  return {
    title: say("plots.order.title"),
    x: { label: axisLabel(view), kind: "log", ...x },
    y: { label: say("plots.order.axis"), kind: "log", ...y },
    choices: [
      {
        name: "axis", label: say("plots.order.choice"), value: view.choices.axis,
        options: ["dt", "evaluations", "seconds"].map((value) => ({
          value, label: say(`plots.order.choice.${value}`),
        })),
      },
    ],
    marks: [
      ...shown.flatMap((each) => predictionOf(view, each, x)),
      ...shown.flatMap((each) => fitOf(view, each)),
      ...points,
    ],
    legend: shown.map((each) => ({
      color: each.color, dash: each.dash, shape: null, text: each.name,
      more: isFile(each.run) ? undefined : orderWords(view, each),
    })),
    meanings: [
      ...shapes.map((shape) => ({
        color: GREY, dash: null, shape, text: say(`plots.order.shape.${shape}`),
      })),
      ...(shown.some((each) => predictionOf(view, each, x).length)
        ? [{ color: GREY, dash: "7 4", shape: null, text: say("plots.order.predicted") }]
        : []),
    ],
    notes: [
      ...(longest < 3 ? [say("plots.order.press")] : []),
      ...(missing ? [say("plots.order.missing")] : []),
    ],
    table: {
      head: ["stepper", "steps", "dt", "error", "evaluations", "seconds", "use"].map((each) =>
        each === "dt" ? withUnit("dt", truth.time_unit) : say(`plots.order.head.${each}`),
      ),
      rows: shown.flatMap((each) => each.ladder.map((run) => row(view, each, run))),
    },
  };
}

/** A file is one point. @param {Shown} each @returns {Shown} */
function withFile(each) {
  return each.run && isFile(each.run) ? { ...each, ladder: [each.run] } : each;
}

/** @param {View} view @param {Shown} each @returns {import("./chart.js").Words[]} */
function orderWords({ say }, { order, theory, absent }) {
  /** Python's words begin with the verdict. @type {import("./chart.js").Words[]} */
  const found = order
    ? [say(`plots.verdict.${order.verdict}`), { english: order.words.slice(order.verdict.length) }]
    : [absent.order];
  if (!theory) return found;
  const { order: power, constant } = theory;
  if (power === null || constant === null) return [...found, "; ", { english: theory.words }];
  const error = `${shortly(constant, 4)} dt${power === 1 ? "" : raised(power)}`;
  return [...found, "; ", say("plots.order.error", { error })];
}

/** @param {View} view */
function axisLabel({ say, choices: { axis }, truth }) {
  const words = say(`plots.order.${axis}`);
  return axis === "dt" ? withUnit(words, truth.time_unit) : words;
}

/** Where a run lies along the axis; NaN where that is not known. @param {View} view @param {Run} run */
function place({ choices: { axis } }, run) {
  if (axis === "dt") return run.dt;
  return (axis === "seconds" ? run.seconds : run.rhs_evaluations) ?? NaN;
}

/** @param {number[]} values */
function spread(values) {
  if (!values.length) return { low: 0.01, high: 1 };
  const [low, high] = [Math.min(...values) / ROOM, Math.max(...values) * ROOM];
  const more = Math.sqrt(Math.max(1, LEAST_SPAN / (high / low)));
  return { low: low / more, high: high * more };
}

/** Why the fit leaves a run out; null if it does not, undefined if that is not known yet. @param {Shown} each @param {Run} run */
function reason({ order }, run) {
  if (!order || run.steps_per_frame === null) return undefined;
  if (order.used.includes(run.steps_per_frame)) return null;
  return order.left_out.find((left) => left.steps_per_frame === run.steps_per_frame)?.why;
}

/** A run that blew up does not stretch the axis. @param {View} view */
function limits({ truth, shown }) {
  const runs = shown.flatMap(({ ladder }) => ladder);
  const unresolved = runs.filter(isUnresolved);
  const errors = runs.map((run) => run.error_max ?? NaN);
  const { low, high } = decadesAround(
    [...errors, ...unresolved.map((run) => run.resolution)],
    BELIEVED * motionOf(truth),
  );
  // A mark hangs from the bound, and none should stand on the axis.
  return { low: low / (unresolved.length ? 10 : 2), high };
}

/** @param {View} view @param {Shown} each @param {{low: number, high: number}} y @returns {import("./chart.js").PointMark[]} */
function pointsOf(view, each, y) {
  return each.ladder.flatMap((run) => {
    const x = place(view, run);
    if (!(x > 0)) return [];
    const why = reason(each, run);
    /** @type {import("./chart.js").PointMark} */
    const point = {
      kind: "point", x, y: run.error_max ?? NaN, color: each.color,
      shape: isFile(run) ? "diamond" : why === null ? "disc" : (SHAPES[why ?? ""] ?? "ring"),
      words: pointWords(view, each, run),
    };
    if (isUnresolved(run)) return [{ ...point, y: run.resolution, shape: "down" }];
    return [point.y <= y.high ? point : { ...point, y: y.high, shape: "up" }];
  });
}

/** @param {Run} run */
function isUnresolved({ status, error_max: error, resolution }) {
  return status === "ok" && (error ?? 0) < resolution;
}

/** @param {View} view @param {Shown} each @param {Run} run */
function pointWords(view, each, run) {
  const { say, truth } = view;
  const values = {
    stepper: each.name,
    dt: quantity(run.dt, truth.time_unit),
    error: largestErrorWords(view, run),
    use: useWords(view, each, run),
  };
  const { steps_per_frame: steps } = run;
  return steps === null ? say("plots.order.point_of_file", values) : say("plots.order.point", { ...values, steps });
}

/** @param {View} view @param {Shown} each @param {Run} run */
function useWords({ say }, each, run) {
  const why = reason(each, run);
  if (isFile(run)) return say("plots.order.file");
  if (why === undefined) return say("plots.order.unknown");
  if (why === null) return say("plots.order.used");
  return say("plots.order.left_out", { why: say(`plots.why.${why}`) });
}

/** @param {View} view @param {Shown} each @param {Run} run */
function row(view, each, run) {
  const { rhs_evaluations: evaluations } = run;
  return [
    each.name,
    String(run.steps_per_frame ?? "–"),
    written(run.dt),
    largestErrorWords(view, run),
    evaluations === null ? "–" : String(evaluations),
    run.seconds === null ? "–" : written(run.seconds),
    useWords(view, each, run),
  ];
}

/** The fitted line, and its slope. @param {View} view @param {Shown} each @returns {Mark[]} */
function fitOf(view, each) {
  const { observed, constant } = each.order ?? { observed: null, constant: null };
  // Measured times scatter, and no law joins them.
  if (observed === null || constant === null || view.choices.axis === "seconds") return [];
  const used = each.ladder.filter((run) => reason(each, run) === null && place(view, run) > 0);
  used.sort((a, b) => a.dt - b.dt);
  if (!used.length) return [];
  const x = used.map((run) => place(view, run));
  const y = used.map((run) => constant * run.dt ** observed);
  /** @type {Mark} */
  const line = { kind: "line", x, y, color: each.color, dash: each.dash, width: 1.5 };
  if (view.choices.axis !== "dt") return [line];
  const middle = Math.sqrt(used[0].dt * used[used.length - 1].dt);
  const text = observed.toFixed(2).replace("-", "−");
  return [line, { kind: "text", x: middle, y: constant * middle ** observed, text }];
}

/** @param {View} view @param {Shown} each @param {{low: number, high: number}} x @returns {Mark[]} */
function predictionOf({ choices: { axis } }, { theory, color }, x) {
  const { order, constant } = theory ?? { order: null, constant: null };
  if (axis !== "dt" || order === null || constant === null) return [];
  const ends = [x.low, x.high];
  return [
    { kind: "line", x: ends, y: ends.map((dt) => constant * dt ** order), color, dash: "7 4", width: 1 },
  ];
}
