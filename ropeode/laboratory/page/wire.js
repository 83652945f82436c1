// @ts-check
/**
 * @typedef {{shape: number[], data: Float32Array}} Numbers an array in row-major order
 */
/**
 * An answer with its arrays.
 *
 * @template {import("./messages").Answer} [A=import("./messages").Answer]
 * @typedef {A & {arrays: {[name: string]: Numbers}}} Answered
 */

/**
 * An answer from its bytes: [length of the header][header in JSON][numbers in float32].
 *
 * @param {ArrayBuffer} bytes as `wire.py` writes them
 * @returns {{key: string, answer: Answered}}
 */
export function decoded(bytes) {
  const length = new DataView(bytes).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(bytes, 4, length));
  const { key, arrays = {}, ...header } = JSON.parse(text);
  /** @type {{[name: string]: Numbers}} */
  const numbers = {};
  for (const [name, [start, shape]] of Object.entries(arrays)) {
    const size = shape.reduce((/** @type {number} */ a, /** @type {number} */ b) => a * b, 1);
    numbers[name] = { shape, data: new Float32Array(bytes, 4 + length + 4 * start, size) };
  }
  return { key, answer: { ...header, arrays: numbers } };
}

/** @param {Answered} answer @returns {number} memory that its arrays take, in bytes */
export function size(answer) {
  return Object.values(answer.arrays).reduce((sum, each) => sum + 4 * each.data.length, 1000);
}
