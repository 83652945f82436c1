// @ts-check
/** Shapes in a square of 16. */
const PATHS = {
  play: "M4 2L14 8L4 14Z",
  pause: "M3 2H7V14H3ZM9 2H13V14H9Z",
  restart: "M2 2H4V14H2ZM14 2V14L5 8Z",
  back: "M11 2V14L4 8ZM12 2H14V14H12Z",
  forward: "M5 2V14L12 8ZM2 2H4V14H2Z",
};

/** @param {keyof typeof PATHS} name @returns {SVGElement} a picture that screen readers skip */
export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", PATHS[name]);
  svg.append(path);
  return svg;
}
