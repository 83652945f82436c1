// @ts-check
import { Conversation } from "./conversation.js";

// What page and notebook say to each other before they talk through a port of their own.
const GREETING = "ropeode lab";

/** Whether the page is a part of another one, which has the address bar. */
export const isFramed = window.parent !== window;

/**
 * Answers from the kernel of a notebook, if the page stands in a cell of one and the kernel runs.
 *
 * @param {import("../store").Store} store
 */
export function listenToKernel(store) {
  /** @type {MessagePort | undefined} */
  let port;
  const conversation = new Conversation(store, (text) => port?.postMessage(text));
  addEventListener("message", ({ data, source, ports }) => {
    if (source !== window.parent || data !== GREETING || !ports.length) return;
    if (!port) store.channels.push(conversation);
    port = ports[0];
    port.onmessage = (message) => conversation.receive(message.data);
    conversation.begin();
  });
  window.parent.postMessage(GREETING, "*");
}
