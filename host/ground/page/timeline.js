// Named values over time as bands: those of the results, such as task and mode, and telemetry fields
// whose values have names.

import { atNextFrame, button, choose, labelled, make, note, row } from "./dom.js";
import { hasNames, valueName } from "./telemetry.js";

const SPANS_S = [60, 300, 1800];
const MOST_CHANGES = 20_000; // per band
const ROW = 42;
const TEXT = 20; // above the band
const FOOT = 22;
const PADDING = 32; // of the section, left and right
const COLOURS = ["#58a6ff", "#d29922", "#3fb950", "#db61a2", "#a98bf7", "#f0883e", "#9aa3af"];
const STRIPES = 6; // width

export class Timeline {
  // `subscribe(names)` requests telemetry frames in every update.
  constructor(place, about, subscribe) {
    this.subscribe = subscribe;
    this.drawSoon = atNextFrame(() => this.draw());
    this.bands = new Map();
    this.chosen = new Map(); // frame and field by the name of the band
    this.fields = new Map(
      about.telemetries
        .filter((one) => one.supported && !one.changes)
        .flatMap((one) => one.fields.filter(hasNames).map((field) => ({ frame: one.name, field })))
        .map((one) => [`${one.frame}.${one.field.name}`, one]),
    );
    const none = !this.fields.size;
    this.field = choose([...this.fields.keys()], { id: "band", disabled: none });
    this.span = choose(
      SPANS_S.map((span) => ({ value: String(span), textContent: `${span} s` })),
      { id: "span", onchange: () => this.draw() },
    );
    const add = button("Add band", "add-band", () => this.choose(this.field.value));
    add.disabled = none;
    this.buttons = make("div", { className: "row", id: "bands" });
    this.status = note("", { id: "timeline-status" });
    this.canvas = make("canvas", { id: "bands-canvas", width: 300, height: 1, role: "img" });
    this.canvas.setAttribute("aria-label", "named values over time");
    this.legend = make("ul", { id: "timeline-legend", className: "legend" });
    place.append(
      row(labelled("field", this.field), add, labelled("time span", this.span)),
      this.buttons,
      this.status,
      this.canvas,
      this.legend,
    );
    this.none = none ? `${about.device} has no named values in telemetry` : null;
    this.subscribe([]);
    if (about.missing.results && !none) this.choose(this.field.value);
    new ResizeObserver(() => this.draw()).observe(this.status);
  }

  choose(name) {
    if (this.chosen.has(name)) return;
    this.chosen.set(name, this.fields.get(name));
    const remove = button(`${name} ×`, "", () => {
      this.chosen.delete(name);
      this.bands.delete(name);
      remove.remove();
      this.field.focus();
      this.subscribeFrames();
      this.draw();
    });
    remove.ariaLabel = `remove the band ${name}`;
    this.buttons.append(remove);
    this.subscribeFrames();
  }

  subscribeFrames() {
    this.subscribe([...new Set([...this.chosen.values()].map((one) => one.frame))]);
  }

  // Texts by name, and telemetry by frame, at a time in seconds.
  update(words, frames, time) {
    if (this.time > time) this.bands.clear(); // it went back in time
    this.time = time;
    const found = { ...words };
    for (const [name, { frame, field }] of this.chosen) {
      const values = frames[frame];
      if (values?.[field.name] === undefined) continue;
      found[name] = valueName(field, values) ?? String(values[field.name]);
    }
    for (const [name, word] of Object.entries(found)) {
      const changes = this.bands.get(name) ?? [];
      this.bands.set(name, changes);
      const last = changes.at(-1);
      if (last) last.until = time;
      if (last?.word !== word) changes.push({ from: time, until: time, word });
      const begin = time - SPANS_S.at(-1);
      while (changes[0].until < begin || changes.length > MOST_CHANGES) changes.shift();
    }
    this.drawSoon();
  }

  draw() {
    if (!this.canvas.isConnected) return; // another target is shown
    const height = this.bands.size ? ROW * this.bands.size + FOOT : 1;
    const width = Math.max(this.canvas.parentElement.clientWidth - PADDING, 1);
    if (this.canvas.height !== height) this.canvas.height = height;
    if (this.canvas.width !== width) this.canvas.width = width;
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    if (!this.bands.size) {
      this.status.textContent = this.none ?? "no values yet";
      this.explain([]);
      return;
    }
    const text = getComputedStyle(document.body).color;
    const span = Number(this.span.value);
    const begin = Math.max(this.time - span, 0);
    const x = (time) => ((time - begin) / span) * width;
    const shown = new Set();
    pen.font = "13px system-ui, sans-serif";
    pen.textBaseline = "middle";
    pen.textAlign = "left";
    [...this.bands].forEach(([name, changes], row) => {
      const top = ROW * row;
      pen.fillStyle = text;
      pen.fillText(name, 0, top + TEXT / 2, width);
      pen.fillStyle = "#8883";
      pen.fillRect(0, top + TEXT, width, ROW - TEXT - 4);
      for (const { from, until, word } of changes) {
        if (until < begin) continue;
        const left = x(Math.max(from, begin));
        shown.add(word);
        this.band(pen, word, left, top + TEXT, Math.max(x(until) - left, 1), ROW - TEXT - 4);
      }
    });
    pen.fillStyle = text;
    pen.fillText(`${begin.toFixed(0)} s`, 0, height - FOOT / 2);
    pen.textAlign = "right";
    pen.fillText(`${(begin + span).toFixed(0)} s`, width, height - FOOT / 2);
    const words = [...this.bands].map(([name, changes]) => `${name} ${changes.at(-1).word}`);
    this.status.textContent = words.join(", ");
    this.explain([...shown].sort());
  }

  band(pen, word, left, top, wide, high) {
    const [colour, striped] = colourOf(word);
    pen.fillStyle = colour;
    pen.fillRect(left, top, wide, high);
    pen.fillStyle = "#0006";
    if (striped)
      for (let at = 0; at < wide; at += 2 * STRIPES)
        pen.fillRect(left + at, top, Math.min(STRIPES, wide - at), high);
    if (pen.measureText(word).width + 8 > wide) return;
    pen.fillStyle = striped ? "#fff" : "#000";
    pen.fillText(word, left + 4, top + high / 2);
  }

  // Lists all values below the bands, where some have no room.
  explain(words) {
    const shown = [...this.legend.children].map((one) => one.textContent);
    if (shown.join() === words.join()) return;
    this.legend.replaceChildren(
      ...words.map((word) => {
        const [colour, striped] = colourOf(word);
        const swatch = make("span", { className: striped ? "swatch striped" : "swatch" });
        swatch.style.backgroundColor = colour;
        return make("li", {}, swatch, word);
      }),
    );
  }
}

// The colour of a word, and whether it is striped: always the same ones (FNV-1a of its letters).
function colourOf(word) {
  let number = 0x811c9dc5;
  for (const letter of word) number = Math.imul(number ^ letter.codePointAt(0), 0x01000193) >>> 0;
  const kind = (number >>> 8) % (2 * COLOURS.length);
  return [COLOURS[kind % COLOURS.length], kind >= COLOURS.length];
}
