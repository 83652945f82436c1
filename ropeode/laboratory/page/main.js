// @ts-check
// The page: a view of the scene and of the answers.
import { askLibrary, askRun, moving, needed, visible, wanted } from "./asks.js";
import { isFramed, listenToKernel } from "./channels/kernel.js";
import { recorded } from "./channels/recorded.js";
import { socket } from "./channels/socket.js";
import { Clock } from "./clock.js";
import { onPalette } from "./colours.js";
import { byId, english, make } from "./dom.js";
import { DroppedFiles } from "./dropped_files.js";
import { buildHelp } from "./help.js";
import { useKeys } from "./keys.js";
import { OwnSteppers } from "./own_steppers.js";
import { Panel } from "./plots/panel.js";
import { ProblemControls } from "./problem_controls.js";
import { resource } from "./resources.js";
import { Scenes, stateOf } from "./scenes.js";
import { Showing } from "./shown.js";
import { Stage } from "./stage.js";
import { linkOf, sceneOf, State } from "./state.js";
import { StepperControls } from "./stepper_controls.js";
import { Store } from "./store.js";
import { TakeAlong } from "./take_along.js";
import { Transport } from "./transport.js";
import { ViewControls } from "./view_controls.js";
import { Why } from "./why.js";
import { fillWords, LANGUAGES, languageOf, say, useLanguage } from "./words.js";

// Where the page is one file, what it begins with is inside the document.
const given = document.querySelector("meta[name=lab-link]")?.getAttribute("content") ?? "";
const state = new State(sceneOf(location.hash.length > 1 ? location.hash : given));
const store = new Store();
const showing = new Showing();
const canvas = /** @type {HTMLCanvasElement} */ (byId("canvas"));
const help = /** @type {HTMLDialogElement} */ (byId("help"));
const takeDialog = /** @type {HTMLDialogElement} */ (byId("take-along"));
const notes = byId("notes");
const connection = byId("connection");

const [recording] = await Promise.all([
  resource("recordings/default.json"),
  useLanguage(state.now.language),
]);
store.channels.push(recorded(store, recording));
const address = document.querySelector("meta[name=lab-socket]")?.getAttribute("content");
if (address) {
  const url = new URL(address + location.search, location.href);
  url.protocol = url.protocol.replace("http", "ws");
  store.channels.push(socket(store, url.href, (own) => {
    const library = store.answer(askLibrary);
    if (library) store.receive(JSON.stringify(askLibrary), { ...library, own });
  }));
} else if (isFramed) listenToKernel(store);

const stage = new Stage(canvas, showing, (node) => state.change({ node }));
const clock = new Clock(state, () => showing.truth?.frames ?? 0, follow);

/** @type {{update: () => void}[]} */
let parts = [];
/** @type {Panel} */
let panel;
/** @type {Transport} */
let transport;
/** @type {OwnSteppers} */
let own;

/** Build what has words in it; again when the language changes. */
function build() {
  fillWords(document);
  document.title = say("title");
  panel = new Panel(say, (name, value) =>
    state.change({ choices: { ...state.now.choices, [name]: value } }));
  byId("plots").replaceChildren(panel.element);
  transport = new Transport(byId("transport"), state, clock, showing);
  own = new OwnSteppers(byId("own"), state, store);
  parts = [
    transport,
    own,
    new Scenes(byId("scenes"), state, store, showScene),
    new ViewControls(byId("view-controls"), state, showing),
    new ProblemControls(byId("problem-controls"), state, store),
    new StepperControls(byId("stepper-controls"), state, store),
    new Why(byId("why"), state, store),
    new DroppedFiles(byId("files"), state, store),
    new TakeAlong(takeDialog, state, store, stage),
  ];
  buildHelp(help);
  const language = /** @type {HTMLSelectElement} */ (byId("language"));
  language.replaceChildren(...Object.entries(LANGUAGES).map(([value, name]) => make("option", { value }, name)));
  language.value = languageOf(state.now.language);
}

/** @param {Partial<import("./state").Scene>} scene */
function showScene(scene) {
  clock.time = scene.time ?? clock.time;
  state.change(scene);
}

