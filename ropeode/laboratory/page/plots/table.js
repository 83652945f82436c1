// The values of a plot as a table, which is made when it is opened.

import { html } from "./svg.js";

/**
 * @param {import("./figure.js").Say} say
 * @param {() => import("./chart.js").Chart["table"] | undefined} values
 */
export function table(say, values) {
  const place = html("div", { class: "plot-table" });
  const summary = html("summary", {}, say("plots.table"));
  const element = html("details", { class: "plot-values" }, summary, place);
  const refresh = () => {
    const found = element.open ? values() : undefined;
    if (!found) return place.replaceChildren();
    const head = found.head.map((each) => html("th", { scope: "col" }, each));
    const rows = found.rows.map((row) => html("tr", {}, ...row.map((each) => html("td", {}, each))));
    return place.replaceChildren(
      html("table", {}, html("thead", {}, html("tr", {}, ...head)), html("tbody", {}, ...rows)),
    );
  };
  element.addEventListener("toggle", refresh);
  return { element, refresh };
}
