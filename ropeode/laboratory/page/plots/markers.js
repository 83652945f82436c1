// Points of a plot that can be chosen, by the pointer and by the keyboard.

import { across, point, upright } from "./marks.js";
import { svg } from "./svg.js";

/** @typedef {import("./chart.js").PointMark} PointMark */

// The pointer is near a point from here on, in pixels.
const NEAR = 24;
const [CLOSE, APART] = [5, 9];
/** @type {Record<string, (at: number, many: number) => number>} */
const MOVES = {
  ArrowRight: (at, many) => Math.min(many - 1, at + 1),
  ArrowDown: (at, many) => Math.min(many - 1, at + 1),
  ArrowLeft: (at) => Math.max(0, at - 1),
  ArrowUp: (at) => Math.max(0, at - 1),
  Home: () => 0,
  End: (_, many) => many - 1,
};

/**
 * Points that would hide one another stand beside each other, around where they are.
 * @param {{x: number, y: number}[]} places
 */
export function sideBySide(places) {
  /** @type {number[][]} */
  const together = [];
  places.forEach(({ x, y }, i) => {
    const found = together.find(([first]) => Math.hypot(places[first].x - x, places[first].y - y) < CLOSE);
    if (found) found.push(i);
    else together.push([i]);
  });
  const moved = [...places];
  for (const group of together) {
    group.forEach((i, k) => {
      const x = places[i].x + APART * (k - (group.length - 1) / 2);
      moved[i] = { x, y: places[i].y };
    });
  }
  return moved;
}

/** One stop of the tab key for all points; arrows go from one to the next. */
export class Markers {
  /** @param {(words: string | null) => void} tell what the chosen point is */
  constructor(tell) {
    this.tell = tell;
    /** @type {PointMark[]} */
    this.points = [];
    /** @type {{x: number, y: number}[]} */
    this.places = [];
    this.chosen = 0;
    this.group = svg("g");
    this.hadFocus = false;
  }

  /** @param {PointMark[]} points @param {import("./marks.js").Box} box */
  draw(points, box) {
    this.hadFocus = this.group.contains(document.activeElement);
    this.points = points;
    this.chosen = Math.min(this.chosen, Math.max(0, points.length - 1));
    this.places = sideBySide(points.map((each) => ({ x: across(box, each.x), y: upright(box, each.y) })));
    this.group = svg("g", { class: "plot-markers" }, ...points.map((each, i) => this.#marker(each, i)));
    return this.group;
  }

  restoreFocus() {
    if (this.hadFocus) this.#focus(this.chosen);
  }

  /** What the point under the pointer is. @param {number} x @param {number} y */
  wordsNear(x, y) {
    const distances = this.places.map((each) => Math.hypot(each.x - x, each.y - y));
    const nearest = Math.min(...distances);
    return nearest < NEAR ? this.points[distances.indexOf(nearest)].words : null;
  }

  /** @param {PointMark} each @param {number} i */
  #marker(each, i) {
    const { x, y } = this.places[i];
    const marker = svg(
      "g",
      { role: "img", "aria-label": each.words, tabindex: i === this.chosen ? 0 : -1 },
      svg("circle", { cx: x, cy: y, r: 9, class: "plot-focus" }),
      point(each.shape, x, y, each.color),
    );
    marker.addEventListener("focus", () => this.tell(each.words));
    marker.addEventListener("blur", () => this.tell(null));
    marker.addEventListener("keydown", (event) => {
      const move = event instanceof KeyboardEvent ? MOVES[event.key] : undefined;
      if (!move) return;
      // These keys do other things on the rest of the page.
      event.preventDefault();
      event.stopPropagation();
      this.#focus(move(i, this.points.length));
    });
    return marker;
  }

  /** @param {number} i */
  #focus(i) {
    this.chosen = i;
    [...this.group.children].forEach((each, k) => {
      each.setAttribute("tabindex", k === i ? "0" : "-1");
      if (k === i && each instanceof SVGElement) each.focus();
    });
  }
}
