// Motion, extent, links and questions: what needs no browser.
import assert from "node:assert/strict";
import test from "node:test";
import { askGrade, askRun, keyOf, wanted } from "../../../ropeode/laboratory/page/asks.js";
import { clipped } from "../../../ropeode/laboratory/page/clip.js";
import { boxAt, extentOf, farthest, home } from "../../../ropeode/laboratory/page/extent.js";
import { Motion } from "../../../ropeode/laboratory/page/motion.js";
import { svgPen } from "../../../ropeode/laboratory/page/pens.js";
import { defaultScene, linkOf, sceneOf } from "../../../ropeode/laboratory/page/state.js";
import { named, parsed } from "../../../ropeode/laboratory/page/stepper_names.js";
import { Store } from "../../../ropeode/laboratory/page/store.js";

const SAMPLES = 33;

/** An array of one point at x = f(sample), y = 0. */
function along(count, f) {
  const data = new Float32Array(2 * count);
  for (let i = 0; i < count; i++) data[2 * i] = f(i);
  return { data, shape: [count, 1, 2] };
}

const truth = { arrays: { points: along(SAMPLES, (i) => i * i) } };
const run = (every, count, f) => ({ every, arrays: { differences: along(count, f) } });

test("a run is the reference plus so many times its difference", () => {
  const motion = new Motion(truth, run(2, 17, (i) => i / 8), 100);
  for (const sample of [0, 2, 16, 32]) assert.equal(motion.at(sample)[0], sample ** 2 + (100 * sample) / 16);
});

test("between samples the picture follows a parabola as it is", () => {
  const motion = new Motion(truth, null, 1);
  for (const place of [1.25, 7.5, 30.9]) assert.ok(Math.abs(motion.at(place)[0] - place ** 2) < 1e-5);
});

test("a run ends with its last finite sample", () => {
  const motion = new Motion(truth, run(4, 3, () => 1), 1);
  assert.equal(motion.last, 8);
  assert.notEqual(motion.at(8), null);
  assert.equal(motion.at(8.01), null);
});

test("the view follows a run, marks where it left, and returns", () => {
  const still = { arrays: { points: along(SAMPLES, (i) => i % 2) } };
  const start = home(new Motion(still, null, 1));
  const limit = farthest(start, true);
  const motion = new Motion(still, run(1, SAMPLES, (i) => (i < 4 ? 0 : 1.3 * (i - 3))), 1);
  const extent = extentOf(motion, 8, start, limit);
  assert.equal(boxAt(extent, 3).x1, 1);
  assert.ok(boxAt(extent, 4).x1 >= 1.299);
  assert.deepEqual(extent.leaving.map(({ point, sample }) => [point, sample]), [[0, 5]]);
  assert.ok(Math.abs(extent.leaving[0].x - limit.x1) < 1e-9);
  assert.ok(boxAt(extent, 32).x1 < 1.05);
});

test("a point that becomes infinitely large leaves no NaN in the view", () => {
  const motion = new Motion(truth, run(1, 20, (i) => 10 ** (2 * i)), 1e6);
  const extent = extentOf(motion, 8, home(new Motion(truth, null, 1)), farthest(home(new Motion(truth, null, 1)), true));
  assert.ok(extent.boxes.every(Number.isFinite));
});

test("lines end at the edge of the picture", () => {
  const frame = { x: 0, y: 0, width: 100, height: 60 };
  const inside = [10, 10, 20, 20, 30, 10];
  assert.equal(clipped(inside, null, frame).xy, inside);
  const { xy, links } = clipped([50, 30, 1e9, 30, 1e9, 1e9, 50, 40, 50, -1e30], null, frame);
  assert.deepEqual(links.map(([a, b]) => [...xy.slice(2 * a, 2 * a + 2), ...xy.slice(2 * b, 2 * b + 2)])[0],
    [50, 30, 120, 30]);
  assert.equal(links.length, 3);
  assert.ok(xy.every((each) => Math.abs(each) <= 120.001), String(xy));
});

test("a link holds the whole scene", () => {
  const scene = {
    ...defaultScene(), problem: { name: "kepler", parameters: { eccentricity: 0.7 }, frames: 12 },
    steppers: ["stormer-verlet:start=rest,damping=lagged"], hidden: [0], steps: 64, ladder: [16, 32, 64],
    time: 3.5, playing: false, layout: "beside", magnified: 1e6, node: 2, language: "zh",
    choices: { ...defaultScene().choices, motion: "phase", phase: "mode 1" },
  };
  assert.deepEqual(sceneOf(linkOf(scene)), scene);
  assert.equal(linkOf(defaultScene()), "");
});

