// @ts-check
// Okabe and Ito, Color Universal Design (2008), in the order of ropeode's other plots
// (render/plots/style.py). Dashes tell the steppers apart without colours.
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];
// Pale enough for a dark page, with the same hues.
const ON_DARK = ["#4BA3DB", "#F0813A", "#2BC59A", "#DD98BD", "#F0B43C", "#8ACDF2"];
/** @type {number[][]} */
const DASHES = [[], [9, 4], [3, 3], [12, 3, 3, 3], [6, 3], [14, 5]];

/** What is drawn neither for a stepper nor for a reader's file. */
const LIGHT = { ink: "#1b1f24", faint: "#5c6670", reference: "#8a939c", ground: "#ffffff", line: "#d5dae0" };
const DARK = { ink: "#e8ebee", faint: "#a5afb9", reference: "#8b949e", ground: "#15191e", line: "#39414a" };

const dark = matchMedia("(prefers-color-scheme: dark)");

/** @returns {typeof LIGHT} colours of the page as it is shown now */
export function palette() {
  return dark.matches ? DARK : LIGHT;
}

/** @param {() => void} listener called when the page turns dark or light */
export function onPalette(listener) {
  dark.addEventListener("change", listener);
}

/**
 * How a stepper is drawn, by its place in the list; files come after the steppers.
 *
 * @param {number} index
 * @returns {{colour: string, dash: number[]}}
 */
export function style(index) {
  const colours = dark.matches ? ON_DARK : COLOURS;
  return { colour: colours[index % colours.length], dash: DASHES[index % DASHES.length] };
}
