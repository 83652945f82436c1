// @ts-check
import { decoded } from "../wire.js";
/** @typedef {import("../messages").Wanted} Wanted */

// As many questions as Python takes at once; the others follow when some are answered.
const MOST_WANTED = 64;

/** Questions to Python and its answers, whatever carries them. */
export class Conversation {
  /** @type {Wanted[]} asked before all others, until they are answered */
  #first = [];
  /** @type {Wanted[]} */
  #list = [];
  #said = "";

  /**
   * @param {import("../store").Store} store
   * @param {(text: string) => void} post
   */
  constructor(store, post) {
    this.store = store;
    this.post = post;
  }

  /** Somebody has begun to listen, who knows of no question yet. @param {Wanted[]} [first] */
  begin(first = []) {
    this.#first = first;
    this.#said = "";
    this.store.connection = "open";
    this.store.dropRefusals();
    this.store.again();
    this.#say();
    this.store.announce();
  }

  /** @param {Wanted[]} list @returns {Wanted[]} what others have to answer: nothing */
  want(list) {
    this.#list = list;
    this.#say();
    return [];
  }

  #say() {
    const text = JSON.stringify({ want: [...this.#first, ...this.#list].slice(0, MOST_WANTED) });
    if (text !== this.#said) this.post(text);
    this.#said = text;
  }

  /**
   * @param {string | ArrayBuffer} data as Python sends it
   * @returns {any} news, if it is no answer
   */
  receive(data) {
    const { key, answer } = typeof data === "string" ? message(data) : decoded(data);
    if (answer.kind === "reloaded") return answer;
    if (answer.kind === "working") this.store.working = { ...answer, key };
    else {
      const more = this.#list.length >= MOST_WANTED;
      this.#first = this.#first.filter((each) => each.key !== key);
      this.#list = this.#list.filter((each) => each.key !== key);
      this.store.receive(key, answer);
      if (more) this.#say();
    }
    this.store.announce();
  }
}

/** @param {string} text @returns {{key: string, answer: any}} */
function message(text) {
  const { key, ...answer } = JSON.parse(text);
  return { key, answer: { arrays: {}, ...answer } };
}
