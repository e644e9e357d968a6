// Options of the emulation, such as profile and firmware, and its restart with others.

import { base64, beside, choose, disabledIf, labelled, make, note, row } from "./dom.js";
import { ask } from "./server.js";

const UPLOAD = "upload a file";

export class Start {
  // `reported(what, request)` reports the answer to a request.
  constructor(place, about, path, reported) {
    const why = about.missing.controls ?? about.missing.restart;
    this.path = path;
    this.reported = reported;
    const current = Object.entries(about.chosen).map(([name, value]) => `${name} ${value}`);
    const status = current.length ? `running: ${current.join(", ")}` : "";
    this.fields = about.options.map((option) => field(option));
    this.button = make("button", {
      className: "main",
      id: "restart",
      textContent: "Restart",
      ...disabledIf(why),
    });
    this.button.title ||= "with the same scene and seed";
    this.reason = note(why);
    const form = make(
      "form",
      {
        onsubmit: (event) => {
          event.preventDefault();
          this.restart();
        },
      },
      ...this.fields.flatMap((one) => one.elements),
      this.button,
    );
    place.append(make("p", { id: "start-status", textContent: status }), form, this.reason);
  }

  async restart() {
    this.button.disabled = true;
    this.reason.textContent = "restarting";
    try {
      const options = {};
      const files = {};
      for (const one of this.fields) await one.collect(options, files);
      await this.reported("restart", ask(`${this.path}/restart`, { options, files }));
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
  const isFlag = !option.choices.length && !option.text;
  let input;
  if (isFlag) input = make("input", { ...common, type: "checkbox", checked: option.now === true });
  else if (option.choices.length) {
    input = choose(option.choices, common);
    input.value = option.now;
  } else
    input = make("input", { ...common, value: option.now, placeholder: option.unset, autocomplete: "off", spellcheck: false });
  return {
    elements: [(isFlag ? beside : labelled)(option.name, input)],
    collect: (options) => {
      const value = isFlag ? input.checked : input.value.trim();
      if (value !== option.default) options[option.name] = value;
    },
  };
}

// A choice between known names, the current file, and an upload.
function fileField(option, common) {
  const names = [...new Set([...option.known, option.now])].filter(Boolean);
  const input = choose([{ value: "", textContent: option.unset }, ...names, { value: UPLOAD, textContent: UPLOAD }], common);
  input.value = option.now;
  const file = make("input", { type: "file", id: `${common.id}-file` });
  const address = make("input", { id: `${common.id}-address`, size: 12, placeholder: "@0x0", autocomplete: "off" });
  const upload = row(labelled(`${option.name}: file`, file), labelled("address of a raw binary", address));
  upload.hidden = true;
  input.onchange = () => (upload.hidden = input.value !== UPLOAD);
  return {
    elements: [labelled(option.name, input), upload],
    collect: async (options, files) => {
      if (input.value !== UPLOAD) {
        if (input.value !== option.default) options[option.name] = input.value;
        return;
      }
      const [chosen] = file.files;
      if (!chosen) throw new Error(`${option.name}: choose a file`);
      files[option.name] = { name: chosen.name, content: await base64(chosen), suffix: address.value.trim() };
    },
  };
}
