// A frame that zooms and moves an image by keys, buttons, wheel or pointer.

import { button, make } from "./dom.js";
import { sharpPen } from "./draw.js";

const LARGEST = 16; // relative to the fitted image
const STEP = 2;

export class ZoomFrame {
  // Calls `changed` when its position or size on the screen changes.
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.zoom = 1;
    this.frame = make("div", { className: "frame", id: "zoom-frame", tabIndex: 0 });
    this.frame.setAttribute("role", "group");
    this.frame.setAttribute("aria-label", "image; + and - zoom, 0 fits, arrow keys move it");
    this.frame.append(canvas);
    this.overlay = make("canvas", { id: "overlay", width: 1, height: 1 });
    this.overlay.setAttribute("aria-hidden", "true");
    this.place = make("div", { className: "under" }, this.frame, this.overlay);
    this.frame.onscroll = () => this.changed();
    this.frame.onkeydown = (event) => this.key(event);
    this.frame.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.frame.onpointerdown = (event) => {
      if (event.pointerType !== "mouse") return; // a finger scrolls it
      this.frame.setPointerCapture(event.pointerId);
    };
    this.frame.onpointermove = (event) => {
      if (!this.frame.hasPointerCapture(event.pointerId)) return;
      this.frame.scrollBy(-event.movementX, -event.movementY);
    };
    this.buttons = [
      named("+", "Zoom in", "zoom-in", () => this.scale(STEP)),
      named("−", "Zoom out", "zoom-out", () => this.scale(1 / STEP)),
      button("Fit", "zoom-fit", () => this.scale(0)),
    ];
    new ResizeObserver(() => this.changed()).observe(this.frame);
  }

  // Draws over the image by `draw(pen, place, size)`: `place` maps a column and row of the image to
  // the overlay, whose `size` is that of the frame.
  drawOver(draw) {
    const { frame, canvas, overlay } = this;
    const size = { width: frame.clientWidth, height: frame.clientHeight };
    const pen = sharpPen(overlay, size.width, size.height);
    overlay.style.width = `${size.width}px`;
    overlay.style.height = `${size.height}px`;
    const scale = canvas.clientWidth / canvas.width;
    const { scrollLeft, scrollTop } = frame;
    const place = (x, y) => [scale * (x + 0.5) - scrollLeft, scale * (y + 0.5) - scrollTop];
    return draw(pen, place, size);
  }

  key(event) {
    const factor = { "+": STEP, "-": 1 / STEP, 0: 0 }[event.key];
    if (factor === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    this.scale(factor);
  }

  wheel(event) {
    const focused = this.frame.contains(document.activeElement) || event.ctrlKey || event.altKey;
    if (!focused) return; // the page scrolls
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    const across = (event.clientX - box.left) / box.width;
    const down = (event.clientY - box.top) / box.height;
    this.scale(event.deltaY < 0 ? 1.25 : 0.8, across, down);
  }

  // Zooms by a factor around the point at the shares `across` and `down` of the image's size, by
  // default the middle of the frame.
  scale(factor, across = null, down = null) {
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

function named(sign, name, id, act) {
  const made = button(sign, id, act);
  made.ariaLabel = made.title = name;
  return made;
}
