// @ts-check
import { askLibrary, askTruth } from "./asks.js";
import { setProblem } from "./actions.js";
import { Controls } from "./controls.js";
import { choice, make } from "./dom.js";
import { called, say } from "./words.js";
/** @typedef {import("./messages").ParameterFacts} ParameterFacts */
/** @typedef {import("./messages").ProblemFacts} ProblemFacts */
/** @typedef {{update: (value: unknown, refusal: string) => void, element: HTMLElement}} Field */

/** The problem, its parameters and its number of frames. */
export class ProblemControls extends Controls {
  /** @type {Map<string, Field>} */
  #fields = new Map();
  #built = "";

  update() {
    const { problem } = this.state.now;
    const problems = this.store.answer(askLibrary)?.problems ?? [];
    const facts = problems.find(({ name }) => name === problem.name);
    const key = `${problem.name} ${problems.length} ${document.documentElement.lang}`;
    if (key !== this.#built) this.#build(problems, facts);
    this.#built = key;
    const message = this.store.refusal(askTruth(this.state.now))?.message ?? "";
    const lines = message.split("\n").filter(Boolean);
    for (const [name, field] of this.#fields) {
      const own = lines.filter((line) => line.startsWith(name));
      const value = name === "frames" ? problem.frames
        : problem.parameters[name] ?? facts?.parameters.find((each) => each.name === name)?.default;
      field.update(value, own.join(" "));
    }
    const others = lines.filter((line) => ![...this.#fields.keys()].some((name) => line.startsWith(name)));
    this.fault.textContent = others.join(" ");
    this.fault.hidden = !others.length;
  }

  fault = make("p", { class: "fault", role: "alert", lang: "en" });

  /** @param {ProblemFacts[]} problems @param {ProblemFacts | undefined} facts */
  #build(problems, facts) {
    const options = problems.map(({ name }) => ({ value: name, label: called("problem", name) }));
    const { name } = this.state.now.problem;
    const chosen = choice(say("problem.title"), options, name, (value) => this.#choose(value), { id: "problem", "aria-label": say("problem.title") });
    this.#fields.clear();
    for (const each of facts?.parameters ?? []) this.#fields.set(each.name, this.#field(each));
    if (facts)
      this.#fields.set("frames", this.#field({
        name: "frames", default: facts.frames, allowed: "", whole: true, low: 1, high: Math.min(200, facts.most_frames),
        logarithmic: false, unit: "", words: say("parameter.frames"),
      }));
    this.element.replaceChildren(
      make("h2", {}, say("problem.title")), chosen, this.fault,
      ...[...this.#fields.values()].map(({ element }) => element),
    );
  }

  /** @param {string} name */
  #choose(name) {
    const facts = this.store.answer(askLibrary)?.problems.find((each) => each.name === name);
    if (!facts) return;
    const { steppers } = this.state.now;
    const able = steppers.filter((each) =>
      facts.steppers.includes(each) || facts.steppers.includes(each.split(":")[0]) || this.state.now.versions[each]);
    const kept = able.length === steppers.length ? steppers : [...new Set([...able, ...facts.default_steppers])].slice(0, 5);
    this.state.change({
      problem: { name, parameters: {}, frames: facts.frames },
      steppers: kept, hidden: [], node: null, time: 0, ladder: [this.state.now.steps],
    });
  }

  /** @param {ParameterFacts} facts @returns {Field} */
  #field(facts) {
    const { name, low, high, logarithmic, whole } = facts;
    const id = `parameter-${name}`;
    const text = make("input", { type: "text", id, size: 8, "aria-describedby": `${id}-fault`, autocomplete: "off" });
    const fault = make("span", { id: `${id}-fault`, class: "fault", role: "alert", lang: "en" });
    const words = say(`parameter.${name}`);
    const label = make("label", { for: id, title: `${facts.words}${facts.allowed ? `: ${facts.allowed}` : ""}` },
      words, facts.unit ? make("small", {}, ` ${called("unit", facts.unit)}`) : "");
    const slider = low !== null && high !== null
      ? make("input", { type: "range", min: logarithmic ? Math.log10(low) : low, max: logarithmic ? Math.log10(high) : high, step: whole ? 1 : "any", "aria-label": words })
      : null;
    text.addEventListener("change", () => this.#set(facts, read(text.value)));
    slider?.addEventListener("input", () => {
      const value = logarithmic ? 10 ** Number(slider.value) : Number(slider.value);
      text.value = String(Number(value.toPrecision(3)));
    });
    slider?.addEventListener("change", () => this.#set(facts, Number(text.value)));
    return {
      element: make("div", { class: slider ? "field slides" : "field" }, label, slider ?? "", text, fault),
      update(value, refusal) {
        if (document.activeElement !== text) text.value = written(value);
        if (slider && document.activeElement !== slider && typeof value === "number")
          slider.value = String(logarithmic ? Math.log10(value) : value);
        slider?.setAttribute("aria-valuetext", written(value));
        if (fault.textContent !== refusal) fault.textContent = refusal;
        text.setAttribute("aria-invalid", String(refusal !== ""));
      },
    };
  }

  /** @param {ParameterFacts} facts @param {unknown} value */
  #set({ name, default: usual }, value) {
    if (name === "frames") {
      if (Number.isInteger(value)) setProblem(this.state, { frames: /** @type {number} */ (value) });
      return;
    }
    const { [name]: _, ...others } = this.state.now.problem.parameters;
    const same = JSON.stringify(value) === JSON.stringify(usual);
    setProblem(this.state, { parameters: same ? others : { ...others, [name]: value } });
  }
}

/** What was typed: a number, numbers with commas between them, or else text, which Python judges. @param {string} text @returns {unknown} */
function read(text) {
  const clean = text.trim();
  try {
    return JSON.parse(clean);
  } catch {
    // No JSON: perhaps numbers without brackets.
  }
  try {
    return JSON.parse(`[${clean}]`);
  } catch {
    return Number.isFinite(Number(clean)) && clean ? Number(clean) : clean;
  }
}

/** @param {unknown} value */
function written(value) {
  if (Array.isArray(value) && !value.some(Array.isArray)) return value.join(", ");
  return typeof value === "string" ? value : JSON.stringify(value) ?? "";
}
