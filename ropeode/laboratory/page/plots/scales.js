// Scales: where a value lies on an axis, from 0 to 1, and which ticks the axis has.

import { powerOfTen, shortly } from "../numbers.js";

/** @typedef {{value: number, label: string}} Tick */
/**
 * @typedef {object} Scale
 * @property {(value: number) => number} at where a value lies: 0 at the low end, 1 at the high one
 * @property {(place: number) => number} value the value at a place
 * @property {(count: number) => Tick[]} ticks about so many, inside the ends
 */

/**
 * @param {number} low
 * @param {number} high
 * @returns {Scale}
 */
export function linear(low, high) {
  return {
    at: (value) => (value - low) / (high - low),
    value: (place) => low + place * (high - low),
    ticks: (count) => roundNumbers(low, high, count).map((value) => ({ value, label: shortly(value) })),
  };
}

/**
 * @param {number} low above zero
 * @param {number} high
 * @returns {Scale}
 */
export function logarithmic(low, high) {
  const [start, end] = [Math.log10(low), Math.log10(high)];
  const inner = linear(start, end);
  return {
    at: (value) => inner.at(Math.log10(value)),
    value: (place) => 10 ** inner.value(place),
    ticks: (count) => (end - start < 1.5 ? fewDecades(low, high, count) : powers(start, end, count)),
  };
}

/**
 * Logarithmic towards both sides of zero, and linear between -threshold and threshold.
 * @param {number} low
 * @param {number} high
 * @param {number} threshold
 * @returns {Scale}
 */
export function signedLogarithmic(low, high, threshold) {
  /** @param {number} value */
  const bent = (value) => Math.asinh(value / threshold / 2) / Math.LN10;
  const inner = linear(bent(low), bent(high));
  return {
    at: (value) => inner.at(bent(value)),
    value: (place) => 2 * threshold * Math.sinh(inner.value(place) * Math.LN10),
    ticks: (count) => {
      const [start, end] = [Math.log10(threshold), Math.log10(Math.max(high, -low))];
      const above = powers(start, end, Math.max(1, count / 2 - 1));
      const below = above.map(({ value, label }) => ({ value: -value, label: `−${label}` }));
      // Next to zero there is no room for two labels.
      const apart = 0.6 / count;
      const zero = inner.at(0);
      const all = [...below.reverse(), ...above].filter(({ value }) => {
        const place = inner.at(bent(value));
        return place >= 0 && place <= 1 && Math.abs(place - zero) > apart;
      });
      return [...all, { value: 0, label: "0" }];
    },
  };
}

/**
 * Multiples of 1, 2 or 5 times a power of ten from low to high.
 * @param {number} low
 * @param {number} high
 * @param {number} count
 */
export function roundNumbers(low, high, count) {
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5].find((each) => each * power >= rough) ?? 10);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i += 1) {
    // -0 would be written with a sign.
    found.push(Number((i * step).toPrecision(12)) + 0);
  }
  return found;
}

/**
 * Powers of ten whose exponents lie between the ends, in equal steps.
 * @param {number} start
 * @param {number} end
 * @param {number} count
 * @returns {Tick[]}
 */
function powers(start, end, count) {
  const step = Math.max(1, Math.ceil((end - start) / Math.max(1, count)));
  const found = [];
  for (let i = Math.ceil((start - 1e-9) / step) * step; i <= end + 1e-9; i += step) {
    found.push({ value: 10 ** i, label: powerOfTen(i) });
  }
  return found;
}

/**
 * @param {number} low
 * @param {number} high
 * @param {number} count
 * @returns {Tick[]}
 */
function fewDecades(low, high, count) {
  const found = [];
  const digits = count < 4 ? [1] : [1, 2, 5];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
    for (const digit of digits) found.push(Number(`${digit}e${power}`));
  }
  const inside = found.filter((value) => value >= low * 0.999 && value <= high * 1.001);
  return inside.map((value) => ({ value, label: shortly(value) }));
}
