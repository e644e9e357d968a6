// Downloads and uploads of images over the wire, with progress, pause and cancel.

import { base64, button, choose, disabledIf, labelled, make, note, row } from "./dom.js";
import { ask } from "./server.js";

export class Transfer {
  constructor(place, path, about, report) {
    this.path = path;
    this.report = report;
    const { download, upload } = about.missing;
    this.source = choose(about.sources, { id: "source", hidden: !about.sources.length });
    const start = () => this.call("download", { source: this.source.value || null });
    this.pause = button("Pause", "pause-transfer", () => this.call(`transfer/${this.paused ? "resume" : "pause"}`));
    this.cancel = button("Cancel", "cancel-transfer", () => this.call("transfer/cancel"));
    this.save = make("a", {
      href: `${path}/transfer/image`,
      download: "",
      id: "save-image",
      textContent: "Save as PNG",
      hidden: true,
    });
    this.file = make("input", {
      type: "file",
      id: "upload",
      accept: "image/*",
      onchange: () => this.upload(),
      ...disabledIf(upload),
    });
    this.bar = make("progress", { id: "progress", max: 1, value: 0 });
    this.status = note([download, upload].filter(Boolean).join("; "), { id: "transfer-status" });
    place.append(
      row(
        this.source.hidden ? null : labelled("memory", this.source),
        button("Download", "download", start, download),
        this.pause,
        this.cancel,
        this.save,
      ),
      labelled("upload an image file", this.file),
      this.bar,
      this.status,
    );
    this.update(null);
  }

  async call(call, body = {}) {
    try {
      this.update(await ask(`${this.path}/${call}`, body));
    } catch (error) {
      this.report(`${call}\n  ${error.message}`, "bad");
    }
  }

  async upload() {
    const [file] = this.file.files;
    if (!file) return;
    await this.call("upload", { picture: await base64(file) });
    this.file.value = "";
  }

  update(transfer) {
    const runs = Boolean(transfer) && !transfer.ended;
    this.paused = runs && transfer.paused;
    this.pause.disabled = this.cancel.disabled = !runs;
    this.pause.textContent = this.paused ? "Resume" : "Pause";
    this.bar.hidden = !transfer;
    if (!transfer) return;
    const { what, done, total, ended } = transfer;
    this.bar.max = total || 1;
    this.bar.value = done;
    this.save.hidden = !transfer.saved;
    const state = ended || (this.paused ? "paused" : "in progress; other requests wait");
    this.status.textContent = `${what}: ${done} of ${total} blocks, ${state}`;
  }
}
