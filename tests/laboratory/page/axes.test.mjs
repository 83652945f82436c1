// Numbers and ticks. Run by tests/laboratory/test_page_modules.py.

import assert from "node:assert/strict";
import { test } from "node:test";
import { shortly, written } from "../../../ropeode/laboratory/page/numbers.js";
import { linear, logarithmic, signedLogarithmic } from "../../../ropeode/laboratory/page/plots/scales.js";

const labels = (scale, count) => scale.ticks(count).map(({ label }) => label);

test("numbers have three digits, and powers of ten where they are long", () => {
  const numbers = [0, 1.5, -0.0123, 123456, -1.2345e-10, 1e300, Infinity, NaN];
  assert.deepEqual(numbers.map((each) => written(each)), [
    "0", "1.50", "−0.0123", "1.23 × 10⁵", "−1.23 × 10⁻¹⁰", "1.00 × 10³⁰⁰", "∞", "–",
  ]);
  const short = [0.1 + 0.2, 1e-5, -1e-5, 2.5e7].map((each) => shortly(each));
  assert.deepEqual(short, ["0.3", "10⁻⁵", "−10⁻⁵", "2.5 × 10⁷"]);
  assert.deepEqual([1 / 3, 2e5 / 3, -0.02, 99.96].map((each) => shortly(each, 3)), ["0.333", "66700", "−0.02", "100"]);
});

test("linear ticks are round, and none is a negative zero", () => {
  assert.deepEqual(labels(linear(-1, 1), 4), ["−1", "−0.5", "0", "0.5", "1"]);
  assert.deepEqual(labels(linear(0, 40), 5), ["0", "10", "20", "30", "40"]);
});

test("logarithmic ticks are powers of ten, or between them on a short axis", () => {
  assert.deepEqual(labels(logarithmic(1e-12, 1), 4), ["10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³", "1"]);
  assert.deepEqual(labels(logarithmic(0.09, 1.1), 5), ["0.1", "0.2", "0.5", "1"]);
});

test("the axis of both signs has zero, and ticks that do not stand on one another", () => {
  const scale = signedLogarithmic(-1, 1, 1e-6);
  const found = scale.ticks(6);
  assert.ok(found.some(({ label }) => label === "0"));
  const places = found.map(({ value }) => scale.at(value)).sort((a, b) => a - b);
  places.slice(1).forEach((place, i) => assert.ok(place - places[i] > 0.09));
  for (const value of [-1, -1e-3, 0, 1e-7, 0.5]) {
    assert.ok(Math.abs(scale.value(scale.at(value)) - value) < 1e-12);
  }
});
