// Shell commands that this browser saves, per kind of device.

import { button, make, row } from "./dom.js";

const MOST = 40;

export class Favourites {
  constructor(place, about, commands) {
    this.key = `cubestack lines ${about.device}`;
    this.commands = commands;
    this.list = make("ul", { className: "saved-lines", id: "saved-lines" });
    const add = () => this.add(commands.line.value.trim());
    place.append(row(button("Save this command", "save-line", add)), this.list);
    this.show();
  }

  // Empty if the browser stores nothing or something else.
  lines() {
    try {
      const lines = JSON.parse(localStorage.getItem(this.key));
      return Array.isArray(lines) ? lines.filter((line) => typeof line === "string") : [];
    } catch {
      return [];
    }
  }

  add(line) {
    if (line) this.store([line, ...this.lines().filter((one) => one !== line)].slice(0, MOST));
  }

  store(lines) {
    try {
      localStorage.setItem(this.key, JSON.stringify(lines));
    } catch {
      // The browser stores nothing.
    }
    this.show();
  }

  show() {
    const lines = this.lines();
    const items = lines.map((line) => {
      const remove = button("×", "", () => this.store(lines.filter((one) => one !== line)));
      remove.setAttribute("aria-label", `remove: ${line}`);
      return make("li", {}, button(line, "", () => this.commands.run(line)), remove);
    });
    this.list.replaceChildren(...items);
  }
}
