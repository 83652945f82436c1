// @ts-check
import { resource } from "./resources.js";

/** Languages by their codes, in their own words. */
export const LANGUAGES = { en: "English", zh: "中文" };

/** @type {{[key: string]: string}} */
let texts = {};

/** @param {string | null} chosen @returns {keyof typeof LANGUAGES} that, or the browser's */
export function languageOf(chosen) {
  const code = (chosen ?? navigator.language).slice(0, 2);
  return code in LANGUAGES ? /** @type {keyof typeof LANGUAGES} */ (code) : "en";
}

/** @param {string | null} chosen language */
export async function useLanguage(chosen) {
  const code = languageOf(chosen);
  texts = await resource(`words/${code}.json`);
  document.documentElement.lang = code;
}

/**
 * The text of a key in the language of the page.
 *
 * @param {string} key
 * @param {{[name: string]: unknown}} [values] that take the places of their names in braces
 * @returns {string}
 */
export function say(key, values = {}) {
  const text = texts[key] ?? key;
  return text.replace(/\{(\w+)\}/g, (place, name) => String(values[name] ?? place));
}

/** The text of something that has a name, which may be the user's own. @param {string} kind @param {string} name */
export function called(kind, name) {
  return texts[`${kind}.${name}`] ?? name;
}

/** Put the texts where the document names their keys. @param {ParentNode} root */
export function fillWords(root) {
  for (const each of root.querySelectorAll("[data-words]"))
    each.textContent = say(each.getAttribute("data-words") ?? "");
  for (const each of root.querySelectorAll("[data-label]"))
    each.setAttribute("aria-label", say(each.getAttribute("data-label") ?? ""));
}
