// Marks as SVG.

import { svg } from "./svg.js";

/** @typedef {import("./chart.js").Mark} Mark */
/** @typedef {import("./chart.js").Shape} Shape */
/** @typedef {import("./scales.js").Scale} Scale */
/**
 * Where marks are drawn: scales, and the box in pixels.
 * @typedef {{x: Scale, y: Scale, left: number, top: number, width: number, height: number}} Box
 */

const SIZE = 5;
// So wide is a letter, or a little less.
const LETTER = 7;

/** @param {Box} box @param {number} value */
export function across(box, value) {
  return box.left + box.width * box.x.at(value);
}

/** @param {Box} box @param {number} value */
export function upright(box, value) {
  return box.top + box.height * (1 - box.y.at(value));
}

/**
 * @param {Mark} mark
 * @param {Box} box
 * @returns {Element}
 */
export function drawn(mark, box) {
  switch (mark.kind) {
    case "line":
      return svg("path", {
        d: path(mark, box),
        class: "plot-line",
        stroke: mark.color,
        "stroke-width": mark.width,
        "stroke-dasharray": mark.dash || null,
      });
    case "band":
      return svg("path", { d: band(mark, box), class: "plot-band" });
    case "rule":
      return rule(mark, box);
    case "point":
      return point(mark.shape, across(box, mark.x), upright(box, mark.y), mark.color);
    case "region":
      return region(mark, box);
    case "text": {
      const [x, y] = [across(box, mark.x), upright(box, mark.y)];
      return svg("text", { x, y: y - 10, class: "plot-text", "text-anchor": "middle" }, mark.text);
    }
  }
}

/**
 * The line through places; it ends where a value is not finite, and begins again after it.
 * @param {import("./chart.js").LineMark} mark @param {Box} box
 */
export function path({ x: xs, y: ys, smooth }, box) {
  /** @type {[number, number][][]} */
  const parts = [];
  // A line far outside would overflow what a browser can draw.
  const [lowest, highest] = [box.top + 3 * box.height, box.top - 3 * box.height];
  let [open, lastX, lastY] = [false, 0, 0];
  for (let i = 0; i < xs.length; i += 1) {
    const [x, raw] = [across(box, xs[i]), upright(box, ys[i])];
    if (!Number.isFinite(x) || Number.isNaN(raw)) {
      open = false;
      continue;
    }
    const y = Math.min(lowest, Math.max(highest, raw));
    if (!open) parts.push([]);
    else if (Math.abs(x - lastX) + Math.abs(y - lastY) < 0.4) continue;
    parts[parts.length - 1].push([x, y]);
    [open, lastX, lastY] = [true, x, y];
  }
  return parts.map(smooth ? bent : straight).join("");
}

/** @param {[number, number]} place */
function written([x, y]) {
  return `${x.toFixed(1)},${y.toFixed(1)}`;
}

/** @param {[number, number][]} places */
function straight(places) {
  return `M${places.map(written).join("L")}`;
}

/**
 * A centripetal Catmull-Rom curve: it keeps close to its places also where they are far apart after
 * others that are not (Yuksel, Schaefer, Keyser, Computer-Aided Design 43, 2011).
 * @param {[number, number][]} places
 */
function bent(places) {
  const last = places.length - 1;
  const knots = places.slice(1).map(([x, y], i) => Math.sqrt(Math.hypot(x - places[i][0], y - places[i][1])));
  /** How a coordinate changes between places, for a unit of the knots. @param {number} i @param {number} j @param {0 | 1} k */
  const change = (i, j, k) => {
    const apart = knots.slice(i, j).reduce((sum, each) => sum + each, 0);
    return (places[j][k] - places[i][k]) / apart;
  };
  /** @param {number} i @param {0 | 1} k */
  const slope = (i, k) => {
    if (i === 0) return change(0, 1, k);
    if (i === last) return change(i - 1, i, k);
    return change(i - 1, i, k) - change(i - 1, i + 1, k) + change(i, i + 1, k);
  };
  /** Where the curve is drawn to from a place. @param {number} i @param {number} third of a knot @returns {[number, number]} */
  const beside = (i, third) => [places[i][0] + third * slope(i, 0), places[i][1] + third * slope(i, 1)];
  const curves = knots.map((knot, i) =>
    `C${[beside(i, knot / 3), beside(i + 1, -knot / 3), places[i + 1]].map(written).join(" ")}`);
  return `M${written(places[0])}${curves.join("")}`;
}

