// Takes images, and shows those in an emulation's memories: the newest or a selected one, with
// detections drawn over it.

import { beside, button, choose, disabledIf, labelled, make, note, row } from "./dom.js";
import { drawDetections, MANY } from "./draw.js";
import { ask, fetched } from "./server.js";
import { ZoomFrame } from "./zoom.js";

const NONE = { marks: [], lines: [] };

export class Pictures {
  // `setPeriod(seconds)` sets the period of updates; `reported(what, request)` reports its answer.
  constructor(place, about, path, setPeriod, reported) {
    const { controls, detections, observe } = about.missing;
    this.reported = reported;
    this.missing = observe;
    this.take = button("Take a picture", "take", () => this.observe(), observe);
    this.take.className = "primary";
    this.path = path;
    const rate = choose(["1", "2", "5"], {
      id: "rate",
      onchange: () => setPeriod(1 / Number(rate.value)),
      ...disabledIf(controls),
    });
    this.changed_s = {};
    this.detected = NONE;
    this.detecting = 0; // number of the latest request, the only one whose answer is shown
    this.pending = false; // whether detections are read when the device is not busy
    this.name = choose([], { id: "picture-name", onchange: () => this.fetch() });
    const checkbox = (id, onchange) =>
      make("input", { type: "checkbox", id, onchange, ...disabledIf(detections) });
    this.newest = make("input", { type: "checkbox", checked: true, id: "newest" });
    this.detections = checkbox("detections", () => this.detect());
    this.detections.checked = !detections;
    this.detections.title ||= "read over the wire after each image; they belong to the latest one";
    this.magnitudes = checkbox("magnitudes", () => this.drawOverlay());
    this.magnitudes.title ||= "V of identified stars";
    const stretch = { type: "range", min: 0, max: 1, step: 0.02, value: 0.6, id: "stretch" };
    this.stretch = make("input", { ...stretch, oninput: () => this.draw() });
    this.canvas = make("canvas", { id: "canvas", width: 1, height: 1, role: "img" });
    this.canvas.onmousemove = (event) => this.point(event);
    this.zoomFrame = new ZoomFrame(this.canvas, () => this.drawOverlay());
    this.hidden = make("span", { id: "hidden-names" });
    const key = (kind, text) => make("li", { className: kind, textContent: text });
    this.legend = make(
      "ul",
      { id: "detections-legend", className: "legend", style: "visibility: hidden" },
      key("identified", "identified"),
      key("unidentified", "not identified"),
      key("fitted", "fitted"),
    );
    this.value = make("span", { id: "picture-value" });
    this.found = make("span", { id: "found" });
    this.empty = make("p", { id: "no-picture" });
    this.empty.textContent = controls
      ? `The image stays in the device: download it under "Commands". Here, ${controls}.`
      : 'No image yet. Press "Take a picture".';
    this.zoomFrame.place.append(this.empty);
    this.showEmpty(true);
    this.options = make(
      "details",
      { id: "picture-options" },
      make("summary", { textContent: "Display options" }),
      row(
        labelled("memory", this.name),
        beside("show newest", this.newest),
        beside("detections", this.detections),
        beside("magnitudes", this.magnitudes),
        labelled("brightness", this.stretch),
        labelled("images per second", rate),
      ),
    );
    const bar = row(this.take, ...this.zoomFrame.buttons);
    const caption = make("p", { id: "caption", className: "quiet" }, this.value, this.found, this.hidden);
    place.append(bar, this.zoomFrame.place, this.legend, caption, this.options);
  }

  async observe() {
    this.take.disabled = true;
    this.take.textContent = "Taking a picture …";
    await this.reported("take a picture", ask(`${this.path}/observe`, {}));
    this.take.textContent = "Take a picture";
    this.take.disabled = false;
  }

  showEmpty(empty) {
    this.empty.hidden = !empty;
    this.zoomFrame.place.classList.toggle("no-image", empty);
  }

