// Elements of SVG.

import { english } from "../dom.js";

const NAMESPACE = "http://www.w3.org/2000/svg";

/**
 * An element with attributes and children; attributes that are null are left out.
 * @param {string} name
 * @param {Record<string, string | number | null>} attributes
 * @param {(Element | string)[]} children
 */
export function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS(NAMESPACE, name);
  for (const [attribute, value] of Object.entries(attributes)) {
    if (value !== null) element.setAttribute(attribute, String(value));
  }
  element.append(...children);
  return element;
}

/** @param {import("./chart.js").Words} words @returns {string} */
export function textOf(words) {
  return typeof words === "string" ? words : words.english;
}

/** @param {import("./chart.js").Words} words @returns {Element | string} */
export function spoken(words) {
  return typeof words === "string" ? words : english(words.english);
}

/**
 * An element of HTML.
 * @template {keyof HTMLElementTagNameMap} Name
 * @param {Name} name
 * @param {Record<string, string | null>} attributes
 * @param {(Element | string)[]} children
 * @returns {HTMLElementTagNameMap[Name]}
 */
export function html(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [attribute, value] of Object.entries(attributes)) {
    if (value !== null) element.setAttribute(attribute, value);
  }
  element.append(...children);
  return element;
}
