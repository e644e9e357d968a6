// A span of an emulation's past as a waveform: to save, and the FPGA's pins around their last change.

import { labelled, make, save } from "./dom.js";
import { readVcd } from "./vcd.js";

const SPAN_S = 2; // before now, unless another one is wanted
const SHOWN = 40; // changes before the last one that are drawn at first
const ROW = 24;
const NAMES = 190; // pixels
const WIDTH = 1000;

export class Waveform {
  // `path` leads to the target, `tell(text, kind)` tells what went wrong.
  constructor(place, about, path, tell) {
    const why = about.missing.controls ?? about.missing.past;
    this.path = path;
    this.tell = tell;
    const number = (id) => make("input", { type: "number", min: 0, step: "any", id, disabled: Boolean(why) });
    this.from = number("trace-from");
    this.to = number("trace-to");
    this.told = make("p", { className: "quiet", id: "waveform-told", textContent: why ?? "" });
    const button = (text, id, onclick) =>
      make("button", { textContent: text, id, type: "button", onclick, disabled: Boolean(why), title: why ?? "" });
    this.wider = button("Wider", "wider", () => this.zoom(2));
    this.closer = button("Closer", "closer", () => this.zoom(0.5));
    this.earlier = button("Earlier", "earlier", () => this.shift(-1));
    this.later = button("Later", "later", () => this.shift(1));
    this.steps = make("div", { className: "row", hidden: true }, this.earlier, this.later, this.wider, this.closer);
    this.canvas = make("canvas", { id: "waves", width: WIDTH, hidden: true, role: "img" });
    place.append(
      make(
        "div",
        { className: "row" },
        labelled("from [s]", this.from),
        labelled("to [s]", this.to),
        button("Show pins", "show-waves", () => this.show()),
        button("Save VCD", "save-waves", () => this.save(about.device)),
      ),
      this.told,
      this.steps,
      make("div", { className: "frame" }, this.canvas),
    );
  }

  hear({ time_s }) {
    this.now = time_s;
    if (!this.to.value) this.to.placeholder = time_s?.toFixed(3);
    if (!this.from.value) this.from.placeholder = this.span()[0].toFixed(3);
  }

  // What is wanted, else the last moments.
  span() {
    const to = this.to.value ? Number(this.to.value) : this.now;
    return [this.from.value ? Number(this.from.value) : Math.max(0, to - SPAN_S), to];
  }

  async fetched() {
    const [from, to] = this.span();
    this.told.textContent = "the emulation's past is played again";
    try {
      const answer = await fetch(`${this.path}/trace?from_s=${from}&to_s=${to}`);
      if (!answer.ok) throw new Error((await answer.json()).error);
      this.told.textContent = `${from.toFixed(6)} to ${to.toFixed(6)} s`;
      return await answer.text();
    } catch (error) {
      this.told.textContent = error.message;
      this.tell(`waveform\n  ${error.message}`, "bad");
      return null;
    }
  }

  async save(device) {
    const text = await this.fetched();
    if (text === null) return;
    save(new Blob([text], { type: "text/plain" }), `${device.toLowerCase()}.vcd`);
  }

  async show() {
    const [from, to] = this.span();
    const text = await this.fetched();
    if (text === null) return;
    this.pins = readVcd(text, "fpga");
    this.canvas.hidden = this.steps.hidden = !this.pins.length;
    if (!this.pins.length) {
      this.told.textContent += ": this device has no FPGA";
      return;
    }
    const times = this.pins.flatMap(({ changes }) => changes.map(([time]) => time)).filter((time) => time > from);
    times.sort((one, other) => one - other);
    const last = times.at(-1) ?? to;
    const first = times.at(-SHOWN) ?? times[0] ?? from;
    const margin = (last - first) / 10 || (to - from) / 20;
    this.view = [first - margin, last + margin];
    this.told.textContent += `: ${times.length} changes, the last at ${last.toFixed(9)} s`;
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

// Levels of one pin as a line, those of several bits as boxes with a number.
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
