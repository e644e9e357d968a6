// Tabs over panels, by the pattern of the ARIA guide; the address names the target and its tab.

import { make } from "./dom.js";

export class Tabs {
  // `titles` by the tabs' names; calls `changed(name)` for each choice of the user.
  constructor(titles, changed) {
    this.changed = changed;
    this.names = Object.keys(titles);
    this.list = make("div", { id: "tabs", role: "tablist" });
    this.list.setAttribute("aria-label", "functions");
    this.panels = make("div", { id: "panels" });
    for (const [index, name] of this.names.entries()) {
      const tab = make("button", {
        id: `tab-${name}`,
        role: "tab",
        type: "button",
        textContent: titles[name],
        title: `key ${index + 1}`,
        onclick: () => this.choose(name),
      });
      tab.setAttribute("aria-controls", `panel-${name}`);
      const panel = make("div", { id: `panel-${name}`, role: "tabpanel", className: "panel" });
      panel.setAttribute("aria-labelledby", tab.id);
      this.list.append(tab);
      this.panels.append(panel);
    }
    this.list.onkeydown = (event) => this.key(event);
    document.addEventListener("keydown", (event) => this.shortcut(event));
    this.show(this.names[0]);
  }

  panel(name) {
    return this.panels.querySelector(`#panel-${name}`);
  }

  show(name) {
    this.shown = this.names.includes(name) ? name : this.names[0];
    for (const one of this.names) {
      const chosen = one === this.shown;
      const tab = this.list.querySelector(`#tab-${one}`);
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      this.panel(one).hidden = !chosen;
    }
  }

  choose(name) {
    this.show(name);
    this.changed(this.shown);
  }

  key(event) {
    const at = this.names.indexOf(this.shown);
    const last = this.names.length - 1;
    const to = {
      ArrowRight: at === last ? 0 : at + 1,
      ArrowLeft: at === 0 ? last : at - 1,
      Home: 0,
      End: last,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    this.choose(this.names[to]);
    this.list.children[to].focus();
  }

  // Digits open tabs where they are not typed into a field.
  shortcut(event) {
    const number = Number(event.key);
    const types = event.target.closest("input, select, textarea, dialog, #zoom-frame");
    if (types || event.ctrlKey || event.altKey || event.metaKey || !this.names[number - 1]) return;
    this.choose(this.names[number - 1]);
  }
}
