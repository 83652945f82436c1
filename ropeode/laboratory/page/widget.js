// @ts-check
// The lab in a cell of a notebook: the page in a frame, and a port between it and the kernel. It is
// a module of its own, as anywidget has them; the page that it shows is a text of the widget.

/**
 * @typedef {object} Model the widget in the kernel, as anywidget shows it
 * @property {(name: string) => any} get
 * @property {(content: {page: string, text?: string}) => void} send
 * @property {(event: "msg:custom", heard: (content: any, buffers: DataView[]) => void) => void} on
 * @property {(event: "msg:custom", heard: (content: any, buffers: DataView[]) => void) => void} off
 */

const GREETING = "ropeode lab";

/**
 * @param {{model: Model, el: HTMLElement}} view
 * @returns {() => void} called when the cell is cleared
 */
function render({ model, el }) {
  const name = `${Date.now()} ${Math.random()}`;
  const frame = document.createElement("iframe");
  frame.title = "ropeode lab";
  // It has nothing to do with the notebook's own address and its rights.
  frame.setAttribute("sandbox", "allow-scripts allow-downloads");
  frame.allow = "clipboard-write";
  frame.style.cssText = `width: 100%; height: ${model.get("height")}px; border: 0`;
  frame.srcdoc = model.get("page");
  /** @type {MessagePort | undefined} */
  let port;

  /** @param {MessageEvent} event */
  function greeted({ data, source }) {
    // Where no kernel runs, nobody answers, and the page plays what is recorded in it.
    if (source === frame.contentWindow && data === GREETING) model.send({ page: name });
  }

  /** @param {{page: string, text?: string}} content @param {DataView[]} buffers */
  function heard({ page, text }, buffers) {
    if (page !== name) return;
    if (text !== undefined) port?.postMessage(text);
    else if (buffers.length) {
      const { buffer, byteOffset, byteLength } = buffers[0];
      const bytes = buffer.slice(byteOffset, byteOffset + byteLength);
      port?.postMessage(bytes, [/** @type {ArrayBuffer} */ (bytes)]);
    } else open();
  }

  function open() {
    const channel = new MessageChannel();
    port = channel.port1;
    port.onmessage = ({ data }) => model.send({ page: name, text: data });
    frame.contentWindow?.postMessage(GREETING, "*", [channel.port2]);
  }

  window.addEventListener("message", greeted);
  model.on("msg:custom", heard);
  el.append(frame);
  return () => {
    window.removeEventListener("message", greeted);
    model.off("msg:custom", heard);
    if (port) model.send({ page: name, text: '{"want": []}' });
  };
}

export default { render };
