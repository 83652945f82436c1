// @ts-check
// What the view has to hold. It grows with a run that explodes, up to a limit. What goes further has
// left, and the view returns to the others.
/** @typedef {import("./motion").Motion} Motion */
/** @typedef {{x0: number, x1: number, y0: number, y1: number}} Box */
/**
 * A point that left.
 *
 * @typedef {{point: number, sample: number, x: number, y: number}} Leaving
 */
/** @typedef {{last: number, boxes: Float64Array, every: number, leaving: Leaving[]}} Extent */

/** So many times the size of the reference's motion, at most. */
const FARTHEST = 2.5;
/** How much of what the view has grown remains after a frame in which nothing needs it. */
const REMAINS = 0.4;

/** @type {(keyof Box)[]} */
const SIDES = ["x0", "x1", "y0", "y1"];

/** @param {Motion} motion of the reference @returns {Box} all that it reaches, not empty */
export function home(motion) {
  const box = { x0: Infinity, x1: -Infinity, y0: Infinity, y1: -Infinity };
  for (let k = 0; k < motion.truth.length; k += 2) {
    box.x0 = Math.min(box.x0, motion.truth[k]);
    box.x1 = Math.max(box.x1, motion.truth[k]);
    box.y0 = Math.min(box.y0, motion.truth[k + 1]);
    box.y1 = Math.max(box.y1, motion.truth[k + 1]);
  }
  return box;
}

/** @param {Box} box @param {boolean} square whether both axes have one scale @returns {Box} */
export function padded(box, square) {
  const width = box.x1 - box.x0;
  const height = box.y1 - box.y0;
  const most = Math.max(width, height) || 1;
  const dx = 0.08 * (square ? most : width || 1);
  const dy = 0.08 * (square ? most : height || 1);
  return { x0: box.x0 - dx, x1: box.x1 + dx, y0: box.y0 - dy, y1: box.y1 + dy };
}

/** @param {Box} box @param {boolean} square @returns {Box} as far as the view follows */
export function farthest(box, square) {
  const x = (box.x0 + box.x1) / 2;
  const y = (box.y0 + box.y1) / 2;
  const most = Math.max(box.x1 - box.x0, box.y1 - box.y0);
  const dx = (FARTHEST / 2) * (square ? most : box.x1 - box.x0);
  const dy = (FARTHEST / 2) * (square ? most : box.y1 - box.y0);
  return { x0: x - dx, x1: x + dx, y0: y - dy, y1: y + dy };
}

/**
 * What the view has to hold at each sample of a run, and which points left.
 *
 * @param {Motion} motion
 * @param {number} samplesPerFrame of the reference
 * @param {Box} start the least that is shown
 * @param {Box} limit the most
 * @returns {Extent}
 */
export function extentOf(motion, samplesPerFrame, start, limit) {
  const samples = motion.known();
  const boxes = new Float64Array(4 * samples.length);
  /** @type {Map<number, Leaving>} */
  const leaving = new Map();
  const box = { ...start };
  const remains = REMAINS ** (motion.every / samplesPerFrame);
  const before = new Float64Array(motion.width);
  samples.forEach((sample, i) => {
    const points = motion.at(sample) ?? before;
    for (const side of SIDES) box[side] = start[side] + remains * (box[side] - start[side]);
    for (let k = 0; k < points.length; k += 2) {
      const [x, y] = [points[k], points[k + 1]];
      const inside = x >= limit.x0 && x <= limit.x1 && y >= limit.y0 && y <= limit.y1;
      if (!inside && !leaving.has(k / 2))
        leaving.set(k / 2, { point: k / 2, sample, ...edge(limit, before[k], before[k + 1], x, y) });
      if (leaving.has(k / 2)) continue;
      box.x0 = Math.min(box.x0, x);
      box.x1 = Math.max(box.x1, x);
      box.y0 = Math.min(box.y0, y);
      box.y1 = Math.max(box.y1, y);
    }
    boxes.set([box.x0, box.x1, box.y0, box.y1], 4 * i);
    before.set(points);
  });
  return { last: motion.last, boxes, every: motion.every, leaving: [...leaving.values()] };
}

/** Where the way to a point outside of a box crosses its edge. @param {Box} box @param {number} x @param {number} y @param {number} toX @param {number} toY */
function edge(box, x, y, toX, toY) {
  const dx = toX - x;
  const dy = toY - y;
  const part = Math.min(
    dx > 0 ? (box.x1 - x) / dx : dx < 0 ? (box.x0 - x) / dx : 1,
    dy > 0 ? (box.y1 - y) / dy : dy < 0 ? (box.y0 - y) / dy : 1,
  );
  const inside = Math.max(0, Math.min(1, part));
  return { x: x + inside * dx, y: y + inside * dy };
}

/** @param {Extent} extent @param {number} place @returns {Box} */
export function boxAt({ boxes, every, last }, place) {
  const at = Math.min(place, last) / every;
  const i = 4 * Math.floor(at);
  const j = Math.min(i + 4, boxes.length - 4);
  const u = at - Math.floor(at);
  /** @param {number} k */
  const between = (k) => boxes[i + k] + u * (boxes[j + k] - boxes[i + k]);
  return { x0: between(0), x1: between(1), y0: between(2), y1: between(3) };
}

/** @param {Box} a @param {Box} b @returns {Box} that holds both */
export function union(a, b) {
  return {
    x0: Math.min(a.x0, b.x0), x1: Math.max(a.x1, b.x1),
    y0: Math.min(a.y0, b.y0), y1: Math.max(a.y1, b.y1),
  };
}
