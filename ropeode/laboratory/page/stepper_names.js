// @ts-check
// Steppers are named with their options, as in stormer-verlet:start=rest,damping=lagged.
/** @typedef {import("./messages").StepperFacts} StepperFacts */

/**
 * @param {string} text
 * @param {StepperFacts[]} known
 * @returns {{name: string, options: {[name: string]: string}}}
 */
export function parsed(text, known) {
  if (known.some(({ name }) => name === text)) return { name: text, options: {} };
  const [name, tail = ""] = text.split(/:(.*)/s);
  if (!known.some((each) => each.name === name)) return { name: text, options: {} };
  const pairs = tail.split(",").filter(Boolean).map((each) => each.split("=").map((word) => word.trim()));
  return { name, options: Object.fromEntries(pairs) };
}

/**
 * @param {string} name
 * @param {{[name: string]: string}} options those that are the default are left out
 * @param {StepperFacts[]} known
 * @returns {string}
 */
export function named(name, options, known) {
  const facts = known.find((each) => each.name === name);
  const others = Object.entries(options).filter(([option, value]) => facts?.options[option]?.[0] !== value);
  return others.length ? `${name}:${others.map((each) => each.join("=")).join(",")}` : name;
}
