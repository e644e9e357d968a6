// A picture down or up over the wire, as any host could have it: with progress, held, given up.

import { choose, labelled, make } from "./dom.js";
import { ask } from "./server.js";

export class Transfer {
  // `path` leads to the target, `tell(text, kind)` tells what happened.
  constructor(place, path, about, tell) {
    this.path = path;
    this.tell = tell;
    const { download, upload } = about.missing;
    const button = (text, id, click, why) =>
      make("button", {
        textContent: text,
        id,
        type: "button",
        onclick: click,
        disabled: Boolean(why),
        title: why ?? "",
      });
    this.source = choose(about.sources, { id: "source", hidden: !about.sources.length });
    const start = () => this.do("download", { source: this.source.value || null });
    this.hold = button("Hold", "hold", () => this.do(`transfer/${this.held ? "go-on" : "hold"}`));
    this.end = button("Give up", "give-up", () => this.do("transfer/give-up"));
    this.save = make("a", {
      href: `${path}/carried`,
      download: "",
      id: "carried",
      textContent: "Save as PNG",
      hidden: true,
    });
    this.file = make("input", {
      type: "file",
      id: "upload",
      accept: "image/*",
      disabled: Boolean(upload),
      title: upload ?? "",
      onchange: () => this.upload(),
    });
    this.bar = make("progress", { id: "progress", max: 1, value: 0 });
    this.told = make("p", { className: "quiet", id: "transfer-told" });
    place.append(
      make(
        "div",
        { className: "row" },
        labelled("", this.source),
        button("Download", "download", start, download),
        this.hold,
        this.end,
        this.save,
      ),
      labelled("upload a picture file", this.file),
      this.bar,
      this.told,
    );
    const why = [download, upload].filter(Boolean);
    this.told.textContent = why.join("; ");
    this.hear(null);
  }

  async do(call, body = {}) {
    try {
      this.hear(await ask(`${this.path}/${call}`, body));
    } catch (error) {
      this.tell(`${call}\n  ${error.message}`, "bad");
    }
  }

  async upload() {
    const [file] = this.file.files;
    if (!file) return;
    const bytes = new Uint8Array(await file.arrayBuffer());
    const text = Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
    await this.do("upload", { picture: btoa(text) });
    this.file.value = "";
  }

  hear(carried) {
    const runs = Boolean(carried) && !carried.ended;
    this.held = runs && carried.held;
    this.hold.disabled = this.end.disabled = !runs;
    this.hold.textContent = this.held ? "Go on" : "Hold";
    this.bar.hidden = !carried;
    if (!carried) return;
    const { what, done, total, ended } = carried;
    this.bar.max = total || 1;
    this.bar.value = done;
    this.save.hidden = !carried.saved;
    const state = ended || (this.held ? "held" : "on its way; nothing else is asked meanwhile");
    this.told.textContent = `${what}: ${done} of ${total} blocks, ${state}`;
  }
}
