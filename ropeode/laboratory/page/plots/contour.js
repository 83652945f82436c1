// Where a function on a grid is at most some level, by marching squares.

/** @typedef {[number, number]} Place */

/**
 * The region where a function on a grid is at most `level`; linear along the edges of cells.
 * @param {ArrayLike<number>} values row by row; what is not a number lies outside
 * @param {number} rows
 * @param {number} columns
 * @param {number} level
 * @returns {{polygons: Place[][], edges: [Place, Place][]}} polygons that fill the region, and its
 *   edges, without those of the grid; places are (column, row)
 */
export function regionBelow(values, rows, columns, level) {
  /** @type {Place[][]} */
  const polygons = [];
  /** @type {[Place, Place][]} */
  const edges = [];
  /** @type {(row: number, column: number) => number} */
  const value = (row, column) => {
    const found = values[row * columns + column] ?? Infinity;
    return Number.isNaN(found) ? Infinity : found;
  };
  for (let row = 0; row + 1 < rows; row += 1) {
    // Cells that lie wholly inside are one rectangle as long as they follow one another.
    let whole = -1;
    for (let column = 0; column + 1 <= columns; column += 1) {
      const inside = column + 1 < columns && isWhole(value, row, column, level);
      if (inside && whole < 0) whole = column;
      if (!inside && whole >= 0) {
        polygons.push([[whole, row], [column, row], [column, row + 1], [whole, row + 1]]);
        whole = -1;
      }
      if (!inside && column + 1 < columns) cut(value, row, column, level, polygons, edges);
    }
  }
  return { polygons, edges };
}

/** @param {number} row @param {number} column @returns {Place[]} the corners of a cell, in turn */
function corners(row, column) {
  return [[column, row], [column + 1, row], [column + 1, row + 1], [column, row + 1]];
}

/**
 * @param {(row: number, column: number) => number} value
 * @param {number} row @param {number} column @param {number} level
 */
function isWhole(value, row, column, level) {
  return corners(row, column).every(([x, y]) => value(y, x) <= level);
}

/**
 * Add the part of a cell that lies inside, and its edge.
 * @param {(row: number, column: number) => number} value
 * @param {number} row @param {number} column @param {number} level
 * @param {Place[][]} polygons @param {[Place, Place][]} edges
 */
function cut(value, row, column, level, polygons, edges) {
  /** @type {Place[]} */
  const polygon = [];
  /** @type {Place[]} */
  const crossings = [];
  const around = corners(row, column);
  let entered = false;
  around.forEach(([x, y], i) => {
    const [nextX, nextY] = around[(i + 1) % 4];
    const [here, next] = [value(y, x), value(nextY, nextX)];
    if (here <= level) polygon.push([x, y]);
    if (here <= level === next <= level) return;
    const part = here <= level ? share(here, next, level) : 1 - share(next, here, level);
    /** @type {Place} */
    const crossing = [x + part * (nextX - x), y + part * (nextY - y)];
    if (!crossings.length) entered = here > level;
    polygon.push(crossing);
    crossings.push(crossing);
  });
  if (polygon.length) polygons.push(polygon);
  // Each edge leads from where the way around leaves the region to where it comes back.
  if (entered) crossings.push(/** @type {Place} */ (crossings.shift()));
  for (let i = 0; i + 1 < crossings.length; i += 2) edges.push([crossings[i], crossings[i + 1]]);
}

/** Where the level lies between a value inside and one outside. @param {number} inside @param {number} outside @param {number} level */
function share(inside, outside, level) {
  return outside === Infinity ? 0 : (level - inside) / (outside - inside);
}
