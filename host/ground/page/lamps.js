// Flags of the telemetry and supplies as lamps, and how the link is.

import { labelled, make } from "./dom.js";

export class Lamps {
  // `want(names)` says which frames are to be read again and again.
  constructor(place, about, want) {
    this.link = make("p", { id: "link-health" });
    this.supplies = make("ul", { className: "lamps", id: "supplies" });
    const none = about.missing.controls;
    place.append(this.link, this.supplies);
    if (none)
      place.append(make("p", { className: "quiet", textContent: `supplies: ${none}` }));
    const frames = about.telemetries.filter((one) => one.supported && !one.changes);
    this.frames = frames
      .map((one) => ({ name: one.name, flags: one.fields.filter((f) => f.type.startsWith("bool")) }))
      .filter((one) => one.flags.length);
    this.lamps = new Map();
    this.on = new Set();
    for (const { name, flags } of this.frames) {
      const list = make("ul", { className: "lamps" });
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
          want([...this.on]);
        },
      });
      list.hidden = true;
      place.append(labelled(name, read, { className: "beside" }), list);
    }
    if (!this.frames.length)
      place.append(
        make("p", { className: "quiet", textContent: `${about.device} has no flags in telemetry` }),
      );
    const first = document.getElementById(`lamps-${this.frames[0]?.name}`);
    first?.click();
  }

  hear(values) {
    for (const name of this.on)
      for (const { name: flag } of this.frames.find((one) => one.name === name).flags) {
        const lamp = this.lamps.get(`${name}.${flag}`);
        const value = values[name]?.[flag]; // none where the frame did not come
        const [kind, state] =
          value === undefined ? ["unknown", "not known"] : value ? ["lit", "on"] : ["", "off"];
        lamp.className = kind;
        lamp.setAttribute("aria-label", `${flag} ${state}`);
      }
  }

  hearLink({ sent, answered, late, repeated, refused, streamed, failed, broken, error }) {
    this.link.className = broken ? "bad" : "quiet";
    const pictures = streamed ? `, ${streamed} frames of pictures` : "";
    const last = error ? `; the last: ${error}` : "";
    this.link.textContent =
      `wire: ${sent} requests, ${answered} answered, ${late} without an answer in time, ` +
      `${repeated} repeated, ${refused} refused${pictures}; in the end ${failed} failed${last}`;
  }

  hearEmulation({ currents_ma }) {
    const lamps = Object.entries(currents_ma ?? {}).map(([name, current]) =>
      make("li", {
        className: current > 0 ? "powered" : "",
        textContent: `${name} ${current.toFixed(1)} mA`,
      }),
    );
    this.supplies.replaceChildren(...lamps);
  }
}
