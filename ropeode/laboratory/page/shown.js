// @ts-check
import { askGrade, askOrder, askPhase, askRun, askStability, askTheory, askTruth } from "./asks.js";
import { style } from "./colours.js";
import { called, say } from "./words.js";
/** @typedef {import("./messages").Run} Run */
/** @typedef {import("./messages").Truth} Truth */
/** @typedef {import("./state").Scene} Scene */
/** @typedef {import("./store").Store} Store */
/**
 * A run beside the reference: of a stepper, or from a file.
 *
 * @typedef {object} Shown
 * @property {string} name
 * @property {string} colour
 * @property {number[]} dash
 * @property {boolean} late whether it is that of an earlier number of steps
 * @property {import("./wire").Answered<Run> | undefined} run
 */

/**
 * What is drawn: the newest of what has been answered. While Python computes, the last picture
 * stays.
 */
export class Showing {
  /** @type {Map<string, ReturnType<typeof askRun>>} the last answered run of each stepper */
  #last = new Map();
  /** @type {Scene | null} with the last problem that has an answer */
  scene = null;
  /** With its fixed words in the language of the page. @type {import("./wire").Answered<Truth> | undefined} */
  truth = undefined;
  /** @type {Shown[]} */
  shown = [];

  /** @param {Scene} scene @param {Store} store */
  update(scene, store) {
    if (store.answer(askTruth(scene))) {
      if (this.scene?.problem !== scene.problem) this.#last.clear();
      this.scene = scene;
    } else if (this.scene) this.scene = { ...scene, problem: this.scene.problem };
    if (!this.scene) return;
    const truth = store.answer(askTruth(this.scene));
    this.truth = truth && {
      ...truth, norm: called("norm", truth.norm), time_unit: called("unit", truth.time_unit), energy_unit: called("unit", truth.energy_unit),
    };
    this.shown = [...this.#steppers(this.scene, store), ...this.#files(this.scene, store)];
  }

  /** @param {Scene} scene @param {Store} store @returns {Shown[]} */
  #steppers(scene, store) {
    return scene.steppers.flatMap((name, index) => {
      if (scene.hidden.includes(index)) return [];
      const ask = askRun(scene, name, scene.steps);
      let run = store.answer(ask);
      const late = !run && !store.refusal(ask);
      if (run) this.#last.set(name, ask);
      else if (late) {
        const last = this.#last.get(name);
        run = last && store.answer(last);
      }
      return [{ name, ...style(index), late, run }];
    });
  }

  /** @param {Scene} scene @param {Store} store @returns {Shown[]} */
  #files(scene, store) {
    if (!scene.files.length) return [];
    const graded = store.answer(askGrade(scene));
    return (graded?.runs ?? []).map((run, number) => {
      const begin = `${number}.`;
      const arrays = Object.fromEntries(
        Object.entries(graded?.arrays ?? {})
          .filter(([name]) => name.startsWith(begin))
          .map(([name, each]) => [name.slice(begin.length), each]),
      );
      return {
        name: run.stepper, ...style(scene.steppers.length + number), late: false, run: { ...run, arrays },
      };
    });
  }

  /** What the plots show. @param {Store} store @returns {import("./plots/view").View | null} */
  view(store) {
    const { scene, truth } = this;
    if (!scene || !truth) return null;
    const truthPhase = askPhase(scene, null, scene.steps);
    return {
      say,
      truth,
      truthPhase: store.answer(truthPhase) ?? null,
      absentPhase: absent(store, truthPhase, "plots.phase.lacking"),
      shown: this.shown.map(({ name, colour, dash, run }) => ({
        name,
        color: colour,
        dash: dash.join(" "),
        run: run ?? null,
        ladder: scene.ladder.flatMap((steps) => store.answer(askRun(scene, name, steps)) ?? []),
        order: store.answer(askOrder(scene, name)) ?? null,
        theory: store.answer(askTheory(scene, name)) ?? null,
        phase: store.answer(askPhase(scene, name, scene.steps)) ?? null,
        stability: store.answer(askStability(scene, name)) ?? null,
        absent: {
          run: absent(store, askRun(scene, name, scene.steps)),
          order: absent(store, askOrder(scene, name)),
          phase: absent(store, askPhase(scene, name, scene.steps)),
          stability: absent(store, askStability(scene, name)),
        },
      })),
      node: scene.node,
      dt: truth.frame / scene.steps,
      choices: scene.choices,
    };
  }
}

/**
 * What is said in the place of an answer.
 *
 * @param {Store} store
 * @param {import("./messages").Ask} ask
 * @param {string} lacking the key of the text for a page that has nobody to ask
 * @returns {import("./plots/chart").Words}
 */
function absent(store, ask, lacking = "plots.lacking") {
  const refusal = store.refusal(ask);
  if (refusal) return { english: refusal.message };
  // Where one question has nobody to answer it, none has.
  return say(store.lacking.length ? lacking : "plots.waiting");
}
