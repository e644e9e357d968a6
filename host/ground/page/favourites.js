// Lines of the shell that are kept in this browser, for each kind of device its own.

import { make } from "./dom.js";

const MOST = 40;

export class Favourites {
  // `commands` has the line that is typed, and does lines.
  constructor(place, about, commands) {
    this.key = `cubestack lines ${about.device}`;
    this.commands = commands;
    this.list = make("ul", { className: "kept", id: "kept" });
    const keep = make("button", {
      textContent: "Keep this line",
      id: "keep",
      type: "button",
      onclick: () => this.keep(commands.line.value.trim()),
    });
    place.append(make("div", { className: "row" }, keep), this.list);
    this.show();
  }

  // What is kept; nothing where the browser keeps nothing, or something else is there.
  lines() {
    try {
      const kept = JSON.parse(localStorage.getItem(this.key));
      return Array.isArray(kept) ? kept.filter((line) => typeof line === "string") : [];
    } catch {
      return [];
    }
  }

  keep(line) {
    if (line) this.store([line, ...this.lines().filter((one) => one !== line)].slice(0, MOST));
  }

  store(lines) {
    try {
      localStorage.setItem(this.key, JSON.stringify(lines));
    } catch {
      // the browser keeps nothing
    }
    this.show();
  }

  show() {
    const lines = this.lines();
    const rows = lines.map((line) => {
      const drop = make("button", {
        textContent: "×",
        type: "button",
        onclick: () => this.store(lines.filter((one) => one !== line)),
      });
      drop.setAttribute("aria-label", `keep no more: ${line}`);
      const act = make("button", { textContent: line, type: "button", onclick: () => this.commands.do(line) });
      return make("li", {}, act, drop);
    });
    this.list.replaceChildren(...rows);
  }
}
