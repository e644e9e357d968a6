// How an emulation was started, its profile and firmware above all, and to start it otherwise.

import { choose, labelled, make } from "./dom.js";
import { ask } from "./server.js";

const OWN = "a file of one's own";

export class Start {
  // `path` leads to the target, `act(what, asked)` does something and tells of it.
  constructor(place, about, path, act) {
    const why = about.missing.controls ?? about.missing.restart;
    this.path = path;
    this.act = act;
    const now = Object.entries(about.chosen).map(([name, value]) => `${name} ${value}`);
    this.told = make("p", { id: "start-told", textContent: now.length ? `runs now: ${now.join(", ")}` : "" });
    this.fields = about.options.map((option) => field(option));
    this.button = make("button", {
      className: "main",
      id: "restart",
      textContent: "Start again",
      disabled: Boolean(why),
      title: why ?? "with the same scene and seed",
    });
    this.reason = make("p", { className: "quiet", textContent: why ?? "" });
    const form = make(
      "form",
      {
        id: "start-form",
        onsubmit: (event) => {
          event.preventDefault();
          this.restart();
        },
      },
      ...this.fields.flatMap((one) => one.elements),
      this.button,
    );
    place.append(this.told, form, this.reason);
  }

  async restart() {
    this.button.disabled = true;
    this.reason.textContent = "the device starts again";
    try {
      const options = {};
      const files = {};
      for (const one of this.fields) await one.give(options, files);
      await this.act("start again", ask(`${this.path}/restart`, { options, files }));
      this.reason.textContent = "";
    } catch (error) {
      this.reason.textContent = error.message;
    }
    this.button.disabled = false;
  }
}

function field(option) {
  const common = { id: `option-${option.name}`, title: option.help };
  if (option.file) return fileField(option, common);
  let input;
  if (option.choices.length) {
    input = choose(option.choices, common);
    input.value = option.now;
  } else if (option.text)
    input = make("input", { ...common, value: option.now, placeholder: option.unset, autocomplete: "off", spellcheck: false });
  else input = make("input", { ...common, type: "checkbox", checked: option.now === true });
  const value = () => (input.type === "checkbox" ? input.checked : input.value.trim());
  const beside = input.type === "checkbox" ? { className: "beside" } : {};
  return {
    elements: [labelled(option.name, input, beside)],
    give: (options) => {
      if (value() !== option.default) options[option.name] = value();
    },
  };
}

// What is known by a name, what runs now, or a file that is sent.
function fileField(option, common) {
  const names = [...new Set([...option.known, option.now])].filter(Boolean);
  const input = choose([{ value: "", textContent: option.unset }, ...names, { value: OWN, textContent: OWN }], common);
  input.value = option.now;
  const file = make("input", { type: "file", id: `${common.id}-file` });
  const address = make("input", { id: `${common.id}-address`, size: 12, placeholder: "@0x0", autocomplete: "off" });
  const own = make(
    "div",
    { className: "row", hidden: true },
    labelled(`${option.name}: the file`, file),
    labelled("address of plain bytes", address),
  );
  input.onchange = () => (own.hidden = input.value !== OWN);
  return {
    elements: [labelled(option.name, input), own],
    give: async (options, files) => {
      if (input.value !== OWN) {
        if (input.value !== option.default) options[option.name] = input.value;
        return;
      }
      const [sent] = file.files;
      if (!sent) throw new Error(`${option.name}: choose a file`);
      const bytes = new Uint8Array(await sent.arrayBuffer());
      const content = btoa(bytes.reduce((text, byte) => text + String.fromCharCode(byte), ""));
      files[option.name] = { name: sent.name, content, suffix: address.value.trim() };
    },
  };
}
