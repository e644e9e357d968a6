// Virtual time of an emulation, and its snapshots.

import { button, choose, disable, labelled, make, note, row } from "./dom.js";

export class Emulation {
  // `control(call, body)` sends a call about virtual time.
  constructor(place, about, control) {
    const why = about.missing.controls;
    this.time = make("output", { id: "time", className: "value" });
    this.state = note(why, { id: "state" });
    this.pause = button("Pause", "pause", () => control(this.held ? "resume" : "pause", {}));
    this.events = make("input", { type: "number", value: 1, min: 1, max: 100000, id: "events" });
    this.to = make("input", { type: "number", min: 0, step: "any", id: "to" });
    this.speed = choose(["0.1", "0.5", "1", "2", "5", "20", "fast"], { id: "speed", value: "1" });
    this.speed.onchange = () => {
      const fast = this.speed.value === "fast";
      control("pace", fast ? { pace: "fast" } : { pace: "real", speed: Number(this.speed.value) });
    };
    const step = () => control("step", { events: Number(this.events.value) });
    const go = () => {
      const to = Number(this.to.value);
      if (to < this.now) control("back", { to });
      else control("run", { to_s: to });
    };
    const time = row(
      this.pause,
      labelled("events", this.events),
      button("Step", "step", step),
      labelled("time [s]", this.to),
      button("Go to time", "go", go),
      labelled("speed", this.speed),
    );
    this.snapshots = choose([], { id: "snapshots" });
    const history = row(
      button("Save snapshot", "snapshot", () => control("snapshot", { name: `${this.now.toFixed(3)} s` })),
      labelled("snapshot", this.snapshots),
      button("Go back to snapshot", "back", () => control("back", { to: this.snapshots.value })),
    );
    place.append(
      make("p", {}, "virtual time ", this.time),
      note(listed(about.chosen), { id: "chosen" }),
      this.state,
      time,
      history,
    );
    if (why) disable(place, why);
    else if (about.missing.history) disable(history, about.missing.history);
  }

  update(emulation) {
    if (emulation.error) {
      this.state.textContent = emulation.error;
      this.state.className = "bad";
      return;
    }
    this.held = emulation.held;
    this.now = emulation.time_s;
    const names = Object.keys(emulation.snapshots);
    if (names.join() !== [...this.snapshots.options].map((one) => one.value).join()) {
      this.snapshots.replaceChildren(...choose(names).children);
      this.snapshots.selectedIndex = names.length - 1;
    }
    this.pause.textContent = emulation.held ? "Resume" : "Pause";
    this.pause.setAttribute("aria-pressed", String(emulation.held));
    this.time.textContent = `${emulation.time_s.toFixed(6)} s`;
    const pace = emulation.pace === "fast" ? "fast" : String(emulation.speed);
    if (document.activeElement !== this.speed) this.speed.value = pace;
    const currents = listed(emulation.currents_ma, (current) => `${current.toFixed(1)} mA`);
    const probes = listed(emulation.probes);
    const busy = emulation.held ? "paused" : emulation.busy ? "busy" : "waiting for the host";
    this.state.className = "quiet";
    this.state.textContent = `${emulation.goes_back ? "going back" : busy}; ${probes}; ${currents}`;
  }
}

function listed(values, text = String) {
  return Object.entries(values).map(([name, value]) => `${name} ${text(value)}`).join(", ");
}