  // Nobody answers while virtual time is held.
  updateTime({ held }) {
    if (this.missing || this.take.textContent !== "Take a picture") return;
    this.take.disabled = Boolean(held);
    this.take.title = held ? "virtual time is paused" : "key p";
  }

  update(pictures, busy) {
    const names = Object.keys(pictures);
    if (names.length !== this.name.options.length)
      this.name.replaceChildren(...names.map((name) => make("option", { textContent: name })));
    const changed = names.filter((name) => pictures[name].changed_s !== this.changed_s[name]);
    const at = (name) => pictures[name].changed_s;
    if (changed.length && this.newest.checked)
      this.name.value = changed.reduce((a, b) => (at(b) > at(a) ? b : a));
    for (const name of changed) this.changed_s[name] = at(name);
    if (changed.length) {
      this.pending = true; // what it finds in a new picture comes when it is done with that
      this.clearDetections();
    }
    const { rows, columns, stored } = pictures[this.name.value] ?? {};
    if (rows) this.zoomFrame.place.style.setProperty("--aspect", columns / rows);
    if (rows && !this.pixels) Object.assign(this.canvas, { width: columns, height: rows }); // its place until it comes
    this.showEmpty(!stored);
    if (!stored) this.value.textContent = rows ? `${this.name.value}: ${columns} x ${rows}, no image since power-up` : "";
    else if (changed.includes(this.name.value)) this.fetch();
    else if (this.pending && !busy) this.detect();
  }

  clearDetections() {
    this.detecting += 1;
    this.detected = NONE;
    this.found.textContent = "";
    this.legend.style.visibility = "hidden";
  }

  async detect() {
    this.pending = false;
    this.clearDetections();
    this.drawOverlay();
    if (!this.detections.checked) return;
    const number = this.detecting;
    const show = (text, detected = NONE) => {
      if (number !== this.detecting) return; // a later request, or another image
      this.detected = detected;
      this.found.textContent = text;
      this.legend.style.visibility = detected === NONE ? "hidden" : "";
      this.drawOverlay();
    };
    const path = `${this.path}/detections/${encodeURIComponent(this.name.value)}`;
    await ask(path).then((answer) => show(counted(answer.marks), answer), (error) => show(error.message));
  }

  async fetch() {
    const name = this.name.value;
    let bitmap;
    try {
      const answer = await fetched(`${this.path}/pictures/${encodeURIComponent(name)}`);
      bitmap = await createImageBitmap(await answer.blob());
    } catch (error) {
      this.value.textContent = error.message;
      delete this.changed_s[name]; // so that it is fetched again
      return;
    }
    const from = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    from.drawImage(bitmap, 0, 0);
    this.pixels = from.getImageData(0, 0, bitmap.width, bitmap.height);
    const { width, height } = bitmap;
    bitmap.close(); // frees memory that is not collected in time
    this.canvas.width = width;
    this.canvas.height = height;
    this.canvas.setAttribute("aria-label", `${name}, ${width} x ${height}`);
    this.value.textContent = `${name}: ${width} x ${height}, at ${this.changed_s[name].toFixed(3)} s`;
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
    this.drawOverlay();
  }

  drawOverlay() {
    const hidden = this.zoomFrame.drawOver((pen, place, size) =>
      drawDetections(pen, this.detected, place, size, this.magnitudes.checked),
    );
    this.hidden.textContent = hidden ? `${hidden} name${hidden > 1 ? "s" : ""} hidden: zoom in` : "";
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

// What was detected in words: marks of one kind share a name, such as "edge".
function counted(marks) {
  const names = new Map();
  for (const { name } of marks) names.set(name, (names.get(name) ?? 0) + 1);
  const common = [...names].filter(([name, count]) => name && count >= MANY);
  if (common.length) return common.map(([name, count]) => `${count} points of "${name}" detected`).join(", ");
  return `${marks.length} detected, ${marks.length - (names.get("") ?? 0)} identified`;
}
