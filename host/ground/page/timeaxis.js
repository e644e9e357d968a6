// The visible part of a time axis: zoomed and moved by keys, buttons, wheel or pointer, with a
// cursor at which values are read. Until it is moved it follows the present time.

import { button } from "./dom.js";

const SHORTEST_S = 1;
const STEP = 2; // of a zoom
const MOVE = 0.1; // share of the span
const CURSOR = 0.01; // the same of a key
const TICK = 90; // least distance of labels, in CSS pixels

export class TimeAxis {
  // Spans at most `longest` s; calls `changed` when what is visible, or the cursor, changes.
  constructor(canvas, longest, changed) {
    Object.assign(this, { canvas, longest, changed });
    this.now = 0;
    this.span = Math.min(60, longest);
    this.end = null; // null follows the present time
    this.cursor = null; // time, null for none
    this.following = button("Follow", "timeline-follow", () => this.follow());
    this.following.title = "show the present time; key 0";
    this.buttons = [
      button("+", "timeline-in", () => this.zoom(1 / STEP)),
      button("−", "timeline-out", () => this.zoom(STEP)),
      this.following,
    ];
    this.buttons[0].ariaLabel = this.buttons[0].title = "Shorter time span";
    this.buttons[1].ariaLabel = this.buttons[1].title = "Longer time span";
    canvas.tabIndex = 0;
    canvas.onkeydown = (event) => this.key(event);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
    canvas.onpointermove = (event) => this.point(event);
    canvas.onpointerleave = () => this.read(null);
    canvas.onblur = () => this.read(null);
    this.mark();
  }

  get last() {
    return this.end ?? Math.max(this.now, this.span);
  }

  get first() {
    return this.last - this.span;
  }

  // Place of a time in CSS pixels, and the reverse.
  x(time) {
    return ((time - this.first) / this.span) * this.canvas.clientWidth;
  }

  time(x) {
    return this.first + (x / this.canvas.clientWidth) * this.span;
  }

  // Times with a label, in round steps.
  ticks() {
    const least = (TICK / Math.max(this.canvas.clientWidth, 1)) * this.span;
    const power = 10 ** Math.floor(Math.log10(least));
    const step = power * [1, 2, 5, 10].find((one) => one * power >= least);
    const count = Math.floor(this.last / step) - Math.ceil(this.first / step) + 1;
    const digits = Math.max(0, -Math.floor(Math.log10(step)));
    return Array.from({ length: count }, (_, number) => (Math.ceil(this.first / step) + number) * step).map(
      (time) => ({ time, text: time.toFixed(digits) }),
    );
  }

  follow() {
    this.end = null;
    this.mark();
    this.changed();
  }

  // Multiplies the span, around the share `at` of its length; the present time stays in view.
  zoom(factor, at = this.end === null ? 1 : 0.5) {
    const fixed = this.first + at * this.span;
    this.span = Math.min(Math.max(this.span * factor, SHORTEST_S), this.longest);
    if (this.end !== null || at !== 1) this.place(fixed + (1 - at) * this.span);
    this.changed();
  }

  move(seconds) {
    this.place(this.last + seconds);
    this.changed();
  }

  place(end) {
    const latest = Math.max(this.now, this.span);
    this.end = end >= latest ? null : Math.max(end, this.span, this.now - this.longest + this.span);
    this.mark();
  }

  mark() {
    this.following.setAttribute("aria-pressed", String(this.end === null));
  }

  read(time) {
    this.cursor = time === null ? null : Math.min(Math.max(time, this.first), this.last);
    this.changed();
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (way && event.shiftKey) this.move(way * MOVE * this.span);
    else if (way) this.read((this.cursor ?? this.last) + way * CURSOR * this.span);
    else if (event.key === "+") this.zoom(1 / STEP);
    else if (event.key === "-") this.zoom(STEP);
    else if (event.key === "0") this.follow();
    else return;
    event.preventDefault();
  }

  wheel(event) {
    if (document.activeElement !== this.canvas && !event.ctrlKey) return; // the page scrolls
    event.preventDefault();
    this.zoom(event.deltaY < 0 ? 0.8 : 1.25, event.offsetX / this.canvas.clientWidth);
  }

  point(event) {
    if (this.canvas.hasPointerCapture(event.pointerId) && event.movementX)
      this.move((-event.movementX / this.canvas.clientWidth) * this.span);
    this.read(this.time(event.offsetX));
  }
}
