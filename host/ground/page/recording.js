// A recording: playback with position, pause and jumps; saves it and the table of its messages.

import { button, labelled, make, note, row } from "./dom.js";
import { ask, saveFile } from "./server.js";

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

export class Transcript {
  constructor(place, about, path, report) {
    const { recording, parquet } = about.missing;
    const name = about.device.toLowerCase();
    const saves = (text, id, call, end, why) =>
      button(text, id, () => saveFile(`${path}/${call}`, `${name}.${end}`, report), why);
    place.append(
      row(
        saves("Save recording", "recording", "recording", "rec", recording),
        saves("Save as CSV", "transcript-csv", "transcript/csv", "csv", recording),
        saves("Save as Parquet", "transcript-parquet", "transcript/parquet", "parquet", recording ?? parquet),
      ),
    );
    const why = [recording, parquet].filter(Boolean).join("; ");
    if (why) place.append(note(why));
  }
}
