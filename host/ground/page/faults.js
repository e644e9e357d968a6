// Faults and load switches of an emulation.

import { button, choose, disable, labelled, make, note, row } from "./dom.js";
import { confirmed } from "./confirm.js";

export class Faults {
  // `execute(line)` executes a line of the shell.
  constructor(place, about, execute) {
    const why = about.missing.controls;
    this.fault = choose(about.faults, { id: "fault" });
    this.parameters = make("input", { id: "parameters", size: 26, placeholder: "for_s=2" });
    this.help = note("", { id: "fault-help" });
    this.fault.onchange = () => this.explain(about);
    const faults = make(
      "form",
      {
        onsubmit: (event) => {
          event.preventDefault();
          execute(`fault ${this.fault.value} ${this.parameters.value}`.trim());
        },
      },
      labelled("fault", this.fault),
      labelled("parameters", this.parameters),
      make("button", { className: "main", id: "inject", textContent: "Inject fault" }),
    );
    const power = async (channel, to) => {
      if (to === "off" && !(await confirmed(`Switch ${channel} off`, "What it supplies stops.")))
        return;
      execute(`power ${channel} ${to}`);
    };
    const switches = about.channels.map((channel) =>
      row(
        `${channel}:`,
        button("Switch on", `${channel}-on`, () => power(channel, "on")),
        button("Switch off", `${channel}-off`, () => power(channel, "off")),
      ),
    );
    place.append(faults, this.help, make("h3", { textContent: "Load switches" }), ...switches);
    if (!switches.length) place.append(note("none"));
    if (why) {
      place.append(note(why));
      disable(place, why);
    } else this.explain(about);
  }

  explain(about) {
    const names = about.fault_parameters[this.fault.value.split(" ")[0]] ?? [];
    this.help.textContent = names.length ? `parameters, all optional: ${names.map((name) => `${name}=`).join(" ")}` : "";
    this.parameters.placeholder = names.slice(0, 2).map((name) => `${name}=`).join(" ");
  }
}
