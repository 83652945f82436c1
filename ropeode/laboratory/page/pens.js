// @ts-check
// Two pens with the same strokes: one draws on a canvas, one writes SVG.
/**
 * @typedef {object} Look
 * @property {string} colour
 * @property {number} [width] of a line; without it, shapes are filled
 * @property {number[]} [dash]
 * @property {number} [opacity]
 */
/**
 * @typedef {object} Pen
 * @property {(xy: ArrayLike<number>, links: [number, number][] | null, look: Look) => void} lines
 *   joins the points x, y, x, y, ... in their order, or those that are linked
 * @property {(xy: ArrayLike<number>, radius: number, look: Look) => void} dots
 * @property {(x: number, y: number, width: number, height: number, look: Look) => void} box
 * @property {(text: string, x: number, y: number, look: Look & {size: number, align?: "left" | "center" | "right", halo?: string}) => void} text
 * @property {(x: number, y: number, width: number, height: number, draw: () => void) => void} within
 *   clips what is drawn
 */

const FONT = 'system-ui, -apple-system, "Segoe UI", "Noto Sans", "Liberation Sans", sans-serif';

/** @param {CanvasRenderingContext2D} context @returns {Pen} */
export function canvasPen(context) {
  /** @param {Look} look */
  function use({ colour, width = 1, dash = [], opacity = 1 }) {
    context.strokeStyle = colour;
    context.fillStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.globalAlpha = opacity;
  }
  context.lineJoin = "round";
  return {
    lines(xy, links, look) {
      use(look);
      context.beginPath();
      if (links && !isChain(links, xy.length / 2))
        for (const [a, b] of links) {
          context.moveTo(xy[2 * a], xy[2 * a + 1]);
          context.lineTo(xy[2 * b], xy[2 * b + 1]);
        }
      else for (let k = 0; k < xy.length; k += 2) context.lineTo(xy[k], xy[k + 1]);
      context.stroke();
    },
    dots(xy, radius, look) {
      use(look);
      context.beginPath();
      for (let k = 0; k < xy.length; k += 2) {
        context.moveTo(xy[k] + radius, xy[k + 1]);
        context.arc(xy[k], xy[k + 1], radius, 0, 2 * Math.PI);
      }
      if (look.width) context.stroke();
      else context.fill();
    },
    box(x, y, width, height, look) {
      use(look);
      if (look.width) context.strokeRect(x, y, width, height);
      else context.fillRect(x, y, width, height);
    },
    text(text, x, y, look) {
      use(look);
      context.font = `${look.size}px ${FONT}`;
      context.textAlign = look.align ?? "left";
      if (look.halo) {
        context.strokeStyle = look.halo;
        context.lineWidth = 4;
        context.strokeText(text, x, y);
      }
      context.fillText(text, x, y);
    },
    within(x, y, width, height, draw) {
      context.save();
      context.beginPath();
      context.rect(x, y, width, height);
      context.clip();
      draw();
      context.restore();
    },
  };
}

/**
 * @param {number} width @param {number} height @param {string} ground colour behind it
 * @returns {{pen: Pen, text: () => string}} the second gives the file
 */
export function svgPen(width, height, ground) {
  /** @type {string[]} */
  const parts = [];
  let clips = 0;
  /** @param {number} value */
  const n = (value) => String(Math.round(value * 100) / 100);
  /** @param {Look} look @param {boolean} filled */
  function attributes({ colour, width: line, dash = [], opacity = 1 }, filled = !line) {
    const paint = filled ? `fill="${colour}"` : `fill="none" stroke="${colour}" stroke-width="${line}"`;
    const dashes = dash.length && !filled ? ` stroke-dasharray="${dash.join(" ")}"` : "";
    return paint + dashes + (opacity < 1 ? ` opacity="${opacity}"` : "");
  }
  /** @type {Pen} */
  const pen = {
    lines(xy, links, look) {
      /** @param {number} i */
      const at = (i) => `${n(xy[2 * i])},${n(xy[2 * i + 1])}`;
      const count = xy.length / 2;
      const path = links && !isChain(links, count)
        ? links.map(([a, b]) => `M${at(a)}L${at(b)}`).join("")
        : `M${Array.from({ length: count }, (_, i) => at(i)).join("L")}`;
      if (path.length > 1) parts.push(`<path d="${path}" stroke-linejoin="round" ${attributes(look, false)}/>`);
    },
    dots(xy, radius, look) {
      for (let k = 0; k < xy.length; k += 2)
        parts.push(`<circle cx="${n(xy[k])}" cy="${n(xy[k + 1])}" r="${n(radius)}" ${attributes(look)}/>`);
    },
    box(x, y, w, h, look) {
      parts.push(`<rect x="${n(x)}" y="${n(y)}" width="${n(w)}" height="${n(h)}" ${attributes(look)}/>`);
    },
    text(text, x, y, look) {
      const anchor = { left: "start", center: "middle", right: "end" }[look.align ?? "left"];
      const halo = look.halo
        ? ` stroke="${look.halo}" stroke-width="4" stroke-linejoin="round" paint-order="stroke"` : "";
      parts.push(
        `<text x="${n(x)}" y="${n(y)}" font-size="${look.size}" text-anchor="${anchor}" `
        + `fill="${look.colour}"${halo}>${escaped(text)}</text>`,
      );
    },
    within(x, y, w, h, draw) {
      const id = `clip${++clips}`;
      parts.push(
        `<clipPath id="${id}"><rect x="${n(x)}" y="${n(y)}" width="${n(w)}" height="${n(h)}"/></clipPath>`,
        `<g clip-path="url(#${id})">`,
      );
      draw();
      parts.push("</g>");
    },
  };
  return {
    pen,
    text: () => [
      `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" `
        + `height="${height}" font-family='${FONT}'>`,
      `<rect width="100%" height="100%" fill="${ground}"/>`,
      ...parts,
      "</svg>",
      "",
    ].join("\n"),
  };
}

/** @param {string} text */
function escaped(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
}

/** Whether points are joined one after the other: as one path, dashes run on across the joints. @param {[number, number][]} links @param {number} points */
function isChain(links, points) {
  return links.length === points - 1 && links.every(([a, b], i) => a === i && b === i + 1);
}
