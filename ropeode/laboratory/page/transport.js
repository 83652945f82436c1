// @ts-check
import { scaleSteps, setSteps } from "./actions.js";
import { button, make } from "./dom.js";
import { icon } from "./icons.js";
import { SPEEDS } from "./keys.js";
import { shortly } from "./numbers.js";
import { say } from "./words.js";

/** Play, pause, step, scrub, speed, and steps per frame. */
export class Transport {
  /**
   * @param {HTMLElement} element
   * @param {import("./state").State} state
   * @param {import("./clock").Clock} clock
   * @param {import("./shown").Showing} showing
   */
  constructor(element, state, clock, showing) {
    this.state = state;
    this.showing = showing;
    /** @param {number} direction */
    const step = (direction) => {
      const n = showing.truth?.samples_per_frame ?? 1;
      clock.seek((Math.round(clock.time * n) + direction) / n);
    };
    this.play = button("", () => clock.toggle(), { class: "play", "aria-keyshortcuts": "Space" });
    this.scrub = make("input", { type: "range", id: "scrub", min: 0, value: 0, "aria-label": say("transport.scrub") });
    this.scrub.addEventListener("input", () => clock.seek(Number(this.scrub.value)));
    this.time = make("output", { class: "time", id: "time-shown" });
    this.speed = make("select", { id: "speed", "aria-label": say("transport.speed") },
      ...SPEEDS.map((each) => make("option", { value: each }, say("transport.frames", { speed: each }))));
    this.speed.addEventListener("change", () => state.change({ speed: Number(this.speed.value) }));
    this.steps = make("input", { type: "text", inputmode: "numeric", size: 6, id: "steps" });
    this.steps.addEventListener("change", () => {
      setSteps(state, Number(this.steps.value));
      this.update();
    });
    this.dt = make("output", { id: "dt" });
    element.replaceChildren(
      make("div", { class: "row" },
        button(icon("restart"), () => clock.restart(), { "aria-label": say("transport.restart"), title: `${say("transport.restart")} (r)`, "aria-keyshortcuts": "r" }),
        button(icon("back"), () => step(-1), { "aria-label": say("transport.back"), title: `${say("transport.back")} (←)`, "aria-keyshortcuts": "ArrowLeft" }),
        this.play,
        button(icon("forward"), () => step(1), { "aria-label": say("transport.forward"), title: `${say("transport.forward")} (→)`, "aria-keyshortcuts": "ArrowRight", class: "forward" }),
        this.scrub,
        this.time,
        this.speed,
      ),
      make("div", { class: "row" },
        make("div", { class: "steps", role: "group", "aria-label": say("transport.steps") },
          make("label", { for: "steps" }, say("transport.steps")),
          button("−", () => scaleSteps(state, 0.5), { id: "fewer", "aria-label": say("transport.fewer"), title: `${say("transport.fewer")} (-)`, "aria-keyshortcuts": "-" }),
          this.steps,
          button("+", () => scaleSteps(state, 2), { id: "more", "aria-label": say("transport.more"), title: `${say("transport.more")} (=)`, "aria-keyshortcuts": "=" }),
          this.dt,
        ),
      ),
    );
  }

  update() {
    const { playing, steps, speed } = this.state.now;
    const { truth } = this.showing;
    const text = say(playing ? "transport.pause" : "transport.play");
    if (this.play.title !== `${text} (${say("key.space")})`) {
      this.play.replaceChildren(icon(playing ? "pause" : "play"));
      this.play.setAttribute("aria-label", text);
      this.play.title = `${text} (${say("key.space")})`;
    }
    if (document.activeElement !== this.steps) this.steps.value = String(steps);
    this.speed.value = String(speed);
    if (!truth) return;
    this.scrub.max = String(truth.frames);
    this.scrub.step = String(1 / truth.samples_per_frame);
    this.dt.textContent = say("transport.dt", { dt: shortly(truth.frame / steps, 3), unit: truth.time_unit });
  }

  /** @param {number} time in frames */
  follow(time) {
    this.scrub.value = String(time);
    const text = say("stage.frame_of", { frame: time.toFixed(1), frames: this.showing.truth?.frames ?? "" });
    this.time.textContent = text;
    this.scrub.setAttribute("aria-valuetext", text);
  }
}
