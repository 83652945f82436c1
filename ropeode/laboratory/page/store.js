// @ts-check
import { keyOf } from "./asks.js";
import { size } from "./wire.js";
/** @typedef {import("./messages").Ask} Ask */
/** @typedef {import("./messages").Wanted} Wanted */
/** @typedef {import("./wire").Answered} Answered */
/**
 * Where answers come from. `want` gets the whole list of what is wanted now and returns what others
 * have to answer.
 *
 * @typedef {{want: (list: Wanted[]) => Wanted[]}} Channel
 */
/** @typedef {import("./wire").Answered<import("./messages").Refused>} Refused */
/**
 * @template {Ask["kind"]} K
 * @typedef {import("./wire").Answered<Extract<import("./messages").Answer, {kind: K}>>} AnswerTo
 */

const MOST_BYTES = 64e6;

/** Answers by their questions. */
export class Store {
  /** @type {Map<string, Answered>} those that were used last stand last */
  #answers = new Map();
  /** @type {Set<string>} */
  #wanted = new Set();
  /** @type {(() => void)[]} */
  #listeners = [];
  /** @type {Ask[]} */
  #asks = [];
  #bytes = 0;
  #announced = false;

  constructor() {
    /** @type {Channel[]} the first that has an answer gives it */
    this.channels = [];
    /** @type {import("./messages").Working | null} what is being computed */
    this.working = null;
    /** @type {"none" | "connecting" | "open" | "lost" | "refused"} */
    this.connection = "none";
    /** Why Python lets the page not in. */
    this.refused = "";
    /** @type {Wanted[]} what no channel answers */
    this.lacking = [];
  }

  /** @param {() => void} listener called after answers came, once for all that came together */
  listen(listener) {
    this.#listeners.push(listener);
  }

  /**
   * @template {Ask} A
   * @param {A} ask
   * @returns {AnswerTo<A["kind"]> | undefined} undefined: not yet, or refused
   */
  answer(ask) {
    const answer = this.#find(ask);
    return answer?.kind === "refused" ? undefined : /** @type {any} */ (answer);
  }

  /** @param {Ask} ask @returns {Refused | undefined} why there is no answer */
  refusal(ask) {
    const answer = this.#find(ask);
    return answer?.kind === "refused" ? /** @type {Refused} */ (answer) : undefined;
  }

  /** @param {Ask} ask @returns {boolean} whether no channel answers it */
  lacks(ask) {
    if (!this.lacking.length) return false;
    const key = keyOf(ask);
    return this.lacking.some((each) => each.key === key);
  }

  /** @param {Ask} ask */
  #find(ask) {
    const key = keyOf(ask);
    const answer = this.#answers.get(key);
    if (answer) {
      this.#answers.delete(key);
      this.#answers.set(key, answer);
    }
    return answer;
  }

  /** @param {Ask[]} asks everything that is wanted now, the most urgent first */
  want(asks) {
    this.#asks = asks;
    const byKey = new Map(asks.map((ask) => [keyOf(ask), ask]));
    this.#wanted = new Set(byKey.keys());
    let list = [...byKey].map(([key, ask]) => ({ key, ask })).filter(({ key }) => !this.#answers.has(key));
    for (const channel of this.channels) list = channel.want(list);
    this.lacking = list;
    if (this.working && !this.#wanted.has(this.working.key)) this.working = null;
  }

  /** Ask again, after the channels have changed. */
  again() {
    this.want(this.#asks);
  }

  /** @param {string} key @param {Answered} answer */
  receive(key, answer) {
    this.#forget(key);
    this.#answers.set(key, answer);
    this.#bytes += size(answer);
    if (this.working?.key === key) this.working = null;
    for (const old of this.#answers.keys()) {
      if (this.#bytes <= MOST_BYTES) break;
      if (!this.#wanted.has(old)) this.#forget(old);
    }
    this.announce();
  }

  /** Ask once more what was refused: the reason may be gone. */
  dropRefusals() {
    for (const [key, answer] of this.#answers) if (answer.kind === "refused") this.#forget(key);
  }

  /** @param {string} key */
  #forget(key) {
    const old = this.#answers.get(key);
    if (!old) return;
    this.#bytes -= size(old);
    this.#answers.delete(key);
  }

  /** Tell the listeners, soon. */
  announce() {
    if (this.#announced) return;
    this.#announced = true;
    queueMicrotask(() => {
      this.#announced = false;
      for (const listener of this.#listeners) listener();
    });
  }
}
