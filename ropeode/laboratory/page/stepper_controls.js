// @ts-check
import { askLibrary, askRun } from "./asks.js";
import { replaceStepper, setSteppers, toggleStepper } from "./actions.js";
import { style } from "./colours.js";
import { Controls } from "./controls.js";
import { button, make } from "./dom.js";
import { MOST_STEPPERS } from "./state.js";
import { named, parsed } from "./stepper_names.js";
import { say } from "./words.js";
/** @typedef {import("./messages").StepperFacts} StepperFacts */

const FAMILIES = [
  "Runge-Kutta", "symplectic", "multistep", "implicit", "graphics", "rigid links", "diffrax", "SciPy",
];

/** Up to five steppers with their options. */
export class StepperControls extends Controls {
  #built = "";

  update() {
    const { steppers, hidden, problem } = this.state.now;
    const library = this.store.answer(askLibrary);
    const faults = steppers.map((each) => this.store.refusal(askRun(this.state.now, each, this.state.now.steps))?.message ?? "");
    const key = JSON.stringify([steppers, hidden, faults, problem.name, library?.own, !library, document.documentElement.lang, style(0).colour]);
    if (key === this.#built) return;
    this.#built = key;
    const focused = document.activeElement instanceof HTMLElement && this.element.contains(document.activeElement)
      ? document.activeElement.id : "";
    this.element.replaceChildren(
      make("h2", {}, say("steppers.title")),
      make("ol", { class: "steppers" }, ...steppers.map((each, i) => this.#item(each, i, faults[i]))),
      ...(steppers.length < MOST_STEPPERS ? [this.#adder()] : []),
    );
    if (focused) document.getElementById(focused)?.focus();
  }

  /** Names that can run on the problem, by family. */
  #families() {
    const library = this.store.answer(askLibrary);
    const facts = library?.problems.find(({ name }) => name === this.state.now.problem.name);
    const able = (library?.steppers ?? []).filter(({ name }) => facts?.steppers.includes(name));
    /** @type {Map<string, string[]>} */
    const groups = new Map();
    const own = (library?.own ?? []).filter(({ version }) => version).map(({ name }) => name);
    if (own.length) groups.set(say("steppers.own"), own);
    const order = [...FAMILIES, ...able.map(({ family }) => family)];
    for (const family of new Set(order)) {
      const names = able.filter((each) => each.family === family).map(({ name }) => name);
      if (names.length) groups.set(say(`family.${family}`), names);
    }
    return groups;
  }

  /** @param {string} id @param {string} label @param {string} value @param {(value: string) => void} choose @param {string} [first] */
  #select(id, label, value, choose, first) {
    const select = make("select", { id, "aria-label": label });
    if (first) select.append(make("option", { value: "" }, first));
    const groups = this.#families();
    if (value && ![...groups.values()].flat().includes(value)) select.append(make("option", { value }, value));
    for (const [family, names] of groups)
      select.append(make("optgroup", { label: family }, ...names.map((name) => make("option", { value: name }, name))));
    select.value = value;
    select.addEventListener("change", () => {
      const chosen = select.value;
      // Until the scene says so: a stepper that is there already is not chosen again.
      select.value = value;
      choose(chosen);
    });
    return select;
  }

  /** @param {string} stepper @param {number} index @param {string} fault */
  #item(stepper, index, fault) {
    const known = this.store.answer(askLibrary)?.steppers ?? [];
    const { name, options } = parsed(stepper, known);
    const facts = known.find((each) => each.name === name);
    const number = index + 1;
    const { colour, dash } = style(index);
    const shown = make("input", {
      type: "checkbox", id: `shown-${index}`, "aria-label": say("steppers.show", { name: stepper }),
      checked: !this.state.now.hidden.includes(index), title: say("steppers.show_key", { number }),
    });
    shown.addEventListener("change", () => toggleStepper(this.state, index));
    const chosen = Object.entries(facts?.options ?? {}).map(([option, values]) => this.#option(index, name, options, option, values));
    return make("li", {},
      make("div", { class: "row" }, shown, sample(colour, dash),
        this.#select(`stepper-${index}`, say("steppers.number", { number }), name, (value) => replaceStepper(this.state, index, value)),
        button("×", () => setSteppers(this.state, this.state.now.steppers.filter((_, i) => i !== index)), {
          class: "remove", id: `remove-${index}`, "aria-label": say("steppers.remove", { name: stepper }),
        })),
      ...(chosen.length ? [make("div", { class: "options" }, ...chosen)] : []),
      ...(fault ? [make("p", { class: "fault", role: "alert", lang: "en" }, fault)] : []),
    );
  }

  /** @param {number} index @param {string} name @param {{[name: string]: string}} options @param {string} option @param {string[]} values */
  #option(index, name, options, option, values) {
    const known = this.store.answer(askLibrary)?.steppers ?? [];
    const id = `option-${index}-${option}`;
    const value = options[option] ?? values[0];
    // One value: the default of a number.
    const input = values.length === 1
      ? make("input", { type: "text", inputmode: "numeric", size: 4, id, value })
      : make("select", { id }, ...values.map((each) => make("option", { value: each, selected: each === value }, each)));
    input.addEventListener("change", () =>
      replaceStepper(this.state, index, named(name, { ...options, [option]: input.value }, known)));
    return make("label", { class: "choice" }, make("span", {}, option.replaceAll("_", " ")), input);
  }

  #adder() {
    const add = say("steppers.add");
    return this.#select("stepper-add", add, "", (value) => {
      if (value) setSteppers(this.state, [...this.state.now.steppers, value]);
    }, add);
  }
}

/** A piece of the stepper's line. @param {string} colour @param {number[]} dash */
function sample(colour, dash) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("class", "sample");
  svg.setAttribute("viewBox", "0 0 30 12");
  svg.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  const attributes = { x1: "0", x2: "30", y1: "6", y2: "6", stroke: colour, "stroke-width": "3", "stroke-dasharray": dash.join(" ") };
  for (const [name, value] of Object.entries(attributes)) line.setAttribute(name, value);
  svg.append(line);
  return svg;
}
