// @ts-check
// One key for each thing that a class does again and again.
import { scaleSteps, toggleStepper } from "./actions.js";
/** @typedef {import("./state").State} State */
/** @typedef {import("./clock").Clock} Clock */

/** The keys as the help shows them; each text is `key.` and the name. */
export const KEYS = [
  { keys: ["="], name: "halve" },
  { keys: ["-"], name: "double" },
  { keys: ["Space"], name: "play" },
  { keys: ["←", "→"], name: "step" },
  { keys: ["↑", "↓"], name: "speed" },
  { keys: ["1", "–", "5"], name: "show" },
  { keys: ["r"], name: "restart" },
  { keys: ["?"], name: "help" },
];

export const SPEEDS = [0.5, 1, 2, 4, 8, 16, 32];

/**
 * Listen to the keyboard. A key that the focused element has a use for is left to it.
 *
 * @param {State} state @param {Clock} clock @param {() => number} samplesPerFrame @param {() => void} help
 */
export function useKeys(state, clock, samplesPerFrame, help) {
  /** @param {number} direction */
  function step(direction) {
    const n = samplesPerFrame();
    clock.seek((Math.round(clock.time * n) + direction) / n);
  }
  /** @param {number} direction */
  function speed(direction) {
    const at = SPEEDS.findIndex((each) => each >= state.now.speed);
    state.change({ speed: SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at + direction))] });
  }
  /** @type {{[key: string]: () => void}} */
  const acts = {
    "=": () => scaleSteps(state, 2),
    "+": () => scaleSteps(state, 2),
    "-": () => scaleSteps(state, 0.5),
    " ": () => clock.toggle(),
    ArrowRight: () => step(1),
    ArrowLeft: () => step(-1),
    ArrowUp: () => speed(1),
    ArrowDown: () => speed(-1),
    r: () => clock.restart(),
    "?": help,
  };
  for (let i = 1; i <= 5; i++) acts[String(i)] = () => toggleStepper(state, i - 1);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const act = acts[event.key] ?? acts[event.key.toLowerCase()];
    if (!act || document.querySelector("dialog[open]") || isTaken(event)) return;
    event.preventDefault();
    act();
  });
}

/** Whether the element with the focus uses the key itself. @param {KeyboardEvent} event */
function isTaken({ target, key }) {
  if (!(target instanceof HTMLElement)) return false;
  const typed = target.matches("input:not([type=range], [type=checkbox], [type=radio]), textarea");
  if (typed) return true;
  if (key === " ") return target.matches("button, summary, a, select, input, [role=tab]");
  if (key.startsWith("Arrow")) return target.matches("select, input, [role=tab], [tabindex]:not(canvas)");
  return target.matches("select") && key.length === 1 && /[a-z0-9]/.test(key);
}
