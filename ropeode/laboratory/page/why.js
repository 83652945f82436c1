// @ts-check
import { Controls } from "./controls.js";
import { rungs } from "./state.js";
import { button, choice, make } from "./dom.js";
import { named, parsed } from "./stepper_names.js";
import { askLibrary } from "./asks.js";
import { say } from "./words.js";

const VERLET = "stormer-verlet";
const LADDER = [4, 8, 16, 32, 64];

/** Two questions that every class asks, with the switches that answer them. */
export class Why extends Controls {
  #built = "";

  update() {
    const library = this.store.answer(askLibrary);
    const facts = library?.steppers.find(({ name }) => name === VERLET);
    const problem = library?.problems.find(({ name }) => name === this.state.now.problem.name);
    const options = this.#options();
    const key = JSON.stringify([!facts, problem?.name, options, document.documentElement.lang]);
    if (key === this.#built) return;
    this.#built = key;
    const open = [...this.element.querySelectorAll("details")].map((each) => each.open);
    const focused = document.activeElement?.id ?? "";
    const parts = [];
    if (facts && problem?.steppers.includes(VERLET)) {
      const switches = Object.entries(facts.options).map(([option, values]) =>
        choice(say(`why.${option}`), values.map((value) => ({ value, label: say(`why.${option}.${value}`) })),
          options?.[option] ?? values[0],
          (value) => this.#set({ ...options, [option]: value }), { id: `why-${option}` }));
      const at = Object.entries(facts.options).map(([option, values]) => options?.[option] ?? values[0]).join(".");
      parts.push(make("details", {}, make("summary", {}, say("why.verlet")),
        ...switches,
        make("p", { id: "why-sentence", "aria-live": "polite" }, options ? say(`why.verlet.${at}`) : say("why.verlet.choose")),
        make("p", {}, say("why.more", { page: "docs/explanation/verlet.md" }))));
    }
    if (problem?.steppers.includes("explicit-euler"))
      parts.push(make("details", {}, make("summary", {}, say("why.euler")),
        make("p", {}, say("why.euler.words")),
        button(say("why.euler.show"), () => this.#explode(), { id: "why-euler" }),
        make("p", {}, say("why.more", { page: "docs/explanation/stability.md" }))));
    this.element.replaceChildren(...(parts.length ? [make("h2", {}, say("why.title"))] : []), ...parts);
    [...this.element.querySelectorAll("details")].forEach((each, i) => (each.open = open[i] ?? false));
    if (focused.startsWith("why-")) document.getElementById(focused)?.focus();
  }

  /** @returns {{[name: string]: string} | null} options of the Verlet that is shown; null if none is */
  #options() {
    const known = this.store.answer(askLibrary)?.steppers ?? [];
    const found = this.state.now.steppers.map((each) => parsed(each, known)).find(({ name }) => name === VERLET);
    return found?.options ?? null;
  }

  /** Let the switches change the Verlet on the stage, with enough step sizes for an order. @param {{[name: string]: string}} options */
  #set(options) {
    const { steppers, ladder, steps, choices, hidden } = this.state.now;
    const known = this.store.answer(askLibrary)?.steppers ?? [];
    const next = named(VERLET, options, known);
    const at = steppers.findIndex((each) => parsed(each, known).name === VERLET);
    const index = at < 0 ? Math.min(steppers.length, 4) : at;
    this.state.change({
      steppers: [...steppers.slice(0, index), next, ...steppers.slice(index + 1)],
      hidden: hidden.filter((each) => each !== index),
      ladder: rungs([...LADDER, ...ladder, steps]),
      choices: { ...choices, steps: "order" },
    });
  }

  /** Explicit Euler alone, beside its stability region. */
  #explode() {
    const { choices, steppers } = this.state.now;
    const others = steppers.filter((each) => each !== "explicit-euler");
    this.state.change({
      steppers: ["explicit-euler", ...others].slice(0, 5),
      hidden: [],
      choices: { ...choices, steps: "stability", region: "0" },
      playing: true,
    });
  }
}
