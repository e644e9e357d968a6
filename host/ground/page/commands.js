// Forms made of the device's own tables, and the shell's words for whatever has none.

import { choose, labelled, make } from "./dom.js";

const HISTORY = 30;

export class Commands {
  // `act(line)` does a line of the shell, and tells of it.
  constructor(place, about, act) {
    this.about = about;
    this.act = act;
    const supported = about.telecommands.filter((one) => one.supported);
    this.byName = new Map(supported.map((one) => [one.name, one]));
    this.name = choose([...this.byName.keys()], { id: "command", onchange: () => this.show() });
    this.meaning = make("p", { className: "quiet" });
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
      { onsubmit: (event) => this.say(event) },
      labelled("in the shell's words", this.line),
      make("button", { textContent: "Do" }),
      this.history,
    );
    const row = make("div", { className: "row" }, labelled("telecommand", this.name));
    place.append(row, this.meaning, this.fields, shell);
    const missing = Object.entries(about.missing).filter(([what]) => ["bench", "raw", "send"].includes(what));
    for (const [what, why] of missing)
      place.append(make("p", { className: "quiet", textContent: `no ${what}: ${why}` }));
    this.show();
  }

  show() {
    const one = this.byName.get(this.name.value);
    if (!one) return;
    this.meaning.textContent = `${one.id}: ${one.meaning}`;
    const inputs = one.fields.map((field) => labelled(field.name, input(field)));
    const why = this.about.missing.send;
    const state = { disabled: Boolean(why), title: why ?? "" };
    const send = make("button", { className: "main", id: "send", textContent: "Send", ...state });
    this.fields.replaceChildren(...inputs, send);
  }

  send(event) {
    event.preventDefault();
    const values = [...this.fields.elements]
      .filter((element) => element.name)
      .map((element) => `${element.name}='${element.value.replaceAll("'", "")}'`);
    this.do(["write", this.name.value, ...values].join(" "));
  }

  say(event) {
    event.preventDefault();
    if (this.line.value.trim()) this.do(this.line.value);
    this.line.select();
  }

  do(line) {
    const known = [...this.history.options].find((option) => option.value === line);
    if (known) known.remove();
    this.history.prepend(make("option", { value: line }));
    while (this.history.options.length > HISTORY) this.history.lastChild.remove();
    this.act(line);
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
