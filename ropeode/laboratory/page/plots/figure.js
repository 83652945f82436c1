// A plot on the page: the picture, its legend with values, its sentences and its table.

import { axes, boxFor } from "./axes.js";
import { download } from "./download.js";
import { Markers } from "./markers.js";
import { across, drawn, swatch, upright } from "./marks.js";
import { html, spoken, svg } from "./svg.js";
import { table } from "./table.js";

/** @typedef {import("./chart.js").Chart} Chart */
/** @typedef {import("./marks.js").Box} Box */
/** @typedef {(key: string, values?: Record<string, string | number>) => string} Say */

// In pixels; two plots stand in the height of a laptop's window.
const [LOWEST, HIGHEST, OF_WINDOW] = [190, 280, 0.26];
const MORE_FOR_EQUAL = 50;
// A legend that changes with every frame cannot be read.
const READABLE = 120;
let number = 0;

export class Figure {
  /**
   * @param {Say} say words of the page's language
   * @param {(name: string, value: string) => void} choose called when a reader changes a choice
   */
  constructor(say, choose) {
    number += 1;
    this.say = say;
    this.choose = choose;
    /** @type {Chart | null} */
    this.chart = null;
    /** @type {Box | null} */
    this.box = null;
    /** @type {number | null} */
    this.time = null;
    /** @type {number | null} */
    this.hovered = null;
    this.lastWritten = 0;
    /** The timer of what is to be written. */
    this.later = 0;
    /** @type {{points: import("./chart.js").Moving[], box: Box | null}} */
    this.placed = { points: [], box: null };
    this.clip = `plot-clip-${number}`;
    this.title = html("h2");
    this.choices = html("div", { class: "plot-choices" });
    this.picture = html("div", { class: "plot-picture" });
    this.cursor = html("div", { class: "plot-cursor", hidden: "" });
    this.moving = html("div", { class: "plot-moving", "aria-hidden": "true" });
    this.readout = html("p", { class: "plot-readout" });
    this.legend = html("ul", { class: "plot-legend" });
    this.meanings = html("ul", { class: "plot-meanings" });
    this.notes = html("div", { class: "plot-notes" });
    this.table = table(say, () => this.chart?.table);
    this.markers = new Markers((words) => {
      this.readout.textContent = words ?? "";
    });
    this.element = html(
      "div",
      { class: "plot" },
      html("div", { class: "plot-head" }, this.title, this.choices),
      html("div", { class: "plot-area" }, this.picture, this.cursor, this.moving),
      this.readout,
      this.legend,
      this.meanings,
      this.notes,
      html("div", { class: "plot-foot" }, this.table.element, ...this.#downloads()),
    );
    this.picture.addEventListener("pointermove", (event) => this.#hover(event));
    this.picture.addEventListener("pointerleave", () => this.#leave());
    new ResizeObserver(() => this.#draw()).observe(this.picture);
  }

  /** @param {Chart | import("./chart.js").Missing} chart */
  show(chart) {
    if ("why" in chart) return this.#showNone(chart);
    this.chart = chart;
    this.element.classList.remove("plot-none");
    this.title.textContent = chart.title;
    this.title.hidden = false;
    this.legend.replaceChildren(...chart.legend.map(entry));
    this.meanings.replaceChildren(...(chart.meanings ?? []).map(entry));
    this.meanings.hidden = !chart.meanings?.length;
    this.notes.replaceChildren(...chart.notes.map((each) => html("p", {}, spoken(each))));
    this.#offer(chart.choices ?? []);
    this.table.refresh();
    this.#draw();
    return undefined;
  }

  /** Show a time of the motion. @param {number} time */
  follow(time) {
    this.time = time;
    if (this.hovered === null) this.#write(time, false);
    this.#move();
  }

  /** @param {import("./chart.js").Missing} missing */
  #showNone({ why, choices = [] }) {
    this.chart = null;
    this.element.classList.add("plot-none");
    this.title.hidden = true;
    for (const each of [this.picture, this.legend, this.meanings]) each.replaceChildren();
    this.notes.replaceChildren(html("p", {}, spoken(why)));
    this.#offer(choices);
    this.#move();
  }

  /** Selections stay in place, and keep the focus, while their values change. @param {import("./chart.js").Choice[]} choices */
  #offer(choices) {
    const wanted = JSON.stringify(choices.map(({ value: _, ...rest }) => rest));
    if (this.choices.dataset.offered !== wanted) {
      this.choices.dataset.offered = wanted;
      this.choices.replaceChildren(...choices.map((each) => this.#select(each)));
    }
    this.choices.querySelectorAll("select").forEach((select, i) => {
      select.value = choices[i].value;
    });
  }

  /** @param {import("./chart.js").Choice} choice */
  #select({ name, label, options }) {
    const all = options.map((each) => html("option", { value: each.value }, each.label));
    const select = html("select", {}, ...all);
    select.addEventListener("change", () => this.choose(name, select.value));
    return html("label", {}, `${label} `, select);
  }

  #downloads() {
    return ["svg", "png"].map((kind) => {
      const label = this.say("plots.download", { kind: kind.toUpperCase() });
      const button = html("button", { type: "button", "aria-label": label }, kind.toUpperCase());
      button.addEventListener("click", () => {
        const picture = this.picture.firstElementChild;
        if (picture instanceof SVGSVGElement && this.chart) download(picture, this.chart, kind);
      });
      return button;
    });
  }

  #draw() {
    const { width } = this.picture.getBoundingClientRect();
    if (!this.chart || width < 40) return;
    const { chart } = this;
    const usual = Math.min(HIGHEST, Math.max(LOWEST, OF_WINDOW * innerHeight));
    const height = chart.equal ? Math.min(usual + MORE_FOR_EQUAL, width) : usual;
    const box = boxFor(chart, width, height);
    this.box = box;
    const plain = chart.marks.filter((mark) => mark.kind !== "point" || mark.words === null);
    const chosen = chart.marks.filter((mark) => mark.kind === "point" && mark.words !== null);
    const clip = svg(
      "clipPath",
      { id: this.clip },
      svg("rect", { x: box.left, y: box.top, width: box.width, height: box.height }),
    );
    const picture = svg(
      "svg",
      {
        viewBox: `0 0 ${width} ${height}`,
        width,
        height,
        role: "group",
        "aria-label": chart.title,
        class: "plot-svg",
      },
      svg("defs", {}, clip),
      axes(chart, box),
      svg("g", { "clip-path": `url(#${this.clip})`, "aria-hidden": "true" },
        ...plain.map((mark) => drawn(mark, box))),
      this.markers.draw(/** @type {import("./chart.js").PointMark[]} */ (chosen), box),
    );
    this.picture.replaceChildren(picture);
    this.markers.restoreFocus();
    if (this.time !== null) this.#write(this.time, true);
    this.#move();
  }

  /** Where the picture plays: a line at the time, or points that move. */
  #move() {
    const { box, chart } = this;
    const time = this.hovered ?? this.time;
    this.cursor.hidden = !chart?.at || time === null;
    this.moving.hidden = !chart?.moving;
    if (!box || !chart) return;
    if (chart.at && time !== null) {
      const x = Math.min(box.left + box.width, Math.max(box.left, across(box, time)));
      this.cursor.style.transform = `translateX(${x.toFixed(1)}px)`;
      this.cursor.style.top = `${box.top}px`;
      this.cursor.style.height = `${box.height}px`;
    }
    this.#place(chart.moving && time !== null ? chart.moving(time) : [], box);
  }

