// @ts-check
/**
 * All that the page shows: everything else follows from it and from the answers.
 *
 * @typedef {object} Scene
 * @property {{name: string, parameters: {[name: string]: unknown}, frames: number}} problem
 *   `parameters` has those alone that are not the default
 * @property {string[]} steppers up to five, by their names with options
 * @property {number[]} hidden indices of those that are not drawn
 * @property {number} steps in each frame
 * @property {number[]} ladder the steps per frame that were tried, in increasing order
 * @property {number} time in frames
 * @property {boolean} playing
 * @property {number} speed frames of the problem in a second
 * @property {"overlay" | "beside"} layout
 * @property {number} magnified errors are drawn so many times as large
 * @property {number | null} node that was chosen
 * @property {import("./plots/view").Choices} choices which plots are shown, and how
 * @property {string | null} lesson by its name
 * @property {string | null} language null: that of the browser
 * @property {import("./messages").GivenFile[]} files that were dropped
 * @property {{[stepper: string]: string}} versions of the steppers of the user's own
 * @property {import("./messages").Ask[]} requests questions that a button asked
 */

export const MOST_STEPPERS = 5;
export const MOST_STEPS = 2 ** 16;
const LINKED = /** @type {const} */ ([
  "problem", "steppers", "hidden", "steps", "ladder", "time", "playing", "speed", "layout",
  "magnified", "node", "choices", "lesson", "language",
]);

/** @returns {Scene} the default scene */
export function defaultScene() {
  return {
    problem: { name: "rope", parameters: {}, frames: 40 },
    steppers: ["explicit-euler", "semi-implicit-euler", "rk4"],
    hidden: [],
    steps: 16,
    ladder: [16],
    time: 0,
    playing: true,
    speed: 4,
    layout: "overlay",
    magnified: 1,
    node: null,
    choices: {
      motion: "error", steps: "order", axis: "dt", energy: "linear", phase: "component 0", region: "0",
    },
    lesson: null,
    language: null,
    files: [],
    versions: {},
    requests: [],
  };
}

/** The scene, and who wants to know when it changes. */
export class State {
  /** @type {((changed: Set<string>) => void)[]} */
  #listeners = [];

  /** @param {Scene} scene */
  constructor(scene) {
    this.now = scene;
  }

  /** @param {(changed: Set<string>) => void} listener gets the names of what has changed */
  listen(listener) {
    this.#listeners.push(listener);
  }

  /** @param {Partial<Scene>} changes */
  change(changes) {
    this.now = { ...this.now, ...changes };
    const names = new Set(Object.keys(changes));
    for (const listener of this.#listeners) listener(names);
  }
}

/** @param {Scene} scene @returns {string} what stands after # in its link */
export function linkOf(scene) {
  const usual = defaultScene();
  const parts = LINKED.filter((name) => JSON.stringify(scene[name]) !== JSON.stringify(usual[name]));
  return parts.map((name) => `${name}=${encodeURIComponent(JSON.stringify(scene[name]))}`).join("&");
}

/**
 * The scene of a link. A part that cannot be read is the default.
 *
 * @param {string} link what stands after #
 * @returns {Scene}
 */
export function sceneOf(link) {
  /** @type {any} */
  const scene = defaultScene();
  for (const part of link.replace(/^#/, "").split("&")) {
    const [name, text = ""] = part.split(/=(.*)/s);
    const known = LINKED.find((each) => each === name);
    if (!known) continue;
    try {
      let value = JSON.parse(decodeURIComponent(text));
      if (known === "choices") value = { ...scene.choices, ...value };
      if (fits(known, value, scene[known])) scene[known] = value;
    } catch {
      // Not JSON: the link was cut or edited.
    }
  }
  scene.ladder = rungs([...scene.ladder, scene.steps]);
  return scene;
}

/** @param {unknown} value @returns {boolean} */
const isSteps = (value) => Number.isInteger(value) && Number(value) >= 1 && Number(value) <= MOST_STEPS;

/** @type {{[name: string]: (value: any) => boolean}} */
const CHECKS = {
  problem: (value) => typeof value?.name === "string" && typeof value.parameters === "object"
    && Number.isInteger(value.frames),
  steppers: (value) => Array.isArray(value) && value.length <= MOST_STEPPERS
    && value.every((each) => typeof each === "string"),
  hidden: (value) => Array.isArray(value) && value.every(Number.isInteger),
  ladder: (value) => Array.isArray(value) && value.length <= 32 && value.every(isSteps),
  steps: isSteps,
  layout: (value) => value === "overlay" || value === "beside",
  magnified: (value) => Number.isFinite(value) && value >= 1,
  speed: (value) => Number.isFinite(value) && value > 0,
  node: (value) => Number.isInteger(value) && value >= 0,
  choices: (value) => Object.entries(defaultScene().choices).every(
    ([name, usual]) => typeof value[name] === typeof usual),
};

/** @param {string} name @param {any} value @param {any} usual @returns {boolean} */
function fits(name, value, usual) {
  if (value === null) return ["node", "lesson", "language"].includes(name);
  const check = CHECKS[name];
  return check ? check(value) : typeof value === typeof (usual ?? "");
}

/** @param {number[]} steps @returns {number[]} each once, in increasing order, 32 at most */
export function rungs(steps) {
  return [...new Set(steps)].sort((a, b) => a - b).slice(0, 32);
}
