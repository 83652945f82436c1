// @ts-check
/**
 * An element.
 *
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {{[name: string]: string | number | boolean}} [attributes] true: without a value; false: left out
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes))
    if (value !== false) element.setAttribute(name, value === true ? "" : String(value));
  element.append(...children);
  return element;
}

/**
 * A sentence of Python's, whatever the language of the page.
 *
 * @param {string} text
 */
export function english(text) {
  return make("span", { lang: "en" }, text);
}

/** @param {string} id @returns {HTMLElement} that the document is known to have */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element ${id}`);
  return element;
}

/**
 * A button.
 *
 * @param {string | Node} face
 * @param {() => void} act
 * @param {{[name: string]: string | number | boolean}} [attributes]
 */
export function button(face, act, attributes = {}) {
  const element = make("button", { type: "button", ...attributes }, face);
  element.addEventListener("click", act);
  return element;
}

/**
 * A choice of several.
 *
 * @param {string} label
 * @param {{value: string, label: string}[]} options
 * @param {string} value
 * @param {(value: string) => void} choose
 * @param {{[name: string]: string}} [attributes]
 */
export function choice(label, options, value, choose, attributes = {}) {
  const select = make(
    "select",
    attributes,
    ...options.map((each) => make("option", { value: each.value }, each.label)),
  );
  select.value = value;
  select.addEventListener("change", () => choose(select.value));
  return make("label", { class: "choice" }, make("span", {}, label), select);
}
