// What the plots say of answers. Run by tests/laboratory/test_page_modules.py.

import assert from "node:assert/strict";
import { test } from "node:test";

const PLOTS = "../../../ropeode/laboratory/page/plots";
const { errorChart } = await import(`${PLOTS}/error.js`);
const { energyChart } = await import(`${PLOTS}/energy.js`);
const { orderChart } = await import(`${PLOTS}/order.js`);
const { phaseChart } = await import(`${PLOTS}/phase.js`);
const { stabilityChart } = await import(`${PLOTS}/stability.js`);
const { path } = await import(`${PLOTS}/marks.js`);
const { sideBySide } = await import(`${PLOTS}/markers.js`);
const { linear } = await import(`${PLOTS}/scales.js`);
import { array, run, shown, view } from "./views.mjs";

const points = (chart) => chart.marks.filter((mark) => mark.kind === "point");

test("an error below the resolution is given as a bound, and none after the horizon", () => {
  const { at, table, y } = errorChart(view());
  assert.deepEqual(at(1), ["< 1.00 × 10⁻⁸"]);
  assert.deepEqual(at(2), ["0.00100"]);
  assert.deepEqual(at(3), ["plots.untrusted"]);
  assert.equal(table.rows.length, 3);
  assert.ok(y.low > 1e-10 && y.low <= 1e-9, "what cannot be believed takes little room");
  assert.ok(y.high >= 1e-3);
});

test("a run that diverged says so, and does not stretch the axis", () => {
  const arrays = { errors: array([0, 1e30]), differences: array([0, 0], [1, 1, 2]) };
  const gone = { ...run(1, { status: "diverged", diverged_at: 2, error_max: null }), arrays };
  const chart = errorChart(view({ shown: [shown({ run: gone })] }));
  assert.deepEqual(chart.legend[0].more, ["plots.diverged 2"]);
  assert.ok(chart.y.high < 1e4);
  assert.deepEqual(points(chart).map(({ shape }) => shape), ["up"]);
  assert.deepEqual(chart.at(2), ["plots.gone"]);
});

test("the chosen node has a line of its own, of its distance in the picture", () => {
  const lines = errorChart(view({ node: 0 })).marks.filter((mark) => mark.kind === "line");
  assert.equal(lines.length, 2);
  assert.equal(lines[1].y[1], 5);
});

test("an energy difference that cannot be told from zero is given as a bound", () => {
  const arrays = { ...shown().run.arrays, energy_differences: array([0, 1e-12, 2e-3]) };
  const { at } = energyChart(view({ shown: [shown({ run: { ...run(4), arrays } })] }));
  assert.deepEqual(at(1), ["± 1.00 × 10⁻⁹"]);
  assert.deepEqual(at(2), ["0.00200"]);
  const tiny = { ...shown().run.arrays, energy_differences: array([0, 1e-12, 0]) };
  const small = energyChart(view({ shown: [shown({ run: { ...run(4), arrays: tiny } })] }));
  assert.deepEqual(small.legend[0].more, ["plots.energy.largest < 1.00 × 10⁻⁹"]);
  const { energy: _, ...without } = view().truth.arrays;
  const none = view();
  none.truth.arrays = without;
  assert.deepEqual(energyChart(none), { why: "plots.energy.none" });
});

