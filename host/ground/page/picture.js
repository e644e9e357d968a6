// The pictures in an emulation's memories: the newest by itself, brightened as one likes.

import { choose, labelled, make } from "./dom.js";
import { ask } from "./server.js";

const RADIUS = 9;
const EDGE = 4; // of a mark whose name all others have too
const LARGEST = 8;

export class Pictures {
  // `path` leads to the target.
  constructor(place, about, path) {
    this.path = path;
    this.known = {};
    this.found = { marks: [], lines: [] };
    this.zoom = 1;
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
    const stretch = { type: "range", min: 0, max: 1, step: 0.02, value: 0.6, id: "stretch" };
    this.stretch = make("input", { ...stretch, oninput: () => this.draw() });
    this.canvas = make("canvas", { id: "canvas", width: 1, height: 1, role: "img" });
    this.canvas.onmousemove = (event) => this.point(event);
    this.frame = make("div", { className: "frame", id: "frame-of-picture", tabIndex: 0 });
    this.frame.setAttribute("aria-label", "picture; + and - enlarge it, arrow keys move it");
    this.frame.append(this.canvas);
    this.frame.onkeydown = ({ key }) => {
      if (key === "+" || key === "-") this.enlarge(key === "+" ? 2 : 0.5, 0.5, 0.5);
    };
    this.frame.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.value = make("p", { className: "quiet", textContent: "no picture yet" });
    place.append(
      make(
        "div",
        { className: "row" },
        labelled("memory", this.name),
        labelled("the newest", this.newest, { className: "beside" }),
        labelled("what it found", this.marks, { className: "beside" }),
        labelled("brightness", this.stretch),
      ),
      this.frame,
      this.value,
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
    }
    if (changed.includes(this.name.value)) this.fetch();
    else if (this.late && !busy) this.find();
  }

  async find() {
    this.late = false;
    this.found = { marks: [], lines: [] };
    if (this.marks.checked)
      try {
        this.found = await ask(`${this.path}/found/${encodeURIComponent(this.name.value)}`);
        const { marks } = this.found;
        const known = marks.filter((mark) => mark.name).length;
        this.value.textContent = `${marks.length} found, ${known} of them known`;
      } catch (error) {
        this.value.textContent = error.message;
      }
    this.draw();
  }

  async fetch() {
    const name = this.name.value;
    const answer = await fetch(`${this.path}/pictures/${encodeURIComponent(name)}`);
    if (!answer.ok) return;
    const bitmap = await createImageBitmap(await answer.blob());
    const from = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    from.drawImage(bitmap, 0, 0);
    this.pixels = from.getImageData(0, 0, bitmap.width, bitmap.height);
    this.canvas.width = bitmap.width;
    this.canvas.height = bitmap.height;
    this.canvas.setAttribute("aria-label", `${name}, ${bitmap.width} x ${bitmap.height}`);
    this.value.textContent = `${name}: ${bitmap.width} x ${bitmap.height}, at ${this.known[name]} s`;
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
    pen.font = "13px system-ui, sans-serif";
    pen.strokeStyle = "#78aaff";
    pen.setLineDash([]);
    for (const line of this.found.lines) {
      pen.beginPath();
      for (const [x, y] of line) pen.lineTo(x, y);
      pen.closePath();
      pen.stroke();
    }
    const often = new Set(this.found.marks.map((mark) => mark.name)).size < 2;
    for (const { x, y, name } of this.found.marks) {
      pen.strokeStyle = pen.fillStyle = name ? "#78ff78" : "#ff8c5a";
      pen.setLineDash(name ? [] : [3, 3]);
      pen.beginPath();
      pen.arc(x, y, often && name ? EDGE : RADIUS, 0, 2 * Math.PI);
      pen.stroke();
      if (often && this.found.marks.length > 1) continue;
      const width = pen.measureText(name).width;
      const left = x + RADIUS + 3 + width > shown.width ? x - RADIUS - 3 - width : x + RADIUS + 3;
      pen.fillText(name, left, Math.min(Math.max(y + 4, 12), shown.height - 3));
    }
  }

  wheel(event) {
    if (!event.ctrlKey && !event.altKey) return; // the page scrolls
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    const across = (event.clientX - box.left) / box.width;
    const down = (event.clientY - box.top) / box.height;
    this.enlarge(event.deltaY < 0 ? 1.25 : 0.8, across, down);
  }

  // By a factor, and the place at these shares of width and height stays where it is.
  enlarge(factor, across, down) {
    const { frame, canvas } = this;
    const before = canvas.getBoundingClientRect();
    this.zoom = Math.min(Math.max(this.zoom * factor, 1), LARGEST);
    canvas.style.width = `${100 * this.zoom}%`;
    const after = canvas.getBoundingClientRect();
    frame.scrollLeft += across * (after.width - before.width);
    frame.scrollTop += down * (after.height - before.height);
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
