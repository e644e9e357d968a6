// Playback of a recording: position, pause and jumps.

import { button, labelled, make, row } from "./dom.js";
import { ask } from "./server.js";

export class Playback {
  constructor(place, about, path, report) {
    place.hidden = !about.playback;
    if (!about.playback) return;
    const play = (body) => ask(`${path}/play`, body).catch((error) => report(error.message, "bad"));
    this.bar = make("input", {
      type: "range",
      id: "playback-position",
      min: 0,
      max: about.playback.end_s,
      step: "any",
      value: 0,
      onchange: () => play({ to_s: Number(this.bar.value), runs: this.runs }),
    });
    this.toggle = button("Pause", "play", () => play({ runs: !this.runs }));
    this.time = make("output", { id: "playback-time", className: "value" });
    place.append(row(this.toggle, labelled("time", this.bar), this.time));
  }

  update(playback) {
    if (!playback || !this.bar) return;
    this.runs = playback.runs;
    this.toggle.textContent = playback.runs ? "Pause" : "Play";
    this.time.textContent = `${playback.time_s.toFixed(3)} of ${playback.end_s.toFixed(3)} s`;
    if (!this.bar.matches(":active")) this.bar.value = playback.time_s;
  }
}
