// @ts-check
/** A part of the page that shows the state and the answers, and changes the state. */
export class Controls {
  /** @param {HTMLElement} element @param {import("./state").State} state @param {import("./store").Store} store */
  constructor(element, state, store) {
    this.element = element;
    this.state = state;
    this.store = store;
  }
}
