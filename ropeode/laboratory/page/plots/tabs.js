// Tabs over one panel, as the ARIA pattern has them: one stop of the tab key, arrows between them.

import { html } from "./svg.js";

let number = 0;

export class Tabs {
  /**
   * @param {string} label of the group
   * @param {{name: string, label: string}[]} tabs
   * @param {Element} content what all tabs show, each in its own way
   * @param {(name: string) => void} choose
   */
  constructor(label, tabs, content, choose) {
    number += 1;
    const id = `tabs-${number}`;
    this.choose = choose;
    this.tabs = tabs.map(({ name, label: words }) => {
      const attributes = { type: "button", role: "tab", id: `${id}-${name}`, "aria-controls": id };
      const tab = html("button", attributes, words);
      tab.dataset.name = name;
      tab.addEventListener("click", () => choose(name));
      tab.addEventListener("keydown", (event) => this.#turn(event));
      return tab;
    });
    this.panel = html("div", { role: "tabpanel", id, class: "tab-panel" }, content);
    const list = html("div", { role: "tablist", "aria-label": label, class: "tabs" }, ...this.tabs);
    this.element = html("div", { class: "tab-group" }, list, this.panel);
  }

  /** @param {string} name */
  select(name) {
    for (const tab of this.tabs) {
      const chosen = tab.dataset.name === name;
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      if (chosen) this.panel.setAttribute("aria-labelledby", tab.id);
    }
  }

  /** @param {KeyboardEvent} event */
  #turn(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const many = this.tabs.length;
    const at = this.tabs.findIndex((tab) => tab === event.currentTarget);
    const next = this.tabs[(at + step + many) % many];
    next.focus();
    this.choose(next.dataset.name ?? "");
  }
}