/** @param {import("./chart.js").BandMark} mark @param {Box} box */
function band({ x, y, low }, box) {
  const bottom = box.top + box.height;
  /** @param {number} i @param {number} value */
  const place = (i, value) => {
    const within = Math.min(bottom, Math.max(box.top, upright(box, value)));
    return `${across(box, x[i]).toFixed(1)},${(Number.isNaN(within) ? bottom : within).toFixed(1)}`;
  };
  const over = Array.from(y, (value, i) => place(i, value));
  const under = low
    ? Array.from(low, (value, i) => place(i, value))
    : Array.from(y, (_, i) => `${across(box, x[i]).toFixed(1)},${bottom}`);
  const around = [...over, ...under.reverse()];
  return around.length ? `M${around.join("L")}Z` : "";
}

/** @param {import("./chart.js").RuleMark} mark @param {Box} box */
function rule(mark, box) {
  const [right, bottom] = [box.left + box.width, box.top + box.height];
  if (mark.x !== undefined) {
    const x = across(box, mark.x);
    const before = x + LETTER * mark.label.length > right;
    return svg(
      "g",
      { class: "plot-rule" },
      svg("line", { x1: x, x2: x, y1: box.top, y2: bottom }),
      svg("text", {
        x: before ? x - 4 : x + 4,
        // Below the curves, as most of them lie.
        y: bottom - 6,
        "text-anchor": before ? "end" : "start",
      }, mark.label),
    );
  }
  const y = upright(box, mark.y ?? 0);
  return svg(
    "g",
    { class: "plot-rule" },
    svg("line", { x1: box.left, x2: right, y1: y, y2: y }),
    svg("text", { x: right - 4, y: y - 4, "text-anchor": "end" }, mark.label),
  );
}

/** @param {import("./chart.js").RegionMark} mark @param {Box} box */
function region(mark, box) {
  /** @param {[number, number]} place */
  const at = ([x, y]) => `${across(box, x).toFixed(1)},${upright(box, y).toFixed(1)}`;
  const inside = mark.polygons.map((each) => `M${each.map(at).join("L")}Z`).join("");
  const edge = mark.edges.map(([from, to]) => `M${at(from)}L${at(to)}`).join("");
  return svg(
    "g",
    {},
    svg("path", { d: inside, fill: mark.color, "fill-opacity": 0.18 }),
    svg("path", { d: edge, class: "plot-line", stroke: mark.color, "stroke-width": 1.5 }),
  );
}

/** @type {Record<Shape, {d: string, filled?: boolean}>} */
const SHAPES = {
  disc: { d: circle(0.9), filled: true },
  ring: { d: circle(0.9) },
  cross: { d: "M-1,-1L1,1M-1,1L1,-1" },
  plus: { d: "M-1.2,0H1.2M0,-1.2V1.2" },
  diamond: { d: "M0,-1.3L1,0L0,1.3L-1,0Z" },
  star: { d: star() },
  // Both hang below their place: the first from a bound, the second from the upper edge.
  down: { d: "M-1,0H1M0,0V3M-0.8,1.9L0,3L0.8,1.9" },
  up: { d: "M0,3V0.2M-0.8,1.3L0,0.2L0.8,1.3" },
};

/**
 * @param {Shape} shape @param {number} x @param {number} y @param {string} color
 */
export function point(shape, x, y, color) {
  const { d, filled } = SHAPES[shape];
  return svg("path", {
    d,
    transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) scale(${SIZE})`,
    class: "plot-point",
    stroke: color,
    fill: filled ? color : "none",
  });
}

/** What a legend shows of an entry, in 30 by 14 pixels. @param {import("./chart.js").Entry} entry */
export function swatch({ color, dash, shape }) {
  const sample = svg("g");
  if (dash !== null) {
    const line = { x1: 1, x2: 29, y1: 7, y2: 7, stroke: color, "stroke-width": 2 };
    sample.append(svg("line", { ...line, "stroke-dasharray": dash || null }));
  }
  const hangs = shape === "down" || shape === "up";
  if (shape) sample.append(point(shape, 15, hangs ? 1 : 7, color));
  return sample;
}

/** @param {number} radius */
function circle(radius) {
  return `M${-radius},0A${radius},${radius} 0 1 1 ${radius},0A${radius},${radius} 0 1 1 ${-radius},0Z`;
}

function star() {
  const corners = Array.from({ length: 10 }, (_, i) => {
    const [angle, radius] = [(i * Math.PI) / 5, i % 2 ? 0.55 : 1.3];
    return `${(radius * Math.sin(angle)).toFixed(3)},${(-radius * Math.cos(angle)).toFixed(3)}`;
  });
  return `M${corners.join("L")}Z`;
}
