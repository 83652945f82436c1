// @ts-check
import { askCommand, askFilm } from "./asks.js";
import { isFramed } from "./channels/kernel.js";
import { button, english, make } from "./dom.js";
import { linkOf } from "./state.js";
import { say } from "./words.js";
/** @typedef {import("./messages").Ask} Ask */

/** What can be taken out of the page: link, command, Python, PNG, SVG, GIF. */
export class TakeAlong {
  /** @type {{ask: Ask, act: () => void} | null} what waits for an answer */
  #waiting = null;

  /**
   * @param {HTMLDialogElement} dialog
   * @param {import("./state").State} state
   * @param {import("./store").Store} store
   * @param {import("./stage").Stage} stage
   */
  constructor(dialog, state, store, stage) {
    this.dialog = dialog;
    this.state = state;
    this.store = store;
    this.stage = stage;
    this.text = make("textarea", { readonly: true, rows: 8, "aria-label": say("take.text") });
    this.text.hidden = true;
    this.said = make("p", { role: "status" });
    dialog.replaceChildren(
      make("h2", {}, say("take.title")),
      make("div", { class: "choices" },
        ...(isFramed ? [] : [button(say("take.link"), () => this.#copy(this.#link()), { id: "copy-link" })]),
        button(say("take.command"), () => this.#command("command"), { id: "copy-command" }),
        button(say("take.python"), () => this.#command("python"), { id: "copy-python" }),
        button("PNG", () => this.#png(), { id: "save-png" }),
        button("SVG", () => this.#save("ropeode.svg", new Blob([stage.svg()], { type: "image/svg+xml" })), { id: "save-svg" }),
        button("GIF", () => this.#film(), { id: "save-gif" }),
      ),
      this.text, this.said,
      button(say("close"), () => dialog.close(), { class: "close" }),
    );
    dialog.addEventListener("close", () => this.#end());
  }

  #link() {
    return `${location.href.split("#")[0]}#${linkOf(this.state.now)}`;
  }

  /** Ask, and act when the answer has come. @param {Ask} ask @param {() => void} act */
  #wait(ask, act) {
    this.#waiting = { ask, act };
    this.text.hidden = true;
    this.said.textContent = say("take.waiting");
    this.state.change({ requests: [ask] });
    this.update();
  }

  #end() {
    this.#waiting = null;
    this.text.hidden = true;
    this.said.textContent = "";
    this.state.change({ requests: [] });
  }

  update() {
    if (!this.#waiting) return;
    const { ask, act } = this.#waiting;
    const refusal = this.store.refusal(ask);
    if (refusal) this.said.replaceChildren(english(refusal.message));
    else if (this.store.answer(ask)) {
      this.#waiting = null;
      act();
    } else if (this.store.connection === "none") this.said.textContent = say("needs");
  }

  /** @param {"command" | "python"} form */
  #command(form) {
    const ask = askCommand(this.state.now);
    this.#wait(ask, () => {
      const text = this.store.answer(ask)?.[form];
      if (text) this.#copy(text);
      else this.said.textContent = say("take.no_command");
    });
  }

  #film() {
    const ask = askFilm(this.state.now);
    this.#wait(ask, () => {
      const letters = atob(this.store.answer(ask)?.gif ?? "");
      const bytes = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
      this.#save("ropeode.gif", new Blob([bytes], { type: "image/gif" }));
    });
  }

  async #png() {
    this.#save("ropeode.png", await this.stage.png());
  }

  /** Show a text, and copy it where the browser lets us. @param {string} text */
  async #copy(text) {
    this.text.hidden = false;
    this.text.value = text;
    this.text.select();
    try {
      await navigator.clipboard.writeText(text);
      this.said.textContent = say("take.copied");
    } catch {
      this.said.textContent = say("take.select");
    }
  }

  /** @param {string} name @param {Blob} contents */
  #save(name, contents) {
    const address = URL.createObjectURL(contents);
    make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 10_000);
    this.said.textContent = say("take.saved", { name });
  }
}
