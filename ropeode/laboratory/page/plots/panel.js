// All plots: those along the motion, and those over step sizes, each group behind tabs.

import { energyChart } from "./energy.js";
import { errorChart } from "./error.js";
import { Figure } from "./figure.js";
import { orderChart } from "./order.js";
import { phaseChart } from "./phase.js";
import { stabilityChart } from "./stability.js";
import { html } from "./svg.js";
import { Tabs } from "./tabs.js";

/** @typedef {import("./view.js").View} View */

const CHARTS = {
  error: errorChart,
  energy: energyChart,
  phase: phaseChart,
  order: orderChart,
  stability: stabilityChart,
};
/** @type {{motion: View["choices"]["motion"][], steps: View["choices"]["steps"][]}} */
const GROUPS = { motion: ["error", "energy", "phase"], steps: ["order", "stability"] };
/** @type {("motion" | "steps")[]} */
const NAMES = ["motion", "steps"];
// Milliseconds in which the eigenvalues move to where another step size puts them.
const MOVING = 300;

export class Panel {
  /**
   * @param {import("./figure.js").Say} say
   * @param {(name: string, value: string) => void} choose called when a reader changes a choice
   */
  constructor(say, choose) {
    this.groups = NAMES.map((group) => {
      const figure = new Figure(say, choose);
      const labels = GROUPS[group].map((name) => ({ name, label: say(`plots.tab.${name}`) }));
      const tabs = new Tabs(say(`plots.group.${group}`), labels, figure.element, (name) =>
        choose(group, name),
      );
      return { group, figure, tabs, element: tabs.element };
    });
    this.element = html("div", { class: "plots" }, ...this.groups.map(({ element }) => element));
    /** The step size for which the eigenvalues are drawn. @type {number | null} */
    this.drawnDt = null;
    this.animation = 0;
  }

  /** @param {View} view */
  show(view) {
    cancelAnimationFrame(this.animation);
    for (const { group, figure, tabs } of this.groups) {
      const name = view.choices[group];
      tabs.select(name);
      if (name === "stability") this.#move(figure, view, this.drawnDt ?? view.dt);
      else figure.show(CHARTS[name](view));
    }
    this.drawnDt = view.dt;
  }

  /** Show a time of the motion. @param {number} time */
  follow(time) {
    for (const { figure } of this.groups) figure.follow(time);
  }

  /** @param {Figure} figure @param {View} view @param {number} from the step size before */
  #move(figure, view, from) {
    const start = performance.now();
    const still = from === view.dt || matchMedia("(prefers-reduced-motion: reduce)").matches;
    const turn = () => {
      const part = still ? 1 : Math.min(1, (performance.now() - start) / MOVING);
      const dt = part === 1 ? view.dt : from * (view.dt / from) ** part;
      figure.show(stabilityChart({ ...view, dt }));
      if (part < 1) this.animation = requestAnimationFrame(turn);
    };
    turn();
  }
}
