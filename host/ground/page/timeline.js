// Named values over time as bands: those of the results, such as task and mode, and telemetry fields
// whose values have names.

import { atNextFrame, button, choose, labelled, make, note, row } from "./dom.js";
import { line, sharpPen } from "./draw.js";
import { hasNames, valueName } from "./telemetry.js";
import { TimeAxis } from "./timeaxis.js";

const LONGEST_S = 1800;
const MOST_CHANGES = 20_000; // per band
const ROW = 42;
const TEXT = 20; // above the band
const FOOT = 40; // labels of the axis, and its name
const TICK = 5;
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
    const add = button("Add band", "add-band", () => this.choose(this.field.value));
    add.disabled = none;
    this.buttons = make("div", { className: "row", id: "bands" });
    this.status = note("", { id: "timeline-status" });
    this.canvas = make("canvas", { id: "bands-canvas", width: 300, height: 1, role: "img" });
    const keys = "arrow keys read values, with shift they move the time; + and - zoom, 0 follows";
    this.canvas.setAttribute("aria-label", `named values over time; ${keys}`);
    this.axis = new TimeAxis(this.canvas, LONGEST_S, this.drawSoon);
    this.clock = about.missing.controls ? "time since the page was opened, s" : "virtual time, s";
    this.legend = make("ul", { id: "timeline-legend", className: "legend" });
    place.append(
      row(labelled("field", this.field), add, ...this.axis.buttons),
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
    if (this.time > time) {
      this.bands.clear(); // it went back in time
      this.axis.follow();
    }
    this.time = this.axis.now = time;
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
      const begin = time - LONGEST_S;
      while (changes[0].until < begin || changes.length > MOST_CHANGES) changes.shift();
    }
    this.drawSoon();
  }

  draw() {
    if (!this.canvas.isConnected) return; // another target is shown
    const height = this.bands.size ? ROW * this.bands.size + FOOT : 1;
    const width = Math.max(this.canvas.parentElement.clientWidth - PADDING, 1);
    Object.assign(this.canvas.style, { width: `${width}px`, height: `${height}px` });
    const pen = sharpPen(this.canvas, width, height);
    if (!this.bands.size) {
      this.status.textContent = this.none ?? "no values yet";
      this.explain([]);
      return;
    }
    const text = getComputedStyle(document.body).color;
    const { axis } = this;
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
        if (until < axis.first || from > axis.last) continue;
        const [left, right] = [axis.x(Math.max(from, axis.first)), axis.x(Math.min(until, axis.last))];
        shown.add(word);
        this.band(pen, word, left, top + TEXT, Math.max(right - left, 1), ROW - TEXT - 4);
      }
    });
    this.drawAxis(pen, text, width, height - FOOT);
    this.status.textContent = this.read();
    this.explain([...shown].sort());
  }

  drawAxis(pen, text, width, bottom) {
    const { axis } = this;
    pen.strokeStyle = pen.fillStyle = text;
    line(pen, [0, bottom], [width, bottom]);
    for (const { time, text: label } of axis.ticks()) {
      const x = axis.x(time);
      const half = pen.measureText(label).width / 2;
      line(pen, [x, bottom], [x, bottom + TICK]);
      pen.fillText(label, Math.min(Math.max(x - half, 0), width - 2 * half), bottom + TICK + 8);
    }
    pen.fillText(this.clock, (width - pen.measureText(this.clock).width) / 2, bottom + FOOT - 8);
    if (axis.cursor === null) return;
    const x = axis.x(axis.cursor);
    line(pen, [x, 0], [x, bottom]);
  }

  // The values at the cursor, or the latest ones.
  read() {
    const { cursor } = this.axis;
    const words = [...this.bands].map(([name, changes]) => {
      const at = cursor === null ? changes.at(-1) : changes.findLast((one) => one.from <= cursor);
      return `${name} ${at && (cursor === null || at.until >= cursor) ? at.word : "–"}`;
    });
    return (cursor === null ? "" : `at ${cursor.toFixed(2)} s: `) + words.join(", ");
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
