// @ts-check
// Browsers draw dashes also where nobody sees them, and a run that explodes has lines of any length.
/** @typedef {import("./drawing").Frame} Frame */

const MARGIN = 20;

/**
 * Lines without what lies outside of a frame.
 *
 * @param {ArrayLike<number>} xy x, y, x, y, ... in pixels
 * @param {[number, number][] | null} links null: each point is joined to the next
 * @param {Frame} frame
 * @returns {{xy: ArrayLike<number>, links: [number, number][] | null}}
 */
export function clipped(xy, links, frame) {
  const x0 = frame.x - MARGIN;
  const y0 = frame.y - MARGIN;
  const x1 = frame.x + frame.width + MARGIN;
  const y1 = frame.y + frame.height + MARGIN;
  let all = true;
  for (let k = 0; k < xy.length && all; k += 2)
    all = xy[k] >= x0 && xy[k] <= x1 && xy[k + 1] >= y0 && xy[k + 1] <= y1;
  if (all) return { xy, links };
  /** @type {number[]} */
  const kept = [];
  /** @type {[number, number][]} */
  const joined = [];
  /** @param {number} a @param {number} b */
  function keep(a, b) {
    const [x, y] = [xy[2 * a], xy[2 * a + 1]];
    const [dx, dy] = [xy[2 * b] - x, xy[2 * b + 1] - y];
    // Liang and Barsky (1984): the part of the line between all four edges.
    let [from, to] = [0, 1];
    for (const [p, q] of [[-dx, x - x0], [dx, x1 - x], [-dy, y - y0], [dy, y1 - y]]) {
      if (p === 0 && q < 0) return;
      if (p < 0) from = Math.max(from, q / p);
      if (p > 0) to = Math.min(to, q / p);
    }
    if (!(from < to)) return;
    const at = kept.length / 2;
    kept.push(x + from * dx, y + from * dy, x + to * dx, y + to * dy);
    joined.push([at, at + 1]);
  }
  if (links) for (const [a, b] of links) keep(a, b);
  else for (let i = 0; i + 1 < xy.length / 2; i++) keep(i, i + 1);
  return { xy: kept, links: joined };
}
