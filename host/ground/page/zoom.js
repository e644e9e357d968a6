// A frame in which a picture is enlarged and moved: by keys, buttons, wheel or pointer.

import { make } from "./dom.js";

const LARGEST = 16; // times as wide as it is whole
const BY = 2;

export class ZoomFrame {
  // `changed` is called when it stands elsewhere on the screen, or in another size.
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.zoom = 1;
    this.frame = make("div", { className: "frame", id: "frame-of-picture", tabIndex: 0 });
    this.frame.setAttribute("role", "group");
    this.frame.setAttribute("aria-label", "picture; + - and 0 size it, arrow keys move it");
    this.frame.append(canvas);
    // Has the pixels of the screen, so that what is written on it stays sharp.
    this.over = make("canvas", { id: "over", width: 1, height: 1 });
    this.over.setAttribute("aria-hidden", "true");
    this.place = make("div", { className: "under" }, this.frame, this.over);
    this.frame.onscroll = () => this.changed();
    this.frame.onkeydown = (event) => this.key(event);
    this.frame.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.frame.onpointerdown = (event) => {
      if (event.pointerType !== "mouse") return; // a finger scrolls it anyhow
      this.frame.setPointerCapture(event.pointerId);
    };
    this.frame.onpointermove = (event) => {
      if (!this.frame.hasPointerCapture(event.pointerId)) return;
      this.frame.scrollBy(-event.movementX, -event.movementY);
    };
    const button = (text, told, act) =>
      make("button", { textContent: text, type: "button", title: told, ariaLabel: told, onclick: act });
    this.buttons = make(
      "div",
      { className: "row", id: "sizes" },
      button("+", "enlarge the picture", () => this.enlarge(BY)),
      button("−", "make the picture smaller", () => this.enlarge(1 / BY)),
      button("whole", "show the whole picture", () => this.enlarge(0)),
    );
    new ResizeObserver(() => this.changed()).observe(this.frame);
  }

  // What `draw` draws over the picture; it is given a pen, what makes the screen's columns and
  // rows of the picture's, and the size of what is seen.
  drawOver(draw) {
    const { frame, canvas, over } = this;
    const size = { width: frame.clientWidth, height: frame.clientHeight };
    const fine = window.devicePixelRatio || 1;
    over.width = size.width * fine;
    over.height = size.height * fine;
    over.style.width = `${size.width}px`;
    over.style.height = `${size.height}px`;
    const pen = over.getContext("2d");
    pen.scale(fine, fine);
    const scale = canvas.clientWidth / canvas.width;
    const { scrollLeft, scrollTop } = frame;
    const place = (x, y) => [scale * (x + 0.5) - scrollLeft, scale * (y + 0.5) - scrollTop];
    return draw(pen, place, size);
  }

  key(event) {
    const factor = { "+": BY, "-": 1 / BY, 0: 0 }[event.key];
    if (factor === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    this.enlarge(factor);
  }

  wheel(event) {
    const chosen = this.frame.contains(document.activeElement) || event.ctrlKey || event.altKey;
    if (!chosen) return; // the page scrolls
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    const across = (event.clientX - box.left) / box.width;
    const down = (event.clientY - box.top) / box.height;
    this.enlarge(event.deltaY < 0 ? 1.25 : 0.8, across, down);
  }

  // By a factor, and the place at these shares of width and height stays where it is; without
  // them the middle of what is seen does.
  enlarge(factor, across = null, down = null) {
    const { frame, canvas } = this;
    const before = canvas.getBoundingClientRect();
    const x = across ?? (frame.scrollLeft + frame.clientWidth / 2) / before.width;
    const y = down ?? (frame.scrollTop + frame.clientHeight / 2) / before.height;
    if (!frame.style.maxHeight) frame.style.maxHeight = `${before.height}px`;
    this.zoom = Math.min(Math.max(this.zoom * factor, 1), LARGEST);
    if (this.zoom === 1) frame.style.maxHeight = "";
    canvas.style.width = `${100 * this.zoom}%`;
    const after = canvas.getBoundingClientRect();
    frame.scrollLeft += x * (after.width - before.width);
    frame.scrollTop += y * (after.height - before.height);
    this.changed();
  }
}
