// @ts-check
import { askGrade } from "./asks.js";
import { Controls } from "./controls.js";
import { button, byId, make } from "./dom.js";
import { shortly } from "./numbers.js";
import { lines } from "./own_steppers.js";
import { say } from "./words.js";

const MOST_FILES = 32;
const MOST_BYTES = 8e6;

/** Files of trajectories that a reader drops on the page: they are graded beside the steppers. */
export class DroppedFiles extends Controls {
  #built = "";
  #fault = "";

  /** @param {HTMLElement} element @param {import("./state").State} state @param {import("./store").Store} store */
  constructor(element, state, store) {
    super(element, state, store);
    const veil = byId("drop");
    let depth = 0;
    addEventListener("dragenter", (event) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      depth++;
      veil.textContent = say("files.drop");
      veil.hidden = false;
    });
    addEventListener("dragleave", () => {
      depth = Math.max(0, depth - 1);
      veil.hidden = depth === 0;
    });
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      depth = 0;
      veil.hidden = true;
      this.#read([...(event.dataTransfer?.files ?? [])]);
    });
  }

  /** @param {File[]} files */
  async #read(files) {
    if (!files.length) return;
    const bytes = files.reduce((sum, each) => sum + each.size, 0);
    this.#fault = files.length > MOST_FILES ? say("files.many", { most: MOST_FILES })
      : bytes > MOST_BYTES ? say("files.large", { megabytes: shortly(bytes / 1e6, 3), most: MOST_BYTES / 1e6 }) : "";
    if (this.#fault) return this.update();
    const texts = await Promise.all(files.map(async (each) => ({ name: each.name, text: await each.text() })));
    this.state.change({ files: texts });
  }

  update() {
    const { files } = this.state.now;
    const ask = askGrade(this.state.now);
    const graded = files.length ? this.store.answer(ask) : undefined;
    const refusal = files.length ? this.store.refusal(ask) : undefined;
    const key = JSON.stringify([files.map(({ name }) => name), graded?.lines, refusal, this.#fault, this.store.connection, document.documentElement.lang]);
    if (key === this.#built) return;
    this.#built = key;
    const input = make("input", { type: "file", id: "file-choice", multiple: true, accept: ".csv,text/csv,text/plain" });
    input.addEventListener("change", () => this.#read([...(input.files ?? [])]));
    const parts = [];
    if (this.#fault) parts.push(make("p", { class: "fault", role: "alert" }, this.#fault));
    if (files.length) {
      parts.push(make("p", {}, files.map(({ name }) => name).join(", ")));
      if (refusal) parts.push(make("p", { class: "fault", role: "alert", lang: "en" }, refusal.message));
      else if (graded) parts.push(lines(graded.lines));
      else parts.push(make("p", {}, say(this.store.connection === "none" ? "needs" : "files.grading")));
      parts.push(button(say("files.remove"), () => this.state.change({ files: [] })));
    }
    this.element.replaceChildren(
      make("h2", {}, say("files.title")),
      make("label", { for: "file-choice" }, say("files.words")), input, ...parts,
    );
  }
}