  /** @param {import("./chart.js").Moving[]} points @param {Box} box */
  #place(points, box) {
    if (points === this.placed.points && box === this.placed.box) return;
    this.placed = { points, box };
    while (this.moving.childElementCount > points.length) this.moving.lastElementChild?.remove();
    while (this.moving.childElementCount < points.length) this.moving.append(html("i"));
    points.forEach(({ x, y, color, outside }, i) => {
      const dot = /** @type {HTMLElement} */ (this.moving.children[i]);
      const [right, up] = [box.x.at(x), box.y.at(y)];
      dot.hidden = !(right >= 0 && right <= 1 && up >= 0 && up <= 1);
      dot.style.transform = `translate(${across(box, x).toFixed(1)}px, ${upright(box, y).toFixed(1)}px)`;
      dot.style.background = outside ? "transparent" : color;
      dot.style.borderColor = outside ? color : "";
    });
  }

  /** The legend's values at a time. @param {number} time @param {boolean} now */
  #write(time, now) {
    if (!this.chart?.at) return;
    const since = performance.now();
    if (!now && since - this.lastWritten < READABLE) {
      // Where the picture stays, its last values are written as well.
      this.later ||= setTimeout(() => this.#write(this.hovered ?? this.time ?? time, true), READABLE);
      return;
    }
    clearTimeout(this.later);
    this.later = 0;
    this.lastWritten = since;
    const places = this.legend.querySelectorAll(".plot-value");
    this.chart.at(time).forEach((text, i) => {
      const place = places[i];
      if (place && place.textContent !== text) place.textContent = text;
    });
  }

  /** @param {PointerEvent} event */
  #hover(event) {
    const { box, chart } = this;
    if (!box || !chart) return;
    const { left, top } = this.picture.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    if (chart.at) {
      const place = (x - box.left) / box.width;
      if (place < 0 || place > 1) return this.#leave();
      this.hovered = box.x.value(place);
      this.#write(this.hovered, true);
      this.#move();
    } else {
      this.readout.textContent = this.markers.wordsNear(x, y) ?? "";
    }
  }

  #leave() {
    this.hovered = null;
    if (this.chart?.at && this.time !== null) this.#write(this.time, true);
    else this.readout.textContent = "";
    this.#move();
  }
}

/** @param {import("./chart.js").Entry} each */
function entry(each) {
  const sample = svg("svg", { viewBox: "0 0 30 14", width: 30, height: 14, "aria-hidden": "true" });
  sample.append(swatch(each));
  const more = html("span", { class: "plot-more" }, ...(each.more ?? []).map(spoken));
  return html(
    "li",
    {},
    sample,
    html("span", { class: "plot-name" }, each.text, " ", more),
    html("span", { class: "plot-value" }),
  );
}
