// @ts-check
import { askLibrary, keyOf } from "../asks.js";
import { Conversation } from "./conversation.js";
/** @typedef {import("../store").Channel} Channel */

const GREETING = { key: keyOf(askLibrary), ask: askLibrary };
// The code with which a server closes what it does not let in (RFC 6455).
const POLICY = 1008;
const FIRST_WAIT = 250;
const LONGEST_WAIT = 5000;

/**
 * Answers from Python, through a WebSocket that connects again whenever it is lost.
 *
 * @param {import("../store").Store} store
 * @param {string} address
 * @param {(own: import("../messages").OwnStepper[]) => void} reloaded called after the user's file
 *   has changed
 * @returns {Channel}
 */
export function socket(store, address, reloaded) {
  /** @type {WebSocket} */
  let open;
  let wait = FIRST_WAIT;
  const conversation = new Conversation(store, (text) => {
    if (open.readyState === WebSocket.OPEN) open.send(text);
  });

  function connect() {
    open = new WebSocket(address);
    open.binaryType = "arraybuffer";
    open.onopen = () => {
      wait = FIRST_WAIT;
      // A recording knows nothing of the user's own steppers, so Python is asked what there is.
      conversation.begin([GREETING]);
    };
    open.onmessage = ({ data }) => {
      const news = conversation.receive(data);
      if (news) reloaded(news.own);
    };
    open.onclose = ({ code, reason }) => {
      store.working = null;
      store.connection = code === POLICY ? "refused" : "lost";
      store.refused = reason;
      store.announce();
      if (code === POLICY) return;
      setTimeout(connect, wait);
      wait = Math.min(2 * wait, LONGEST_WAIT);
    };
  }

  store.connection = "connecting";
  connect();
  return conversation;
}