test("each run is drawn as what the order's fit made of it", () => {
  const order = {
    observed: 2, low: 1.9, high: 2.1, verdict: "converges", words: "converges: of order 2",
    used: [2, 4, 8], constant: 16e-3,
    left_out: [
      { steps_per_frame: 1, why: "unstable" },
      { steps_per_frame: 16, why: "round-off" },
      { steps_per_frame: 32, why: "below the reference's bound" },
      { steps_per_frame: 64, why: "pre-asymptotic" },
    ],
  };
  const ladder = [
    run(1, { status: "diverged", diverged_at: 1, error_max: null }),
    ...[2, 4, 8].map((steps) => run(steps, { error_max: 16e-3 / steps ** 2 })),
    run(16), run(32, { error_max: null }), run(64),
  ];
  const chart = orderChart(view({ shown: [shown({ order, ladder })] }));
  const shapes = points(chart).map(({ shape }) => shape);
  assert.deepEqual(shapes, ["up", "disc", "disc", "disc", "star", "down", "plus"]);
  assert.equal(points(chart)[0].y, chart.y.high);
  assert.equal(points(chart)[5].y, 1e-8, "an unresolved run is drawn at what can be resolved");
  const fit = chart.marks.find((mark) => mark.kind === "line");
  fit.x.forEach((dt, i) => assert.ok(Math.abs(fit.y[i] / (16e-3 * dt ** 2) - 1) < 1e-12));
  assert.deepEqual(chart.legend[0].more, ["plots.verdict.converges", { english: ": of order 2" }]);
  assert.match(points(chart)[4].words, /left_out plots.why.round-off/u);
});

test("a run that blew up does not stretch the order plot, though it is alone", () => {
  const { y, marks } = orderChart(view({ shown: [shown({ ladder: [run(1, { error_max: 1e147 })] })] }));
  assert.ok(y.low < 100 && y.high < 1e4, `${y.low} ${y.high}`);
  assert.deepEqual(marks.map(({ shape, y: at }) => [shape, at]), [["up", y.high]]);
});

test("a smooth line follows a circle between eight samples", () => {
  const box = { x: linear(-1, 1), y: linear(-1, 1), left: 0, top: 0, width: 200, height: 200 };
  const turn = Array.from({ length: 9 }, (_, i) => (i * Math.PI) / 4);
  const mark = { x: turn.map(Math.cos), y: turn.map(Math.sin), smooth: true };
  const [, ...curves] = path(mark, box).split("C").map((each) => each.match(/-?[\d.]+/g).map(Number));
  assert.equal(curves.length, 8);
  // Where a curve between two samples is in its middle, but for the first and the last.
  curves.slice(1, -1).forEach(([ax, ay, bx, by, x, y], i) => {
    const [x0, y0] = curves[i].slice(-2);
    const middle = [(x0 + 3 * ax + 3 * bx + x) / 8 - 100, (y0 + 3 * ay + 3 * by + y) / 8 - 100];
    assert.ok(Math.abs(Math.hypot(...middle) - 100) < 1, String(middle));
  });
});

test("a smooth line does not leave its places behind where they are unevenly apart", () => {
  const box = { x: linear(0, 100), y: linear(0, 100), left: 0, top: 0, width: 100, height: 100 };
  const mark = { x: [90, 10, 10, 10], y: [50, 50, 51, 52], smooth: true };
  const lowest = Math.min(...path(mark, box).match(/-?[\d.]+(?=,)/g).map(Number));
  assert.ok(lowest > 8, `${lowest}`);
});

test("points that would hide one another stand beside each other", () => {
  const places = [{ x: 12.4, y: 50 }, { x: 12.6, y: 50 }, { x: 90, y: 50 }];
  const [first, second, third] = sideBySide(places).map(({ x }) => x);
  assert.ok(second - first > 8);
  assert.equal(third, 90);
});

test("two runs have no line, and a reader is told what to press", () => {
  const chart = orderChart(view({ shown: [shown({ ladder: [run(1), run(2)] })] }));
  assert.ok(chart.marks.every((mark) => mark.kind !== "line"));
  assert.deepEqual(points(chart).map(({ shape }) => shape), ["ring", "ring"]);
  assert.deepEqual(chart.notes, ["plots.order.press"]);
});

test("work-precision: runs whose cost nobody can count are missing, and it says so", () => {
  const ladder = [run(1, { rhs_evaluations: null }), run(2), run(4)];
  const choices = { ...view().choices, axis: "evaluations" };
  const chart = orderChart(view({ choices, shown: [shown({ ladder })] }));
  assert.deepEqual(points(chart).map(({ x }) => x), [8, 16]);
  assert.ok(chart.notes.includes("plots.order.missing"));
});

