// Words that a device answers, task, mode or state, as bands over time.

import { make } from "./dom.js";

const SPAN_S = 60;
const KEPT = 20_000; // changes of a word
const ROW = 30;
const NAMES = 110; // columns of the bands' names
const FOOT = 22;
const PADDING = 32; // of what it stands in, left and right
const COLOURS = ["#2f81f7", "#d29922", "#3fb950", "#db61a2", "#a371f7", "#f0883e", "#8b949e"];

export class Timeline {
  constructor(place, about) {
    this.bands = new Map();
    this.colours = new Map();
    this.told = make("p", { className: "quiet", id: "timeline-told" });
    this.canvas = make("canvas", { id: "timeline", width: 300, height: ROW, role: "img" });
    this.canvas.setAttribute("aria-label", "words that the device answered over time");
    place.append(this.told, this.canvas);
    this.told.textContent = about.missing.results
      ? "shows what is shown in telemetry"
      : `last ${SPAN_S} s`;
  }

  // Words by name, at a time in seconds.
  hear(words, time) {
    if (this.time > time) this.bands.clear(); // it went back
    this.time = time;
    for (const [name, word] of Object.entries(words)) {
      const changes = this.bands.get(name) ?? [];
      this.bands.set(name, changes);
      const last = changes.at(-1);
      if (last?.word === word) last.until = time;
      else changes.push({ from: last?.until ?? time, until: time, word });
      if (changes.length > KEPT) changes.shift();
    }
    if (this.bands.size) this.draw();
  }

  colour(word) {
    if (!this.colours.has(word))
      this.colours.set(word, COLOURS[this.colours.size % COLOURS.length]);
    return this.colours.get(word);
  }

  draw() {
    const height = ROW * this.bands.size + FOOT;
    const width = this.canvas.parentElement.clientWidth - PADDING;
    if (this.canvas.height !== height) this.canvas.height = height;
    if (this.canvas.width !== width) this.canvas.width = width;
    const pen = this.canvas.getContext("2d");
    const text = getComputedStyle(document.body).color;
    const begin = Math.max(this.time - SPAN_S, 0);
    const x = (time) => NAMES + ((time - begin) / SPAN_S) * (width - NAMES);
    pen.clearRect(0, 0, width, height);
    pen.font = "13px system-ui, sans-serif";
    pen.textBaseline = "middle";
    [...this.bands].forEach(([name, changes], row) => {
      const top = ROW * row;
      pen.fillStyle = text;
      pen.fillText(name, 0, top + ROW / 2, NAMES - 8);
      for (const { from, until, word } of changes) {
        if (until < begin) continue;
        const left = x(Math.max(from, begin));
        const wide = Math.max(x(until) - left, 1);
        pen.fillStyle = this.colour(word);
        pen.fillRect(left, top + 4, wide, ROW - 8);
        if (pen.measureText(word).width + 8 > wide) continue;
        pen.fillStyle = "#000";
        pen.fillText(word, left + 4, top + ROW / 2);
      }
    });
    const words = [...this.bands].map(([name, changes]) => `${name} ${changes.at(-1).word}`);
    this.told.textContent = words.join(", ");
    pen.fillStyle = text;
    pen.textAlign = "left";
    pen.fillText(`${begin.toFixed(0)} s`, NAMES, height - FOOT / 2);
    pen.textAlign = "right";
    pen.fillText(`${(begin + SPAN_S).toFixed(0)} s`, width, height - FOOT / 2);
    pen.textAlign = "left";
  }
}
