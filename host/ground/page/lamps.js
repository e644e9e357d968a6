// Flags of telemetry and supplies as lamps, and statistics of the link.

import { beside, make, note } from "./dom.js";

export class Lamps {
  // `subscribe(names)` requests telemetry frames in every update.
  constructor(place, about, subscribe) {
    this.link = make("p", { id: "link-health" });
    this.supplies = make("ul", { className: "lamps", id: "supplies" });
    const none = about.missing.controls;
    place.append(this.link, this.supplies);
    if (none) place.append(note(`supplies: ${none}`));
    this.frames = about.telemetries
      .filter((one) => one.supported && !one.changes)
      .map((one) => ({ name: one.name, flags: one.fields.filter((f) => f.type.startsWith("bool")) }))
      .filter((one) => one.flags.length);
    this.lamps = new Map();
    this.on = new Set();
    for (const { name, flags } of this.frames) {
      const list = make("ul", { className: "lamps", hidden: true });
      for (const flag of flags) {
        const lamp = make("li", { textContent: flag.name, title: flag.details });
        this.lamps.set(`${name}.${flag.name}`, lamp);
        list.append(lamp);
      }
      const read = make("input", {
        type: "checkbox",
        id: `lamps-${name}`,
        onchange: () => {
          this.on[read.checked ? "add" : "delete"](name);
          list.hidden = !read.checked;
          subscribe([...this.on]);
        },
      });
      place.append(beside(name, read), list);
    }
    if (!this.frames.length) place.append(note(`${about.device} has no flags in telemetry`));
    document.getElementById(`lamps-${this.frames[0]?.name}`)?.click();
  }

  update(values) {
    for (const name of this.on)
      for (const { name: flag } of this.frames.find((one) => one.name === name).flags) {
        const lamp = this.lamps.get(`${name}.${flag}`);
        const value = values[name]?.[flag]; // undefined without an answer
        const [kind, state] =
          value === undefined ? ["unknown", "unknown"] : value ? ["lit", "on"] : ["", "off"];
        lamp.className = kind;
        lamp.setAttribute("aria-label", `${flag} ${state}`);
      }
  }

  updateLink({ sent, answered, late, repeated, refused, streamed, failed, broken, error }) {
    this.link.className = broken ? "bad" : "quiet";
    const images = streamed ? `, ${streamed} image frames` : "";
    const last = error ? `; last error: ${error}` : "";
    this.link.textContent =
      `link: ${sent} requests, ${answered} answered, ${late} timed out, ` +
      `${repeated} retried, ${refused} refused${images}; ${failed} failed${last}`;
  }

  updateSupplies({ currents_ma }) {
    const lamps = Object.entries(currents_ma ?? {}).map(([name, current]) =>
      make("li", {
        className: current > 0 ? "powered" : "",
        textContent: `${name} ${current.toFixed(1)} mA`,
      }),
    );
    this.supplies.replaceChildren(...lamps);
  }
}