test("theory draws its line over the whole axis of step sizes", () => {
  const theory = { order: 4, constant: 3, words: "" };
  const { marks, x, legend } = orderChart(view({ shown: [shown({ theory })] }));
  assert.deepEqual(legend[0].more, ["waiting", "; ", "plots.order.error 3 dt⁴"]);
  const none = { order: null, constant: null, words: "no error is predicted" };
  const { legend: [{ more }] } = orderChart(view({ shown: [shown({ theory: none })] }));
  assert.deepEqual(more, ["waiting", "; ", { english: "no error is predicted" }]);
  const line = marks.find((mark) => mark.kind === "line");
  assert.deepEqual(line.x, [x.low, x.high]);
  assert.deepEqual(line.y, [3 * x.low ** 4, 3 * x.high ** 4]);
});

test("runs that leave the phase plane do not stretch it", () => {
  const path = (data) => ({ every: 1, x_label: "x", v_label: "v", arrays: { x: array(data), v: array(data) } });
  const runs = [shown({ phase: path([0, 1e9, Infinity]) })];
  const chart = phaseChart(view({ truthPhase: path([0, 1, 2, 3]), shown: runs }));
  assert.ok(chart.x.high < 5);
  assert.deepEqual(chart.moving(2).map(({ x }) => x), [2, Infinity]);
});

test("what has no answer says why, and lets the reader choose another", () => {
  const choices = { ...view().choices, phase: "component 1" };
  const phase = phaseChart(view({ choices, absentPhase: "not in this file" }));
  assert.equal(phase.why, "not in this file");
  assert.ok(phase.choices[0].options.some(({ value }) => value === "component 0"));
  const refused = { ...shown().absent, stability: { english: "It has none." } };
  const region = stabilityChart(view({ shown: [shown({ absent: refused }), shown()] }));
  assert.deepEqual(region.why, { english: "It has none." });
  assert.equal(region.choices[0].options.length, 2);
});

test("the region is where the stability function is at most 1, and eigenvalues move with dt", () => {
  const many = 41;
  const ends = [-2, 2];
  const at = (i) => -2 + (4 * i) / (many - 1);
  // Of explicit Euler, moved to the middle: a disc of radius 1.
  const radius = Array.from({ length: many ** 2 }, (_, i) => Math.hypot(at(i % many), at(Math.floor(i / many))));
  const stability = {
    real: ends, imaginary: ends, why_none: null, largest_stable_dt: 0.2, words: "It grows.",
    arrays: {
      radius: array(radius, [many, many]),
      times: array([0, 1]),
      eigenvalues: array([-4, 0, -100, 0, -2, 1, -2, -1], [2, 2, 2]),
    },
  };
  const chart = stabilityChart(view({ shown: [shown({ stability })] }));
  const { polygons, edges } = chart.marks.find((mark) => mark.kind === "region");
  const area = polygons.reduce((sum, each) => sum + polygonArea(each), 0);
  assert.ok(Math.abs(area - Math.PI) < 0.01, `${area}`);
  const length = edges.reduce((sum, [[a, b], [c, d]]) => sum + Math.hypot(a - c, b - d), 0);
  assert.ok(Math.abs(length - 2 * Math.PI) < 0.02, `${length}`);
  const places = (time) => chart.moving(time).map(({ x, y, outside }) => [x, y, outside]);
  assert.deepEqual(places(0.9), [[-1, 0, false], [-2, 0, true]]);
  assert.deepEqual(places(1), [[-0.5, 0.25, false], [-0.5, -0.25, false]]);
  assert.equal(chart.moving(1), chart.moving(2), "nothing is placed again that has not moved");
  assert.ok(chart.notes.includes("plots.stability.above 0.250 frames 0.200 frames"));
});

function polygonArea(polygon) {
  return polygon.reduce((sum, [x, y], i) => {
    const [nextX, nextY] = polygon[(i + 1) % polygon.length];
    return sum + (x * nextY - nextX * y) / 2;
  }, 0);
}
