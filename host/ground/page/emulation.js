// What only an emulation lets one do: hold its time, and disturb it.

import { choose, labelled, make } from "./dom.js";

export class Emulation {
  // `steer(call, body)` asks the emulation, `act(line)` does a line of the shell.
  constructor(place, about, steer, act) {
    const why = about.missing.controls;
    this.time = make("output", { id: "time", className: "value" });
    this.state = make("p", { className: "quiet", id: "state" });
    const button = (text, id, click) =>
      make("button", { textContent: text, id, type: "button", onclick: click });
    this.held = button("Pause", "pause", () => steer(this.isHeld ? "resume" : "pause", {}));
    this.events = make("input", { type: "number", value: 1, min: 1, max: 100000, id: "events" });
    this.to = make("input", { type: "number", min: 0, step: "any", id: "to" });
    this.speed = choose(["0.1", "0.5", "1", "2", "5", "20", "fast"], { id: "speed", value: "1" });
    this.speed.onchange = () => {
      const fast = this.speed.value === "fast";
      steer("pace", fast ? { pace: "fast" } : { pace: "real", speed: Number(this.speed.value) });
    };
    const step = () => steer("step", { events: Number(this.events.value) });
    const go = () => {
      const to = Number(this.to.value);
      if (to < this.now) steer("back", { to });
      else steer("run", { to_s: to });
    };
    const time = make(
      "div",
      { className: "row" },
      this.held,
      labelled("events", this.events),
      button("Step", "step", step),
      labelled("to [s]", this.to),
      button("Go", "go", go),
      labelled("speed", this.speed),
    );
    this.snapshots = choose([], { id: "snapshots" });
    const take = () => steer("snapshot", { name: `${this.now.toFixed(3)} s` });
    const back = () => steer("back", { to: this.snapshots.value });
    const past = make(
      "div",
      { className: "row" },
      button("Snapshot", "snapshot", take),
      labelled("snapshots", this.snapshots),
      button("Go back", "back", back),
    );
    this.fault = choose(about.faults, { id: "fault" });
    this.parameters = make("input", { id: "parameters", size: 26, placeholder: "for_s=2" });
    this.fault.onchange = () => {
      const names = about.fault_parameters[this.fault.value.split(" ")[0]] ?? [];
      this.parameters.title = names.length ? `${names.join("=, ")}=` : "";
      this.parameters.placeholder = names.slice(0, 2).map((name) => `${name}=`).join(" ");
    };
    const faults = make(
      "form",
      {
        onsubmit: (event) => {
          event.preventDefault();
          act(`fault ${this.fault.value} ${this.parameters.value}`.trim());
        },
      },
      labelled("fault", this.fault),
      labelled("parameters", this.parameters),
      make("button", { className: "main", id: "inject", textContent: "Inject" }),
    );
    this.channels = make("div", { className: "row" });
    for (const channel of about.channels)
      for (const to of ["on", "off"])
        this.channels.append(
          button(`${channel} ${to}`, `${channel}-${to}`, () => act(`power ${channel} ${to}`)),
        );
    const chosen = Object.entries(about.chosen).map(([name, value]) => `${name} ${value}`);
    place.append(
      make("p", {}, "virtual time ", this.time),
      make("p", { className: "quiet", id: "chosen", textContent: chosen.join(", ") }),
      this.state,
      time,
      past,
      faults,
      this.channels,
    );
    if (why) this.state.textContent = why;
    if (why) grey(place, why);
    else if (about.missing.past) grey(past, about.missing.past);
  }

  hear(emulation) {
    if (emulation.error) {
      this.state.textContent = emulation.error;
      this.state.className = "bad";
      return;
    }
    this.isHeld = emulation.held;
    this.now = emulation.time_s;
    const names = Object.keys(emulation.snapshots);
    if (names.join() !== [...this.snapshots.options].map((one) => one.value).join()) {
      this.snapshots.replaceChildren(...choose(names).children);
      this.snapshots.selectedIndex = names.length - 1;
    }
    this.held.textContent = emulation.held ? "Resume" : "Pause";
    this.held.setAttribute("aria-pressed", String(emulation.held));
    this.time.textContent = `${emulation.time_s.toFixed(6)} s`;
    const pace = emulation.pace === "fast" ? "fast" : String(emulation.speed);
    if (document.activeElement !== this.speed) this.speed.value = pace;
    const currents = Object.entries(emulation.currents_ma)
      .map(([name, current]) => `${name} ${current.toFixed(1)} mA`)
      .join(", ");
    const probes = Object.entries(emulation.probes)
      .map(([name, value]) => `${name} ${value}`)
      .join(", ");
    const busy = emulation.held ? "held" : emulation.busy ? "at work" : "waits for the host";
    this.state.className = "quiet";
    this.state.textContent = `${emulation.goes_back ? "goes back" : busy}; ${probes}; ${currents}`;
  }
}

function grey(place, why) {
  for (const one of place.querySelectorAll("button, input, select, textarea")) {
    one.disabled = true;
    one.title = why;
  }
}
