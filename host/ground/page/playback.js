// A recording that is played: where it is, to hold, and to go elsewhere in it.

import { labelled, make } from "./dom.js";
import { ask } from "./server.js";

export class Playback {
  // `path` leads to the target, `tell(text, kind)` tells what went wrong.
  constructor(place, about, path, tell) {
    place.hidden = !about.played;
    if (!about.played) return;
    const play = (body) => ask(`${path}/play`, body).catch((error) => tell(error.message, "bad"));
    this.bar = make("input", {
      type: "range",
      id: "played-to",
      min: 0,
      max: about.played.end_s,
      step: "any",
      value: 0,
      onchange: () => play({ to_s: Number(this.bar.value), runs: this.runs }),
    });
    this.hold = make("button", { id: "play", type: "button", onclick: () => play({ runs: !this.runs }) });
    this.time = make("output", { id: "played-time", className: "value" });
    place.append(make("div", { className: "row" }, this.hold, labelled("time", this.bar), this.time));
  }

  hear(played) {
    if (!played || !this.bar) return;
    this.runs = played.runs;
    this.hold.textContent = played.runs ? "Hold" : "Play";
    this.time.textContent = `${played.time_s.toFixed(3)} of ${played.end_s.toFixed(3)} s`;
    if (!this.bar.matches(":active")) this.bar.value = played.time_s;
  }
}
