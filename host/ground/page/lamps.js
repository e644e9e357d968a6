// Flags of telemetry and supplies, and statistics of the link.

import { beside, make, note } from "./dom.js";

const SIGNS = { fault: "■", notice: "▲", state: "●" };
const LEGEND = { fault: "fault", notice: "notice", state: "state, no problem" };

export class Lamps {
  // `subscribe(names)` requests telemetry frames in every update, `show(set)` shows the flags that
  // need attention.
  constructor(place, about, subscribe, show) {
    this.show = show;
    this.link = make("p", { id: "link-health" });
    this.supplies = make("ul", { className: "lamps", id: "supplies" });
    const none = about.missing.controls;
    this.frames = about.telemetries
      .filter((one) => one.supported && !one.changes)
      .map((one) => ({ ...one, flags: one.fields.filter((field) => field.type.startsWith("bool")) }))
      .filter((one) => one.flags.length);
    this.on = new Set();
    this.places = new Map();
    const key = Object.entries(LEGEND).map(([kind, text]) =>
      make("li", { className: kind, textContent: `${SIGNS[kind]} ${text}` }),
    );
    place.append(make("ul", { className: "legend flags", id: "flags-legend" }, ...key));
    for (const frame of this.frames) this.addFrame(place, frame, subscribe);
    if (!this.frames.length) place.append(note(`${about.device} has no flags in telemetry`));
    place.append(make("h3", { textContent: "Supplies" }), this.supplies);
    if (none) place.append(note(`supplies: ${none}`));
    place.append(make("h3", { textContent: "Link" }), this.link);
    document.getElementById(`lamps-${this.frames[0]?.name}`)?.click();
  }

  addFrame(place, { name, meaning }, subscribe) {
    const set = make("ul", { className: "flags", id: `set-${name}` });
    const idle = make("ul", { className: "lamps" });
    const summary = make("summary", { textContent: "not set" });
    const shown = make("div", { hidden: true }, set, make("details", {}, summary, idle));
    this.places.set(name, { set, idle, summary });
    const read = make("input", {
      type: "checkbox",
      id: `lamps-${name}`,
      onchange: () => {
        this.on[read.checked ? "add" : "delete"](name);
        shown.hidden = !read.checked;
        subscribe([...this.on]);
      },
    });
    const label = beside(name, read);
    label.title = meaning;
    place.append(label, shown);
  }

  update(values) {
    const urgent = new Map(); // by the flag's own name, which two frames may show
    for (const frame of this.frames.filter(({ name }) => this.on.has(name))) {
      const { set, idle, summary } = this.places.get(frame.name);
      const now = values[frame.name] ?? {};
      const isSet = (flag) => now[flag.name] === true || now[flag.name] === 1;
      const known = frame.flags.filter((flag) => flag.name in now);
      const raised = known.filter(isSet);
      replace(set, raised, described);
      replace(idle, frame.flags.filter((flag) => !isSet(flag)), (flag) => resting(flag, now));
      summary.textContent = `${frame.flags.length - raised.length} not set${known.length ? "" : "; unknown"}`;
      for (const flag of raised)
        if (flag.severity !== "state") urgent.set(flag.flag || flag.name, flag);
    }
    this.show([...urgent.values()].sort((a, b) => a.severity.localeCompare(b.severity)).map(described));
  }

  updateLink({ sent, answered, late, repeated, refused, streamed, failed, broken, error }) {
    this.link.className = broken ? "bad" : "quiet";
    const images = streamed ? `, ${streamed} image frames` : "";
    const last = error ? `; last error: ${error}` : "";
    this.link.textContent =
      `${sent} requests, ${answered} answered, ${late} timed out, ` +
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

// Rebuilds a list only if other flags stand in it, so that it can be read and selected.
function replace(list, flags, element) {
  const elements = flags.map(element);
  const texts = elements.map((one) => one.textContent);
  if (texts.join("\n") !== [...list.children].map((one) => one.textContent).join("\n"))
    list.replaceChildren(...elements);
}

function described(flag) {
  const sign = make("span", { className: "sign", textContent: SIGNS[flag.severity] });
  sign.setAttribute("aria-label", LEGEND[flag.severity]);
  const group = flag.group ? `${flag.group}: ` : "";
  return make("li", { className: flag.severity }, sign, ` ${flag.name} `, make("span", { className: "quiet", textContent: `${group}${flag.meaning}` }));
}

function resting(flag, now) {
  const unknown = !(flag.name in now);
  const text = unknown ? `${flag.name} unknown` : flag.name;
  return make("li", { className: unknown ? "unknown" : "", textContent: text, title: flag.details });
}