/** Show the scene that the address names, where no link says more. */
function startWithScene() {
  const name = location.hash.length < 2 && new URLSearchParams(location.search).get("scene");
  const found = store.answer(askLibrary)?.scenes.find((each) => each.name === name);
  if (found) showScene(stateOf(found));
}

/** Want what the scene needs. Steps that no run can have, for want of Python, leave the order plot. */
function ask() {
  store.want(wanted(state.now));
  const steppers = visible(state.now);
  const ladder = state.now.ladder.filter((steps) =>
    steppers.some((each) => !store.lacks(askRun(state.now, each, steps))));
  if (ladder.length && ladder.length < state.now.ladder.length) state.change({ ladder });
}

/** Show the scene and the answers as they are. */
function update() {
  showing.update(state.now, store);
  const library = store.answer(askLibrary);
  if (library) own.take(library.own);
  for (const part of parts) part.update();
  stage.update();
  const view = showing.view(store);
  if (view) panel.show(view);
  follow(clock.time);
  tell();
}

/** What is under way, and the certificate. */
function tell() {
  byId("problem-words").textContent = showing.truth?.words ?? "";
  const { working } = store;
  const missing = needed(state.now).some((ask) => store.lacks(ask));
  const said = store.connection === "lost" ? [say("connection.lost")]
    : store.connection === "refused" ? [english(store.refused)]
    : missing ? [say("needs")]
    : working ? [say("connection.working"), english(working.text)] : [];
  const text = said.map((each) => (typeof each === "string" ? each : each.textContent)).join("");
  if (connection.textContent !== text) connection.replaceChildren(...said);
  connection.title = text;
  connection.classList.toggle("lost", missing || ["lost", "refused"].includes(store.connection));
  const certificate = byId("certificate");
  const open = certificate.querySelector("details")?.open ?? false;
  certificate.replaceChildren(
    make("details", { open }, make("summary", {}, say("certificate.title")),
      make("ul", {}, ...(showing.truth?.certificate ?? []).map((line) => make("li", { lang: "en" }, line)))));
}

/**
 * The problem's time, which need not start at 0, nor have frames of equal length.
 * @param {typeof showing.truth} truth
 * @param {number} place in samples
 */
function timeAt(truth, place) {
  if (!truth) return 0;
  const times = truth.arrays.times.data;
  const before = Math.min(Math.floor(place), times.length - 2);
  return times[before] + (place - before) * (times[before + 1] - times[before]);
}

/** @param {number} time in frames */
function follow(time) {
  const place = time * (showing.truth?.samples_per_frame ?? 1);
  stage.draw(place);
  transport.follow(time);
  panel.follow(timeAt(showing.truth, place));
  const said = stage.notes();
  if (moving(state.now).some((ask) => store.lacks(ask))) said.unshift(say("note.lacking"));
  if (said.join("\n") !== [...notes.children].map((each) => each.textContent).join("\n"))
    notes.replaceChildren(...said.map((each) => make("li", {}, each)));
}

let linked = "";
state.listen(async (changed) => {
  if (changed.has("language")) {
    await useLanguage(state.now.language);
    build();
  }
  ask();
  update();
  if (changed.has("ladder")) panel.groups[1].tabs.element.scrollIntoView({ block: "nearest" });
  linked = linkOf(state.now);
  if (!isFramed) history.replaceState(null, "", `#${linked}`);
});
store.listen(update);
onPalette(update);
addEventListener("hashchange", () => {
  if (location.hash.slice(1) === linked) return;
  const { files, versions, requests } = state.now;
  const scene = { ...sceneOf(location.hash), files, versions, requests };
  clock.time = scene.time;
  state.change(scene);
});
byId("help-open").addEventListener("click", () => help.showModal());
byId("take").addEventListener("click", () => takeDialog.showModal());
byId("language").addEventListener("change", (event) =>
  state.change({ language: /** @type {HTMLSelectElement} */ (event.target).value }));
useKeys(state, clock, () => showing.truth?.samples_per_frame ?? 1, () => help.showModal());
build();
ask();
startWithScene();
update();
