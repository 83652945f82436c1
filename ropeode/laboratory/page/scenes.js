// @ts-check
import { askLibrary } from "./asks.js";
import { make } from "./dom.js";
import { defaultScene, rungs } from "./state.js";
import { say } from "./words.js";
/** @typedef {import("./messages").SceneFacts} SceneFacts */

/**
 * The page's state for a lesson or a figure.
 *
 * @param {SceneFacts} facts
 * @returns {Partial<import("./state").Scene>}
 */
export function stateOf({ name, state }) {
  const usual = defaultScene();
  const { problem, steppers, ladder, plot } = state;
  const group = plot === "order" || plot === "stability" ? "steps" : "motion";
  return {
    problem: { name: problem.name ?? "rope", parameters: problem.parameters ?? {}, frames: problem.frames ?? 40 },
    steppers, hidden: [], ladder: rungs(ladder), steps: ladder[ladder.length - 1],
    time: 0, playing: true, layout: usual.layout, magnified: 1, node: null,
    choices: { ...usual.choices, [group]: plot }, lesson: name,
  };
}

/** Lessons and figures: a choice of them, and the sentences of the one that is shown. */
export class Scenes {
  #built = "";

  /**
   * @param {HTMLElement} element
   * @param {import("./state").State} state
   * @param {import("./store").Store} store
   * @param {(scene: Partial<import("./state").Scene>) => void} show
   */
  constructor(element, state, store, show) {
    this.element = element;
    this.state = state;
    this.store = store;
    this.show = show;
  }

  update() {
    const scenes = this.store.answer(askLibrary)?.scenes ?? [];
    const { lesson } = this.state.now;
    const language = document.documentElement.lang;
    const key = JSON.stringify([scenes.length, lesson, language]);
    if (key === this.#built) return;
    this.#built = key;
    this.element.hidden = !scenes.length;
    const select = make("select", { id: "scene", "aria-label": say("scenes.title") },
      make("option", { value: "" }, say("scenes.choose")),
      ...["lessons", "figures"].map((group) => make("optgroup", { label: say(`scenes.${group}`) },
        ...scenes.filter(({ name }) => name.startsWith("figure-") === (group === "figures"))
          .map((each) => make("option", { value: each.name }, inLanguage(each.title, language))))));
    select.value = lesson ?? "";
    select.addEventListener("change", () => {
      const found = scenes.find(({ name }) => name === select.value);
      this.show(found ? stateOf(found) : { lesson: null });
      document.getElementById("scene")?.focus();
    });
    const shown = scenes.find(({ name }) => name === lesson);
    const lines = shown ? inLanguage(shown.text, language).split("\n").filter(Boolean) : [];
    this.element.replaceChildren(
      make("h2", {}, say("scenes.title")), select,
      ...lines.map((each) => make("p", {}, each)),
      ...(shown ? [make("p", {}, say("why.more", { page: `docs/${shown.page}.md` }))] : []),
    );
  }
}

/** @param {{[language: string]: string}} texts @param {string} language */
function inLanguage(texts, language) {
  return (texts[language] ?? texts.en ?? "").trim();
}
