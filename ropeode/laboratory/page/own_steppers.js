// @ts-check
import { askCheck, askLibrary } from "./asks.js";
import { Controls } from "./controls.js";
import { english, make } from "./dom.js";
import { MOST_STEPPERS } from "./state.js";
import { say } from "./words.js";
/** @typedef {import("./messages").OwnStepper} OwnStepper */

const FOUND = ["pass", "fail", "undetermined", "skip"];

/** What is known of the user's own steppers: the fault of the file, and the verdict of `check`. */
export class OwnSteppers extends Controls {
  #built = "";

  /** Take the versions that Python has told; a new stepper of one's own joins the others. @param {OwnStepper[]} own */
  take(own) {
    const { versions, steppers } = this.state.now;
    const working = own.flatMap(({ name, version }) => (version ? [[name, version]] : []));
    const next = Object.fromEntries(working);
    if (JSON.stringify(next) === JSON.stringify(versions)) return;
    const fresh = Object.keys(next).filter((name) => !(name in versions) && !steppers.includes(name));
    const room = steppers.slice(0, MOST_STEPPERS - fresh.length);
    this.state.change({ versions: next, steppers: [...fresh, ...room] });
  }

  update() {
    const own = this.store.answer(askLibrary)?.own ?? [];
    const checks = own.map(({ name, version }) => {
      const whole = askCheck(this.state.now, name);
      const quick = askCheck(this.state.now, name, true);
      const found = this.store.answer(whole) ?? this.store.refusal(whole) ?? this.store.answer(quick);
      return version ? found : undefined;
    });
    const key = JSON.stringify([own, checks, document.documentElement.lang]);
    if (key === this.#built) return;
    this.#built = key;
    this.element.hidden = !own.length;
    if (!own.length) return;
    this.element.replaceChildren(
      make("h2", {}, say("own.title")),
      ...own.flatMap((each, i) => this.#of(each, checks[i])),
    );
  }

  /** @param {OwnStepper} own @param {any} checked */
  #of({ name, version, fault, line }, checked) {
    const parts = [];
    if (fault)
      parts.push(make("p", { class: "fault", role: "alert" },
        line === null ? "" : `${say("own.line", { line })} `, english(fault), version ? ` ${say("own.old")}` : ""));
    if (checked?.kind === "refused") parts.push(make("p", { class: "fault", lang: "en" }, checked.message));
    else if (checked)
      parts.push(make("details", { open: true },
        make("summary", {}, `${name}: ${inShort(checked)}`),
        lines(checked.lines, checked.made === checked.checks)));
    else if (this.store.lacks(askCheck(this.state.now, name, true))) parts.push(make("p", {}, say("needs")));
    else if (version) parts.push(make("p", {}, say("own.checking", { name })));
    return parts;
  }
}

/** What a check has found; before its end, how far it is. @param {import("./messages").Checked} checked */
function inShort({ made, checks, lines }) {
  if (made === checks) return say(`own.${lines[1].status}`);
  const failed = lines.some(({ status }) => status === "fail");
  return [say("own.part", { made, checks }), ...(failed ? [say("own.wrong")] : [])].join("; ");
}

/** The lines of a report: a title, findings with what became of them, and a verdict if it has ended. @param {import("./messages").Line[]} list @returns {HTMLElement} */
export function lines(list, ended = true) {
  return make("ul", { class: "report" }, ...list.map(({ status, text }, i) => {
    const finding = FOUND.includes(status) && !(ended && i + 1 === list.length);
    return make("li", { class: status }, ...(finding ? [make("b", {}, say(`found.${status}`)), " "] : []), english(text));
  }));
}
