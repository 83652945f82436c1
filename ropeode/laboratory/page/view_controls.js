// @ts-check
import { choice, make } from "./dom.js";
import { say } from "./words.js";

const TIMES = [1, 10, 100, 1e3, 1e4, 1e5, 1e6];

/** How the motion is shown: overlaid or side by side, errors magnified, the chosen node. */
export class ViewControls {
  /**
   * @param {HTMLElement} element
   * @param {import("./state").State} state
   * @param {import("./shown").Showing} showing
   */
  constructor(element, state, showing) {
    this.state = state;
    this.showing = showing;
    const layouts = ["overlay", "beside"].map((value) => ({ value, label: say(`view.${value}`) }));
    this.layout = choice(say("view.layout"), layouts, state.now.layout, (value) =>
      state.change({ layout: value === "beside" ? "beside" : "overlay" }), { id: "layout" });
    const times = TIMES.map((each) => ({ value: String(each), label: each === 1 ? say("view.true") : `× ${each.toLocaleString("en")}` }));
    this.magnified = choice(say("view.magnified"), times, "1", (value) =>
      state.change({ magnified: Number(value) }), { id: "magnified" });
    this.node = make("select", { id: "node" });
    this.node.addEventListener("change", () =>
      state.change({ node: this.node.value === "" ? null : Number(this.node.value) }));
    this.nodes = -1;
    element.replaceChildren(
      this.layout, this.magnified,
      make("label", { class: "choice" }, make("span", {}, say("view.node")), this.node),
    );
  }

  update() {
    const { layout, magnified, node } = this.state.now;
    set(this.layout, layout);
    set(this.magnified, String(magnified));
    const count = this.showing.truth?.nodes.filter((each) => each !== null).length ?? 0;
    if (count !== this.nodes) {
      this.nodes = count;
      this.node.replaceChildren(
        make("option", { value: "" }, say("view.none")),
        ...Array.from({ length: count }, (_, i) => make("option", { value: i }, String(i))),
      );
    }
    this.node.value = node === null ? "" : String(node);
  }
}

/** @param {HTMLElement} label @param {string} value */
function set(label, value) {
  const select = label.querySelector("select");
  if (select) select.value = value;
}
