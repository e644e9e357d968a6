// The pictures in an emulation's memories: the newest by itself, brightened as one likes.

import { choose, labelled, make } from "./dom.js";
import { ZoomFrame } from "./zoom.js";
import { drawFound } from "./overlay.js";
import { ask, fetched } from "./server.js";

export class Pictures {
  // `path` leads to the target, `every(seconds)` says how often it is looked for another one.
  constructor(place, about, path, every) {
    this.path = path;
    const rate = choose(["1", "2", "5"], {
      id: "rate",
      title: "pictures and telemetry a second, at most",
      disabled: Boolean(about.missing.controls),
      onchange: () => every(1 / Number(rate.value)),
    });
    this.known = {};
    this.found = { marks: [], lines: [] };
    this.late = false;
    this.name = choose([], { id: "picture-name", onchange: () => this.fetch() });
    this.newest = make("input", { type: "checkbox", checked: true, id: "newest" });
    const none = about.missing.found;
    this.marks = make("input", {
      type: "checkbox",
      id: "marks",
      disabled: Boolean(none),
      title: none ?? "read over the wire after each picture; they are those of its latest one",
      onchange: () => this.find(),
    });
    this.magnitudes = make("input", {
      type: "checkbox",
      id: "magnitudes",
      disabled: Boolean(none),
      title: none ?? "V of the stars that have a name",
      onchange: () => this.drawFound(),
    });
    const stretch = { type: "range", min: 0, max: 1, step: 0.02, value: 0.6, id: "stretch" };
    this.stretch = make("input", { ...stretch, oninput: () => this.draw() });
    this.canvas = make("canvas", { id: "canvas", width: 1, height: 1, role: "img" });
    this.canvas.onmousemove = (event) => this.point(event);
    this.zoomFrame = new ZoomFrame(this.canvas, () => this.drawFound());
    this.untold = make("p", { className: "quiet", id: "untold" });
    const key = (kind, text) => make("li", { className: kind, textContent: text });
    this.legend = make(
      "ul",
      { id: "found-legend", hidden: true },
      key("known", "known"),
      key("unknown", "found, not known"),
      key("fitted", "fitted, or a window"),
    );
    this.value = make("p", { className: "quiet", textContent: "no picture yet" });
    place.append(
      make(
        "div",
        { className: "row" },
        labelled("memory", this.name),
        labelled("the newest", this.newest, { className: "beside" }),
        labelled("what it found", this.marks, { className: "beside" }),
        labelled("magnitudes", this.magnitudes, { className: "beside" }),
        labelled("brightness", this.stretch),
        labelled("a second", rate),
      ),
      this.zoomFrame.place,
      this.zoomFrame.buttons,
      this.legend,
      this.value,
      this.untold,
    );
    if (about.missing.controls) this.value.textContent = about.missing.controls;
  }

  hear(pictures, busy) {
    const names = Object.keys(pictures);
    if (names.length !== this.name.options.length)
      this.name.replaceChildren(...names.map((name) => make("option", { textContent: name })));
    const changed = names.filter((name) => pictures[name].changed_s !== this.known[name]);
    const at = (name) => pictures[name].changed_s;
    if (changed.length && this.newest.checked)
      this.name.value = changed.reduce((a, b) => (at(b) > at(a) ? b : a));
    for (const name of changed) this.known[name] = at(name);
    if (changed.length) {
      this.late = true; // what it finds in a new picture comes when it is done with that
      this.found = { marks: [], lines: [] };
      this.legend.hidden = true;
    }
    if (changed.includes(this.name.value)) this.fetch();
    else if (this.late && !busy) this.find();
  }

  async find() {
    this.late = false;
    this.found = { marks: [], lines: [] };
    this.legend.hidden = true;
    if (this.marks.checked)
      try {
        this.found = await ask(`${this.path}/found/${encodeURIComponent(this.name.value)}`);
        const { marks } = this.found;
        const known = marks.filter((mark) => mark.name).length;
        this.value.textContent = `${marks.length} found, ${known} of them known`;
        this.legend.hidden = false;
      } catch (error) {
        this.value.textContent = error.message;
      }
    this.drawFound();
  }

  async fetch() {
    const name = this.name.value;
    let bitmap;
    try {
      const answer = await fetched(`${this.path}/pictures/${encodeURIComponent(name)}`);
      bitmap = await createImageBitmap(await answer.blob());
    } catch (error) {
      this.value.textContent = error.message;
      delete this.known[name]; // to be asked for again
      return;
    }
    const from = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    from.drawImage(bitmap, 0, 0);
    this.pixels = from.getImageData(0, 0, bitmap.width, bitmap.height);
    const { width, height } = bitmap;
    bitmap.close(); // its memory is the browser's, and not collected in time
    this.canvas.width = width;
    this.canvas.height = height;
    this.canvas.setAttribute("aria-label", `${name}, ${width} x ${height}`);
    this.value.textContent = `${name}: ${width} x ${height}, at ${this.known[name]} s`;
    this.draw();
  }

  draw() {
    if (!this.pixels) return;
    const gamma = 1 - 0.9 * Number(this.stretch.value);
    const table = Uint8ClampedArray.from({ length: 256 }, (_, v) => 255 * (v / 255) ** gamma);
    const shown = new ImageData(this.pixels.width, this.pixels.height);
    for (let at = 0; at < shown.data.length; at += 4) {
      shown.data.fill(table[this.pixels.data[at]], at, at + 3);
      shown.data[at + 3] = 255;
    }
    const pen = this.canvas.getContext("2d");
    pen.putImageData(shown, 0, 0);
    this.drawFound();
  }

  drawFound() {
    const left = this.zoomFrame.drawOver((pen, place, size) =>
      drawFound(pen, this.found, place, size, this.magnitudes.checked),
    );
    this.untold.textContent = left ? `names without room: ${left}; enlarge it to read them` : "";
  }

  point(event) {
    if (!this.pixels) return;
    const { width, height } = this.pixels;
    const box = this.canvas.getBoundingClientRect();
    const column = Math.floor(((event.clientX - box.left) / box.width) * width);
    const row = Math.floor(((event.clientY - box.top) / box.height) * height);
    const value = this.pixels.data[4 * (row * width + column)];
    this.value.textContent = `column ${column}, row ${row}: ${value}`;
  }
}