test("what a link has wrong is the default", () => {
  for (const link of ["#steps=0", "#steps=%7B", "#steppers=[1]", "#ladder=[1e9]", "#other=1", "#playing=3",
    "#problem=null", "#steppers=[\"a\",\"b\",\"c\",\"d\",\"e\",\"f\"]", "#magnified=-1", "#%"])
    assert.deepEqual(sceneOf(link), defaultScene(), link);
});

test("a question is its own key, whatever the order of its names", () => {
  const { version, ...ask } = askRun(defaultScene(), "rk4", 16);
  assert.equal(version, undefined);
  const turned = Object.fromEntries(Object.entries({ ...ask, version: null }).reverse());
  assert.equal(keyOf(ask), keyOf(turned));
  assert.notEqual(keyOf(ask), keyOf(askRun(defaultScene(), "rk4", 32)));
});

test("a key is short also for large files, and tells them apart", () => {
  const scene = { ...defaultScene(), files: [{ name: "a.csv", text: "1,".repeat(1e5) }] };
  const other = { ...scene, files: [{ name: "a.csv", text: `${"1,".repeat(1e5 - 1)}2,` }] };
  assert.ok(keyOf(askGrade(scene)).length < 4096);
  assert.notEqual(keyOf(askGrade(scene)), keyOf(askGrade(other)));
});

test("what moves is asked first, and what the next key needs is asked as well", () => {
  const scene = { ...defaultScene(), hidden: [1] };
  const kinds = wanted(scene).map(({ kind }) => kind);
  assert.deepEqual(kinds.slice(0, 4), ["library", "truth", "run", "run"]);
  const steps = wanted(scene).filter(({ kind }) => kind === "run").map((each) => each.steps_per_frame);
  assert.ok(steps.includes(32) && steps.includes(8));
  assert.ok(!wanted(scene).some(({ stepper }) => stepper === "semi-implicit-euler"));
});

test("options of steppers go into their names and out again", () => {
  const known = [
    { name: "stormer-verlet", options: { start: ["taylor", "rest"], damping: ["centered", "lagged"] } },
    { name: "diffrax:Tsit5", options: {} },
  ];
  assert.equal(named("stormer-verlet", { start: "rest", damping: "centered" }, known), "stormer-verlet:start=rest");
  assert.deepEqual(parsed("stormer-verlet:start=rest", known), { name: "stormer-verlet", options: { start: "rest" } });
  assert.deepEqual(parsed("diffrax:Tsit5", known), { name: "diffrax:Tsit5", options: {} });
  assert.deepEqual(parsed("mine", known), { name: "mine", options: {} });
});

test("the store forgets the oldest answers that nobody wants", () => {
  const store = new Store();
  const ask = (steps) => askRun(defaultScene(), "rk4", steps);
  const answer = () => ({ kind: "run", arrays: { differences: { shape: [1e6], data: new Float32Array(1e6) } } });
  store.want([ask(1)]);
  for (let steps = 1; steps <= 40; steps++) store.receive(keyOf(ask(steps)), answer());
  const kept = Array.from({ length: 40 }, (_, i) => i + 1).filter((steps) => store.answer(ask(steps)));
  assert.equal(kept[0], 1);
  assert.ok(kept.length <= 16 && kept.at(-1) === 40, String(kept));
});

test("a refusal is a sentence and no answer, and is asked again after the connection was lost", () => {
  const store = new Store();
  const ask = askRun(defaultScene(), "rk4", 16);
  let asked = 0;
  store.channels.push({ want: (list) => ((asked += list.length), []) });
  store.want([ask]);
  store.receive(keyOf(ask), { kind: "refused", message: "steps: too many", line: null, arrays: {} });
  assert.equal(store.answer(ask), undefined);
  assert.equal(store.refusal(ask).message, "steps: too many");
  store.again();
  assert.equal(asked, 1);
  store.dropRefusals();
  store.again();
  assert.equal(asked, 2);
});

test("the SVG pen writes what is drawn, and no markup of a name", () => {
  const { pen, text } = svgPen(100, 50, "#fff");
  pen.lines([0, 0, 10, 10, 20, 0], [[0, 2]], { colour: "#123456", width: 2, dash: [3, 1] });
  pen.text("<script>&", 1, 2, { colour: "#000", size: 12 });
  assert.match(text(), /d="M0,0L20,0" .*stroke="#123456".*stroke-dasharray="3 1"/);
  assert.match(text(), /&lt;script&gt;&amp;/);
});
