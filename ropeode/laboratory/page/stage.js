// @ts-check
// The stage: the reference and the runs at the time of the clock.
import { palette } from "./colours.js";
import { drawFigure, drawLeaving, drawLegend, drawScale, placed, placing } from "./drawing.js";
import { boxAt, extentOf, farthest, home, padded, union } from "./extent.js";
import { Motion } from "./motion.js";
import { shortly } from "./numbers.js";
import { canvasPen, svgPen } from "./pens.js";
import { say } from "./words.js";
/** @typedef {import("./shown").Showing} Showing */
/** @typedef {import("./shown").Shown} Shown */
/** @typedef {import("./extent").Box} Box */
/** @typedef {import("./extent").Extent} Extent */
/** @typedef {import("./drawing").Frame} Frame */
/** @typedef {import("./pens").Pen} Pen */
/** @typedef {Shown & {motion: Motion, extent: Extent}} Actor */

// Pixels within which a click finds a node.
const REACH = 28;
// Samples between the points of a trail, of a motion of one point and at most.
const [FINEST, COARSEST] = [1 / 16, 1 / 4];

export class Stage {
  /** @type {Actor[]} */
  #actors = [];
  /** @type {Motion | null} */
  #reference = null;
  /** @type {Box} */
  #home = { x0: 0, x1: 1, y0: 0, y1: 1 };
  #place = 0;
  #width = 1;
  #marked = false;
  #height = 1;
  /** @type {{points: unknown, magnified: number}} */
  #built = { points: null, magnified: 1 };

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Showing} showing
   * @param {(node: number | null) => void} choose called with the node that was clicked
   */
  constructor(canvas, showing, choose) {
    this.canvas = canvas;
    this.showing = showing;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
    new ResizeObserver(() => this.#resize()).observe(canvas);
    canvas.addEventListener("click", (event) => {
      const node = this.#nodeAt(event.offsetX, event.offsetY);
      if (node !== undefined) choose(node);
    });
    this.#resize();
  }

  #resize() {
    const ratio = devicePixelRatio || 1;
    this.#width = this.canvas.clientWidth || 1;
    this.#height = this.canvas.clientHeight || 1;
    this.canvas.width = Math.round(ratio * this.#width);
    this.canvas.height = Math.round(ratio * this.#height);
    this.draw(this.#place);
  }

  /** Whether both axes have one scale. */
  get #square() {
    return this.showing.truth?.drawing !== "phase";
  }

  /** Take what is to be drawn from the answers. */
  update() {
    const { truth, scene, shown } = this.showing;
    if (!truth || !scene) return;
    const { magnified } = scene;
    const { points } = truth.arrays;
    if (this.#built.points !== points || this.#built.magnified !== magnified) {
      this.#reference = new Motion(truth, null, 1);
      this.#home = home(this.#reference);
      this.#actors = [];
      this.#built = { points, magnified };
    }
    const limit = farthest(this.#home, this.#square);
    this.#actors = shown.flatMap((each) => {
      if (!each.run) return [];
      const old = this.#actors.find((actor) => actor.run?.arrays.differences === each.run?.arrays.differences);
      if (old) return [{ ...old, ...each }];
      const motion = new Motion(truth, each.run, magnified);
      return [{ ...each, motion, extent: extentOf(motion, truth.samples_per_frame, this.#home, limit) }];
    });
    const names = this.#actors.map((each) => this.nameOf(each)).join(", ");
    this.canvas.setAttribute("aria-label", say("stage.picture", { problem: truth.words, names }));
    this.draw(this.#place);
  }

  /** @param {number} place counted in samples of the reference */
  draw(place) {
    this.#place = place;
    const ratio = this.canvas.width / this.#width;
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.context.globalAlpha = 1;
    this.context.fillStyle = palette().ground;
    this.context.fillRect(0, 0, this.#width, this.#height);
    this.#drawWith(canvasPen(this.context), this.#width, this.#height);
  }

  /** Note when there was something to see, for those who measure. */
  #mark() {
    if (this.#actors.length && !this.#marked) performance.mark("first picture");
    this.#marked ||= this.#actors.length > 0;
  }

  /** @returns {string} the picture as an SVG file */
  svg() {
    const { pen, text } = svgPen(this.#width, this.#height, palette().ground);
    this.#drawWith(pen, this.#width, this.#height);
    return text();
  }

  /** @returns {Promise<Blob>} the picture as a PNG file */
  png() {
    return new Promise((done) => this.canvas.toBlob((blob) => done(/** @type {Blob} */ (blob))));
  }

  /** @param {Pen} pen @param {number} width @param {number} height */
  #drawWith(pen, width, height) {
    const { truth } = this.showing;
    if (!truth || !this.#reference) return;
    this.#mark();
    const box = this.#view();
    for (const { frame, actors } of this.#frames(width, height)) {
      const inner = inside(frame, actors.length);
      const scale = placing(box, inner, this.#square);
      pen.within(frame.x, frame.y, frame.width, frame.height, () => {
        const all = fitting(box, inner, frame, scale, this.#square);
        drawScale(pen, truth, all, frame, scale);
        this.#drawFigures(pen, scale.place, actors, frame);
        for (const { extent, colour } of actors) {
          const gone = extent.leaving.filter(({ sample }) => sample <= this.#place);
          drawLeaving(pen, scale.place, gone, colour, frame);
        }
        this.#drawWords(pen, frame, actors);
      });
    }
  }

  /** @returns {Box} what is shown at this time */
  #view() {
    const box = this.#actors.reduce((sum, { extent }) => union(sum, boxAt(extent, this.#place)), this.#home);
    return padded(box, this.#square);
  }

  /** @param {Pen} pen @param {import("./drawing").Place} place @param {Actor[]} actors @param {Frame} frame */
  #drawFigures(pen, place, actors, frame) {
    const { truth } = this.showing;
    if (!truth || !this.#reference) return;
    const point = this.#chosenPoint();
    const figures = [
      { motion: this.#reference, colour: palette().reference, dash: [], reference: true },
      ...actors.map((actor) => ({ ...actor, reference: false })),
    ];
    for (const { motion, colour, dash, reference } of figures) {
      const trail = this.#trail(motion, point);
      const points = motion.at(this.#place) ?? [];
      drawFigure(pen, truth, { points, trail, colour, dash, reference }, place, point, frame);
    }
  }

  /**
   * The way so far: of all that moves on an orbit or in a phase plane, else of the chosen point.
   *
   * @param {Motion} motion @param {number | null} chosen point
   * @returns {number[]}
   */
  #trail(motion, chosen) {
    const { truth } = this.showing;
    if (!truth) return [];
    const free = motion.width / 2 - truth.fixed.length;
    const alone = truth.drawing !== "rope" && free === 1;
    const point = chosen ?? (alone ? truth.nodes.findIndex((_, i) => !truth.fixed.includes(i)) : null);
    if (point === null) return [];
    const whole = motion === this.#reference && alone && truth.drawing !== "pendulum";
    const end = whole ? motion.last : Math.min(this.#place, motion.last);
    /** @type {number[]} */
    const xy = [];
    const fine = Math.min(COARSEST, (FINEST * motion.width) / 2);
    for (let place = 0; ; place += fine) {
      const points = motion.at(Math.min(place, end));
      if (points) xy.push(points[2 * point], points[2 * point + 1]);
      if (place >= end) return xy;
    }
  }

  /** @returns {number | null} the point of the chosen node */
  #chosenPoint() {
    const { truth, scene } = this.showing;
    if (!truth || scene?.node == null) return null;
    const point = truth.nodes.indexOf(scene.node);
    return point < 0 ? null : point;
  }

  /** @param {Pen} pen @param {Frame} frame @param {Actor[]} actors */
  #drawWords(pen, frame, actors) {
    const { truth, scene } = this.showing;
    if (!truth || !scene) return;
    const { reference: colour, ink, ground } = palette();
    drawLegend(pen, frame, [
      { name: say("stage.reference"), colour, dash: [], reference: true },
      ...actors.map((each) => ({ ...each, name: this.nameOf(each), reference: false })),
    ]);
    const time = say("stage.frame", { frame: (this.#place / truth.samples_per_frame).toFixed(1) });
    const y = frame.y + frame.height - 14;
    pen.text(time, frame.x + 12, y, { colour: ink, size: 13, halo: ground });
    if (scene.magnified !== 1) {
      const text = say("stage.magnified", { times: shortly(scene.magnified) });
      pen.text(text, frame.x + 12, y - 19, { colour: ink, size: 14, halo: ground });
    }
  }

  /** A run as the legend names it. @param {Shown} shown @returns {string} */
  nameOf({ name, run }) {
    if (!run) return name;
    const steps = run.steps_per_frame;
    const full = steps === null ? name : say("stage.run", { name, steps });
    const last = this.#lastOf(run);
    return this.#place > last && run.status !== "ok"
      ? say("stage.gone", { run: full, frame: this.#frameOf(last) }) : full;
  }

  /** @param {import("./wire").Answered<import("./messages").Run>} run */
  #lastOf(run) {
    return Math.max(0, run.arrays.differences.shape[0] - 1) * run.every;
  }

  /** @param {number} sample */
  #frameOf(sample) {
    return shortly(sample / (this.showing.truth?.samples_per_frame ?? 1), 4);
  }

  /** What is to be said of the picture besides. @returns {string[]} */
  notes() {
    const { truth, scene } = this.showing;
    if (!truth || !scene) return [];
    const notes = [];
    if (scene.magnified !== 1) notes.push(say("note.magnified", { times: shortly(scene.magnified) }));
    for (const actor of this.#actors) {
      const { name, run, extent } = actor;
      const left = extent.leaving.filter(({ sample }) => sample <= this.#place);
      if (left.length)
        notes.push(say("note.left", {
          name, count: left.length, all: truth.nodes.length - truth.fixed.length, frame: this.#frameOf(Math.min(...left.map(({ sample }) => sample))),
        }));
      if (run && this.#lastOf(run) < (this.#reference?.last ?? 0) && this.#place > this.#lastOf(run))
        notes.push(say(run.status === "unsolved" ? "note.unsolved" : "note.diverged", { name, frame: this.#frameOf(this.#lastOf(run)) }));
    }
    if (truth.horizon !== null && this.#place >= truth.trusted)
      notes.push(say("note.horizon", { time: shortly(truth.horizon, 3), unit: truth.time_unit }));
    return notes;
  }

  /** @param {number} width @param {number} height @returns {{frame: Frame, actors: Actor[]}[]} */
  #frames(width, height) {
    const whole = { x: 0, y: 0, width, height };
    const count = this.#actors.length;
    if (this.showing.scene?.layout !== "beside" || count < 2) return [{ frame: whole, actors: this.#actors }];
    const columns = Math.min(count, Math.max(1, Math.round(Math.sqrt((count * width) / height / 1.3))));
    const rows = Math.ceil(count / columns);
    return this.#actors.map((actor, i) => ({
      frame: {
        x: ((i % columns) * width) / columns, y: (Math.floor(i / columns) * height) / rows,
        width: width / columns, height: height / rows,
      },
      actors: [actor],
    }));
  }

  /** @param {number} x @param {number} y in pixels @returns {number | null | undefined} null: none is near */
  #nodeAt(x, y) {
    const { truth } = this.showing;
    if (!truth || !this.#reference) return undefined;
    let nearest = { far: REACH, node: /** @type {number | null} */ (null) };
    for (const { frame, actors } of this.#frames(this.#width, this.#height)) {
      if (x < frame.x || y < frame.y || x > frame.x + frame.width || y > frame.y + frame.height) continue;
      const { place } = placing(this.#view(), inside(frame, actors.length), this.#square);
      for (const motion of [this.#reference, ...actors.map((each) => each.motion)]) {
        const points = motion.at(this.#place);
        if (!points) continue;
        const pixels = placed(place, points);
        truth.nodes.forEach((node, i) => {
          const far = Math.hypot(pixels[2 * i] - x, pixels[2 * i + 1] - y);
          if (node !== null && far < nearest.far) nearest = { far, node };
        });
      }
    }
    return nearest.node;
  }
}

/** The part of a frame below its legend. @param {Frame} frame @param {number} actors @returns {Frame} */
function inside(frame, actors) {
  const top = Math.min(19 * (actors + 1) + 12, frame.height / 3);
  return { x: frame.x + 8, y: frame.y + top, width: frame.width - 16, height: frame.height - top - 28 };
}

/** All that a frame shows around a box. @param {Box} box @param {Frame} inner @param {Frame} frame @param {{sx: number, sy: number}} scale @param {boolean} square @returns {Box} */
function fitting(box, inner, frame, { sx, sy }, square) {
  if (square) return box;
  return {
    x0: box.x0 - (inner.x - frame.x) / sx,
    x1: box.x1 + (frame.x + frame.width - inner.x - inner.width) / sx,
    y0: box.y0 - (frame.y + frame.height - inner.y - inner.height) / sy,
    y1: box.y1 + (inner.y - frame.y) / sy,
  };
}
