// @ts-check
import { button, make } from "./dom.js";
import { KEYS } from "./keys.js";
import { say } from "./words.js";

/** @param {HTMLDialogElement} dialog gets the keys and what they do */
export function buildHelp(dialog) {
  dialog.replaceChildren(
    make("h2", {}, say("help.title")),
    make("p", {}, say("help.words")),
    make("table", {}, make("tbody", {}, ...KEYS.map(({ keys, name }) =>
      make("tr", {},
        make("th", { scope: "row" }, ...keys.map((key) => (key === "–" ? " – " : make("kbd", {}, key === "Space" ? say("key.space") : key)))),
        make("td", {}, say(`key.${name}`)))))),
    button(say("close"), () => dialog.close(), { class: "close" }),
  );
}
