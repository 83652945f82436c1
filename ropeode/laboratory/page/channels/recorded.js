// @ts-check
import { keyOf } from "../asks.js";
import { decoded } from "../wire.js";
/** @typedef {import("../store").Channel} Channel */
/** @typedef {{ask: import("../messages").Ask, wire: string}} Entry an answer's bytes in base64 */

/**
 * Answers from a recording.
 *
 * @param {import("../store").Store} store
 * @param {Entry[]} recording
 * @returns {Channel}
 */
export function recorded(store, recording) {
  const entries = new Map(recording.map((each) => [keyOf(each.ask), each.wire]));
  return {
    want(list) {
      for (const { key } of list) {
        const text = entries.get(key);
        if (text !== undefined) store.receive(key, decoded(bytes(text)).answer);
      }
      return list.filter(({ key }) => !entries.has(key));
    },
  };
}

/** @param {string} text in base64 @returns {ArrayBuffer} */
function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}
