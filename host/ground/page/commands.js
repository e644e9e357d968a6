// Forms for telecommands, generated from the device's tables, and the shell with saved commands.

import { button, choose, disabledIf, labelled, make, note, row } from "./dom.js";
import { confirmed } from "./confirm.js";

const HISTORY = 30;
const MOST = 40; // saved commands

export class Commands {
  // `execute(line)` executes a line of the shell.
  constructor(place, about, execute) {
    this.about = about;
    this.execute = execute;
    const supported = about.telecommands.filter((one) => one.supported);
    this.byName = new Map(supported.map((one) => [one.name, one]));
    this.name = make("select", { id: "command", onchange: () => this.show() });
    const groups = { "safe": (one) => !one.risk, "asks first": (one) => one.risk };
    for (const [label, belongs] of Object.entries(groups)) {
      const names = supported.filter(belongs).map((one) => make("option", { textContent: one.name }));
      if (names.length) this.name.append(make("optgroup", { label }, ...names));
    }
    this.meaning = note();
    this.fields = make("form", { onsubmit: (event) => this.send(event) });
    this.line = make("input", {
      id: "line",
      size: 34,
      placeholder: "read Identification",
      autocomplete: "off",
      spellcheck: false,
      list: "history",
    });
    this.history = make("datalist", { id: "history" });
    const shell = make(
      "form",
      { onsubmit: (event) => this.submit(event) },
      labelled("shell command", this.line),
      make("button", { textContent: "Run" }),
      this.history,
    );
    place.append(row(labelled("telecommand", this.name)), this.meaning, this.fields, shell);
    for (const [what, why] of Object.entries(about.missing))
      if (["bench", "raw", "send"].includes(what)) place.append(note(`no ${what}: ${why}`));
    this.show();
  }

  show() {
    const one = this.byName.get(this.name.value);
    if (!one) return;
    const risk = one.risk ? ` (${one.risk})` : "";
    this.meaning.textContent = `${one.id}: ${one.meaning}${risk}`;
    const inputs = one.fields.map((field) => labelled(field.name, input(field)));
    const state = disabledIf(this.about.missing.send);
    const send = make("button", {
      className: one.risk ? "risk" : "main",
      id: "send",
      textContent: one.risk ? "Send …" : "Send",
      ...state,
    });
    this.fields.replaceChildren(...inputs, send);
  }

  async send(event) {
    event.preventDefault();
    const { name, risk } = this.byName.get(this.name.value);
    if (risk && !(await confirmed(`Send ${name}`, `${risk[0].toUpperCase()}${risk.slice(1)}.`))) return;
    const values = [...this.fields.elements]
      .filter((element) => element.name)
      .map((element) => `${element.name}='${element.value.replaceAll("'", "")}'`);
    this.run(["write", name, ...values].join(" "));
  }

  submit(event) {
    event.preventDefault();
    if (this.line.value.trim()) this.run(this.line.value);
    this.line.select();
  }

  run(line) {
    const known = [...this.history.options].find((option) => option.value === line);
    if (known) known.remove();
    this.history.prepend(make("option", { value: line }));
    while (this.history.options.length > HISTORY) this.history.lastChild.remove();
    this.execute(line);
  }
}

function input(field) {
  const common = { name: field.name, title: field.details, required: true };
  if (field.choices) {
    const options = Object.keys(field.choices);
    const made = choose(options, common);
    const reset = options.find((name) => field.choices[name] === field.reset);
    if (reset) made.value = reset;
    return made;
  }
  if (field.type === "bool1") {
    const made = choose(["false", "true"], common);
    made.value = String(Boolean(field.reset));
    return made;
  }
  if (field.type.startsWith("bytes"))
    return make("input", { ...common, value: field.reset ?? "", pattern: "([0-9a-fA-F]{2})*" });
  const limits = { step: "any", value: field.reset ?? 0 };
  if (field.minimum !== null) limits.min = field.minimum;
  if (field.maximum !== null && field.also === null) limits.max = field.maximum;
  return make("input", { ...common, ...limits, type: "number" });
}

// Shell commands that this browser saves, per kind of device.
export class Favourites {
  constructor(place, about, commands) {
    this.key = `cubestack lines ${about.device}`;
    this.commands = commands;
    this.list = make("ul", { className: "saved-lines", id: "saved-lines" });
    const add = () => this.add(commands.line.value.trim());
    place.append(row(button("Save this command", "save-line", add)), this.list);
    this.show();
  }

  // Empty if the browser stores nothing or something else.
  lines() {
    try {
      const lines = JSON.parse(localStorage.getItem(this.key));
      return Array.isArray(lines) ? lines.filter((line) => typeof line === "string") : [];
    } catch {
      return [];
    }
  }

  add(line) {
    if (line) this.store([line, ...this.lines().filter((one) => one !== line)].slice(0, MOST));
  }

  store(lines) {
    try {
      localStorage.setItem(this.key, JSON.stringify(lines));
    } catch {
      // The browser stores nothing.
    }
    this.show();
  }

  show() {
    const lines = this.lines();
    const items = lines.map((line) => {
      const remove = button("×", "", () => this.store(lines.filter((one) => one !== line)));
      remove.setAttribute("aria-label", `remove: ${line}`);
      return make("li", {}, button(line, "", () => this.commands.run(line)), remove);
    });
    this.list.replaceChildren(...items);
  }
}
