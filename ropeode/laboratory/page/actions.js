// @ts-check
// What a reader can do: each changes the scene.
import { MOST_STEPPERS, MOST_STEPS, rungs } from "./state.js";
/** @typedef {import("./state").State} State */

/**
 * Other steps per frame, which also become a point of the order plot.
 *
 * @param {State} state @param {number} steps
 */
export function setSteps(state, steps) {
  if (!Number.isInteger(steps) || steps < 1 || steps > MOST_STEPS) return;
  state.change({ steps, ladder: rungs([...state.now.ladder, steps]) });
}

/** @param {State} state @param {number} factor 2 or 1/2 */
export function scaleSteps(state, factor) {
  setSteps(state, Math.max(1, Math.round(state.now.steps * factor)));
}

/** Another problem, or other parameters: the order is found anew. @param {State} state @param {Partial<import("./state").Scene["problem"]>} changes */
export function setProblem(state, changes) {
  state.change({ problem: { ...state.now.problem, ...changes }, ladder: [state.now.steps] });
}

/** @param {State} state @param {string[]} steppers */
export function setSteppers(state, steppers) {
  const kept = [...new Set(steppers)].slice(0, MOST_STEPPERS);
  const hidden = state.now.hidden.map((i) => kept.indexOf(state.now.steppers[i])).filter((i) => i >= 0);
  state.change({ steppers: kept, hidden });
}

/** @param {State} state @param {number} index of the stepper to show or hide */
export function toggleStepper(state, index) {
  const { hidden, steppers } = state.now;
  if (index >= steppers.length) return;
  state.change({
    hidden: hidden.includes(index) ? hidden.filter((i) => i !== index) : [...hidden, index],
  });
}

/** @param {State} state @param {number} index @param {string} stepper that takes the place of the one there */
export function replaceStepper(state, index, stepper) {
  if (state.now.steppers.includes(stepper)) return;
  state.change({ steppers: state.now.steppers.map((each, i) => (i === index ? stepper : each)) });
}

/** Show one of the plots. @param {State} state @param {string} name */
export function showPlot(state, name) {
  const group = name === "order" || name === "stability" ? "steps" : "motion";
  state.change({ choices: { ...state.now.choices, [group]: name } });
}
