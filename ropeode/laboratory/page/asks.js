// @ts-check
// What the page asks. Each answer depends on its question alone, so a question is its own key.
/** @typedef {import("./messages").Ask} Ask */
/** @typedef {import("./state").Scene} Scene */

const LONGEST_KEY = 4000;

/**
 * The key of a question: its JSON with sorted names, without what is null.
 *
 * @param {Ask} ask
 * @returns {string}
 */
export function keyOf(ask) {
  const text = JSON.stringify(sorted(ask));
  return text.length <= LONGEST_KEY ? text : `${text.slice(0, 200)}#${digest(text)}`;
}

/** @param {any} value @returns {any} */
function sorted(value) {
  if (Array.isArray(value)) return value.map(sorted);
  if (value === null || typeof value !== "object") return value;
  const names = Object.keys(value).filter((name) => value[name] != null).sort();
  return Object.fromEntries(names.map((name) => [name, sorted(value[name])]));
}

/** @param {string} text @returns {string} 106 bits of it (cyrb53 by bryc, public domain, twice) */
function digest(text) {
  return [1, 2].map((seed) => {
    let a = 0xdeadbeef ^ seed;
    let b = 0x41c6ce57 ^ seed;
    for (let i = 0; i < text.length; i++) {
      const letter = text.charCodeAt(i);
      a = Math.imul(a ^ letter, 2654435761);
      b = Math.imul(b ^ letter, 1597334677);
    }
    a = Math.imul(a ^ (a >>> 16), 2246822507) ^ Math.imul(b ^ (b >>> 13), 3266489909);
    b = Math.imul(b ^ (b >>> 16), 2246822507) ^ Math.imul(a ^ (a >>> 13), 3266489909);
    return (4294967296 * (2097151 & b) + (a >>> 0)).toString(36);
  }).join("-");
}

/** @type {Extract<Ask, {kind: "library"}>} */
export const askLibrary = { kind: "library" };

/** @param {Scene} scene @returns {Ask & {kind: "truth"}} */
export function askTruth(scene) {
  return { kind: "truth", problem: scene.problem };
}

/**
 * @param {Scene} scene
 * @param {string} stepper by its name with options
 * @param {number} steps in each frame
 * @returns {Ask & {kind: "run"}}
 */
export function askRun(scene, stepper, steps) {
  return {
    kind: "run",
    problem: scene.problem,
    stepper,
    steps_per_frame: steps,
    version: scene.versions[stepper],
  };
}

/**
 * The observed order along the ladder of step sizes.
 *
 * @param {Scene} scene
 * @param {string} stepper by its name with options
 * @returns {Ask & {kind: "order"}}
 */
export function askOrder(scene, stepper) {
  return {
    kind: "order",
    problem: scene.problem,
    stepper,
    steps_per_frame: scene.ladder,
    version: scene.versions[stepper],
  };
}

/**
 * Position and velocity of what the phase plane shows.
 *
 * @param {Scene} scene
 * @param {string | null} stepper null: of the reference
 * @param {number} steps in each frame
 * @returns {Ask & {kind: "phase"}}
 */
export function askPhase(scene, stepper, steps) {
  const [of, number] = scene.choices.phase.split(" ");
  /** @type {Ask & {kind: "phase"}} */
  const ask = { kind: "phase", problem: scene.problem, stepper };
  if (of === "mode") ask.mode = Number(number);
  else {
    // None is chosen: the last, which is the free end of a rope.
    if (scene.node !== null) ask.node = scene.node;
    ask.component = Number(number);
  }
  if (stepper === null) return ask;
  return { ...ask, steps_per_frame: steps, version: scene.versions[stepper] };
}

/** @param {Scene} scene @param {string} stepper @returns {Ask & {kind: "theory"}} */
export function askTheory(scene, stepper) {
  return { kind: "theory", problem: scene.problem, stepper, version: scene.versions[stepper] };
}

/** @param {Scene} scene @param {string} stepper @returns {Ask & {kind: "stability"}} */
export function askStability(scene, stepper) {
  return { kind: "stability", problem: scene.problem, stepper, version: scene.versions[stepper] };
}

/** @param {Scene} scene @returns {Ask & {kind: "grade"}} */
export function askGrade(scene) {
  return { kind: "grade", problem: scene.problem, files: scene.files };
}

/**
 * @param {Scene} scene
 * @param {string} stepper of the user's own
 * @param {boolean} [quick] without what takes long
 * @returns {Ask & {kind: "check"}}
 */
export function askCheck(scene, stepper, quick = false) {
  return { kind: "check", stepper, quick, version: scene.versions[stepper] };
}

/** @param {Scene} scene @returns {Ask & {kind: "command"}} */
export function askCommand(scene) {
  return {
    kind: "command",
    problem: scene.problem,
    steppers: scene.steppers,
    steps_per_frame: scene.ladder,
  };
}

/** @param {Scene} scene @returns {Ask & {kind: "film"}} */
export function askFilm(scene) {
  return {
    kind: "film",
    problem: scene.problem,
    steppers: scene.steppers,
    steps_per_frame: scene.steps,
    version: scene.steppers.map((each) => scene.versions[each]).find(Boolean),
  };
}

/** @param {Scene} scene @returns {string[]} the steppers that are drawn */
export function visible(scene) {
  return scene.steppers.filter((_, index) => !scene.hidden.includes(index));
}

/** What moves in the picture. @param {Scene} scene @returns {Ask[]} */
export function moving(scene) {
  return [askTruth(scene), ...visible(scene).map((each) => askRun(scene, each, scene.steps))];
}

/**
 * Everything that the scene shows, the most urgent first: what moves, and what the plots show of it.
 *
 * @param {Scene} scene
 * @returns {Ask[]}
 */
export function needed(scene) {
  const steppers = visible(scene);
  const { choices } = scene;
  /** @param {number} steps */
  const runs = (steps) => steppers.map((each) => askRun(scene, each, steps));
  /** @type {Ask[]} */
  const list = [askLibrary, ...moving(scene)];
  if (scene.files.length) list.push(askGrade(scene));
  list.push(...scene.requests);
  if (choices.motion === "phase")
    list.push(...[null, ...steppers].map((each) => askPhase(scene, each, scene.steps)));
  if (choices.steps === "stability") list.push(...steppers.map((each) => askStability(scene, each)));
  else {
    list.push(...scene.ladder.flatMap(runs));
    list.push(...steppers.map((each) => askOrder(scene, each)));
  }
  return list;
}

/**
 * Everything that is worth asking for, the most urgent first: what the scene needs, and what the
 * next key will.
 *
 * @param {Scene} scene
 * @returns {Ask[]}
 */
export function wanted(scene) {
  const steppers = visible(scene);
  const list = needed(scene);
  const own = steppers.filter((each) => scene.versions[each]);
  list.push(...own.map((each) => askCheck(scene, each, true)));
  for (const steps of [2 * scene.steps, scene.steps / 2])
    if (Number.isInteger(steps)) list.push(...steppers.map((each) => askRun(scene, each, steps)));
  // What takes long comes last, and a prediction is for more than one step size.
  if (scene.choices.steps === "order" && scene.ladder.length > 1)
    list.push(...steppers.map((each) => askTheory(scene, each)));
  list.push(...own.map((each) => askCheck(scene, each)));
  return list;
}
