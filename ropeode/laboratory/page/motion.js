// @ts-check
// Between samples the picture follows cubic Hermite polynomials whose slopes are central
// differences (Catmull and Rom, 1974). They are for the eye alone; no number comes from them.
/** @typedef {import("./wire").Answered<import("./messages").Truth>} Truth */
/** @typedef {import("./wire").Answered<import("./messages").Run>} Run */

/**
 * Add what an array holds at a place between its samples.
 *
 * @param {Float32Array} data (samples, width)
 * @param {number} width
 * @param {number} samples
 * @param {number} place counted in samples
 * @param {number} times factor
 * @param {Float64Array} sum gets it
 */
function addAt(data, width, samples, place, times, sum) {
  const i = Math.min(Math.floor(place), samples - 1);
  const u = place - i;
  const before = Math.max(i - 1, 0) * width;
  const here = i * width;
  if (u === 0 || i === samples - 1) {
    for (let k = 0; k < width; k++) sum[k] += times * data[here + k];
    return;
  }
  const next = here + width;
  const after = Math.min(i + 2, samples - 1) * width;
  // Slopes over the length of the differences, which are one-sided at the ends.
  const s0 = i > 0 ? 0.5 : 1;
  const s1 = i + 2 < samples ? 0.5 : 1;
  const h11 = u * u * (u - 1);
  const h10 = u * (1 - u) ** 2;
  const h01 = u * u * (3 - 2 * u);
  for (let k = 0; k < width; k++) {
    const a = data[here + k];
    const b = data[next + k];
    const slopes = h10 * s0 * (b - data[before + k]) + h11 * s1 * (data[after + k] - a);
    sum[k] += times * (a + h01 * (b - a) + slopes);
  }
}

/** What is drawn of the reference, or of a run beside it, at any time. */
export class Motion {
  /**
   * @param {Truth} truth
   * @param {Run | null} run null: the reference itself
   * @param {number} magnified the differences are drawn so many times as large
   */
  constructor(truth, run, magnified) {
    const { points } = truth.arrays;
    this.truth = points.data;
    this.samples = points.shape[0];
    this.width = 2 * points.shape[1];
    this.differences = run?.arrays.differences;
    this.every = run?.every ?? 1;
    this.magnified = magnified;
    /** The last sample that can be drawn. */
    this.last = this.differences
      ? Math.max(0, this.differences.shape[0] - 1) * this.every
      : this.samples - 1;
    this.positions = new Float64Array(this.width);
  }

  /**
   * Points at a place, which the next call overwrites.
   *
   * @param {number} place counted in samples of the reference
   * @returns {Float64Array | null} x, y, x, y, ...; null where the run is no longer finite
   */
  at(place) {
    if (place > this.last) return null;
    this.positions.fill(0);
    addAt(this.truth, this.width, this.samples, place, 1, this.positions);
    const { differences, every, magnified } = this;
    if (differences)
      addAt(differences.data, this.width, differences.shape[0], place / every, magnified, this.positions);
    return this.positions;
  }

  /** The samples at which it is known. @returns {number[]} */
  known() {
    const count = Math.floor(this.last / this.every) + 1;
    return Array.from({ length: count }, (_, i) => i * this.every);
  }
}
