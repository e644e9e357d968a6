// A past time span as a waveform: the FPGA's pins around their last change, and a VCD file.

import { button, disabledIf, labelled, make, note, row, save } from "./dom.js";
import { fetched } from "./server.js";

const SPAN_S = 2; // default span, up to the current time
const SHOWN = 40; // last changes that are shown at first
const ROW = 24;
const NAMES = 190; // pixels
const WIDTH = 1000;
const UNITS = { s: 1, ms: 1e-3, us: 1e-6, ns: 1e-9, ps: 1e-12 }; // of VCD files

export class Waveform {
  constructor(place, about, path, report) {
    const why = about.missing.controls ?? about.missing.history;
    this.path = path;
    this.report = report;
    const number = (id) => make("input", { type: "number", min: 0, step: "any", id, ...disabledIf(why) });
    this.from = number("trace-from");
    this.to = number("trace-to");
    this.status = note(why, { id: "waveform-status" });
    this.steps = row(
      button("Earlier", "earlier", () => this.shift(-1)),
      button("Later", "later", () => this.shift(1)),
      button("Zoom out", "waves-out", () => this.zoom(2)),
      button("Zoom in", "waves-in", () => this.zoom(0.5)),
    );
    this.steps.hidden = true;
    this.canvas = make("canvas", { id: "waves", width: WIDTH, hidden: true, role: "img" });
    place.append(
      row(
        labelled("from [s]", this.from),
        labelled("to [s]", this.to),
        button("Show pins", "show-waves", () => this.show(), why),
        button("Save VCD", "save-waves", () => this.save(about.device), why),
      ),
      this.status,
      this.steps,
      make("div", { className: "frame", tabIndex: 0, role: "group", ariaLabel: "waveform" }, this.canvas),
    );
  }

  update({ time_s }) {
    this.now = time_s;
    if (!this.to.value) this.to.placeholder = time_s?.toFixed(3);
    if (!this.from.value) this.from.placeholder = this.span()[0].toFixed(3);
  }

  // The entered time span, or the default.
  span() {
    const to = this.to.value ? Number(this.to.value) : this.now;
    return [this.from.value ? Number(this.from.value) : Math.max(0, to - SPAN_S), to];
  }

  async fetch() {
    const [from, to] = this.span();
    this.status.textContent = "replaying the recording";
    try {
      const answer = await fetched(`${this.path}/trace?from_s=${from}&to_s=${to}`);
      this.status.textContent = `${from.toFixed(6)} to ${to.toFixed(6)} s`;
      return await answer.text();
    } catch (error) {
      this.status.textContent = error.message;
      this.report(`waveform\n  ${error.message}`, "bad");
      return null;
    }
  }

  async save(device) {
    const text = await this.fetch();
    if (text === null) return;
    save(new Blob([text], { type: "text/plain" }), `${device.toLowerCase()}.vcd`);
  }

  async show() {
    const [from, to] = this.span();
    const text = await this.fetch();
    if (text === null) return;
    this.pins = readVcd(text, "fpga");
    this.canvas.hidden = this.steps.hidden = !this.pins.length;
    if (!this.pins.length) {
      this.status.textContent += ": this device has no FPGA";
      return;
    }
    const times = this.pins.flatMap(({ changes }) => changes.map(([time]) => time)).filter((time) => time > from);
    times.sort((one, other) => one - other);
    const last = times.at(-1) ?? to;
    const first = times.at(-SHOWN) ?? times[0] ?? from;
    const margin = (last - first) / 10 || (to - from) / 20;
    this.view = [first - margin, last + margin];
    this.status.textContent += `: ${times.length} changes, the last at ${last.toFixed(9)} s`;
    this.draw();
  }

  zoom(factor) {
    const [from, to] = this.view;
    const [middle, half] = [(from + to) / 2, ((to - from) / 2) * factor];
    this.view = [middle - half, middle + half];
    this.draw();
  }

  shift(steps) {
    const by = (steps * (this.view[1] - this.view[0])) / 2;
    this.view = this.view.map((time) => time + by);
    this.draw();
  }

  draw() {
    const [from, to] = this.view;
    this.canvas.height = (this.pins.length + 1) * ROW;
    this.canvas.setAttribute("aria-label", `pins from ${from.toFixed(9)} to ${to.toFixed(9)} s`);
    const pen = this.canvas.getContext("2d");
    const colour = getComputedStyle(this.canvas).color;
    const x = (time) => NAMES + ((time - from) / (to - from)) * (WIDTH - NAMES);
    pen.font = "13px ui-monospace, monospace";
    pen.fillStyle = colour;
    this.pins.forEach((pin, row) => {
      pen.fillStyle = colour;
      pen.fillText(pin.name, 0, row * ROW + ROW - 7, NAMES - 8);
      pen.strokeStyle = "#2f81f7";
      drawPin(pen, pin, row * ROW + 4, x, colour);
    });
    pen.fillStyle = colour;
    const bottom = (this.pins.length + 1) * ROW - 7;
    pen.fillText(`${from.toFixed(9)} s`, NAMES, bottom);
    pen.textAlign = "right";
    pen.fillText(`${((to - from) * 1e6).toFixed(3)} µs wide`, WIDTH, bottom);
    pen.textAlign = "left";
  }
}

// Draws one bit as a line, several bits as boxes with their hexadecimal value.
function drawPin(pen, { bits, changes }, top, x, colour) {
  const bottom = top + ROW - 8;
  pen.beginPath();
  changes.forEach(([time, value], index) => {
    const begin = Math.max(NAMES, x(time));
    const end = Math.min(WIDTH, x(changes[index + 1]?.[0] ?? Infinity));
    if (end < NAMES || begin > WIDTH) return;
    if (bits > 1) {
      pen.rect(begin, top, end - begin, bottom - top);
      pen.fillStyle = colour;
      const text = /^[01]+$/.test(value) ? parseInt(value, 2).toString(16) : value;
      if (end - begin > 8 * text.length + 4) pen.fillText(text, begin + 3, bottom - 2);
      return;
    }
    const level = { 0: bottom, 1: top }[value] ?? (top + bottom) / 2;
    if (index && x(time) >= NAMES) pen.lineTo(begin, level);
    else pen.moveTo(begin, level);
    pen.lineTo(end, level);
  });
  pen.stroke();
}

// Variables of the scope `within` in a VCD file: name, bits, and changes [time in s, value].
function readVcd(text, within) {
  const variables = new Map();
  const scopes = [];
  let unit = 1e-9;
  let time = 0;
  for (const line of text.split("\n")) {
    const words = line.trim().split(/\s+/);
    if (words[0] === "$timescale") unit = Number(words[1]) * UNITS[words[2]];
    else if (words[0] === "$scope") scopes.push(words[2]);
    else if (words[0] === "$upscope") scopes.pop();
    else if (words[0] === "$var" && scopes.at(-1) === within)
      variables.set(words[3], { name: words[4], bits: Number(words[2]), changes: [] });
    else if (line[0] === "#") time = Number(line.slice(1)) * unit;
    else {
      const long = words.length === 2 && /^[bBsSrR]/.test(line);
      const code = long ? words[1] : words[0].slice(1);
      const value = long ? words[0].slice(1) : words[0][0];
      const changes = variables.get(code)?.changes;
      if (changes && changes.at(-1)?.[1] !== value) changes.push([time, value]);
    }
  }
  return [...variables.values()];
}
