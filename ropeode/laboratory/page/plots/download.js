// A plot as a file.

import { swatch } from "./marks.js";
import { svg, textOf } from "./svg.js";

// As on a light page: a file is for print.
const STYLE = `
  text { font: 12px "Liberation Sans", Arial, sans-serif; fill: #222; }
  .plot-line { fill: none; stroke-linejoin: round; stroke-linecap: round; }
  .plot-point { stroke-width: 1.5px; vector-effect: non-scaling-stroke; stroke-linejoin: round; }
  .plot-band { fill: #bbb; fill-opacity: 0.55; }
  .plot-grid { stroke: #e5e5e5; }
  .plot-frame { fill: none; stroke: #444; }
  .plot-rule line { stroke: #555; stroke-dasharray: 2 3; }
  .plot-label, .plot-text { font-weight: bold; }
  .plot-text { paint-order: stroke; stroke: white; stroke-width: 4px; }
  .plot-focus { display: none; }
`;
// Dots for each pixel: enough for print at the size of the page.
const SHARP = 3;

/** @type {Record<string, string>} */
const ON_WHITE = { "--plot-text": "#222", "--plot-truth": "#767676" };
const LINE = 18;

/**
 * @param {SVGSVGElement} picture
 * @param {import("./chart.js").Chart} chart
 * @param {string} kind "svg" or "png"
 */
export async function download(picture, chart, kind) {
  const { width, height } = picture.viewBox.baseVal;
  const entries = [...chart.legend, ...(chart.meanings ?? [])];
  const whole = { width, height: height + LINE * entries.length + 8 };
  const file = svg(
    "svg",
    { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${width} ${whole.height}`, ...whole },
    svg("title", {}, chart.title),
    svg("style", {}, STYLE),
    ...[...picture.children].map((each) => /** @type {Element} */ (each.cloneNode(true))),
    ...entries.map((each, i) => legendLine(each, height + LINE * i)),
  );
  const text = new XMLSerializer().serializeToString(file)
    .replace(/var\((--[\w-]+)\)/gu, (_, name) => ON_WHITE[name] ?? "#222");
  const drawing = new Blob([text], { type: "image/svg+xml" });
  const link = document.createElement("a");
  link.href = URL.createObjectURL(kind === "svg" ? drawing : await pixels(text, whole));
  link.download = `${chart.title.toLowerCase().replace(/\s+/gu, "-")}.${kind}`;
  link.click();
  // The browser reads it after this turn.
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** @param {import("./chart.js").Entry} each @param {number} top */
function legendLine(each, top) {
  return svg(
    "g",
    { transform: `translate(4 ${top})` },
    swatch(each),
    svg("text", { x: 36, y: 11 }, each.more ? `${each.text}: ${each.more.map(textOf).join("")}` : each.text),
  );
}

/** @param {string} text @param {{width: number, height: number}} size @returns {Promise<Blob>} */
async function pixels(text, { width, height }) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [SHARP * width, SHARP * height];
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser draws no canvas");
  context.fillStyle = "white";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png");
  });
}
