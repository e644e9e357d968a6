// A map of the whole sky with stars, bodies and cameras' fields of view; a click, a drag or arrow keys
// move the selected object.

import { make } from "../dom.js";
import { disc, overlap, ring, sharpPen } from "../draw.js";
import { angles, circle, direction, dot, flat, RAD, turned, turnedBack, vector } from "../sphere.js";

const GRID_DEG = 30;
const LABELS_DEG = 60;
const MARGIN = 8;
const TEXT = 12;
const SIGN = 4; // half of the width of a sign, which no text covers
const FINE = 3; // step in CSS pixels when a disc is filled
const STEP_DEG = 1; // per arrow key
const FAST = 10; // factor of the shift key
const NAMED = 1.7; // highest V of stars with a name, if there is room
const COLOURS = {
  field: ["#0b5cad", "#6db3ff"],
  Sun: ["#a15c00", "#ffc53d"],
  Earth: ["#1a7f37", "#4ac26b"],
  other: ["#6b4fa0", "#c3a6ff"],
}; // on a light and on a dark background

export class SkyMap {
  // Calls `move(direction)`, in the scene's axes, when the user chooses a position.
  constructor(move) {
    this.move = move;
    this.sight = null;
    this.stars = [];
    this.selected = null;
    this.canvas = make("canvas", { id: "sky-map", width: 1, height: 1, tabIndex: 0, role: "img" });
    this.canvas.onpointerdown = (event) => {
      this.canvas.focus();
      this.canvas.setPointerCapture(event.pointerId);
      this.point(event);
    };
    this.canvas.onpointermove = (event) => {
      if (this.canvas.hasPointerCapture(event.pointerId)) this.point(event);
    };
    this.canvas.onkeydown = (event) => this.key(event);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    const redraw = () => {
      if (this.canvas.isConnected) this.draw();
      else scheme.removeEventListener("change", redraw);
    };
    scheme.addEventListener("change", redraw);
  }

  // `selected` is the direction of the selected object in the scene's axes, or null.
  show(sight, selected) {
    this.sight = sight;
    this.selected = selected;
    this.draw();
  }

  point(event) {
    if (!this.sight) return;
    const box = this.canvas.getBoundingClientRect();
    const { left, top, scale } = this.size();
    const at = direction((event.clientX - box.left - left) / scale, (event.clientY - box.top - top) / scale);
    if (at) this.move(turnedBack(this.sight.turn, at));
  }

  key(event) {
    const by = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const [along, above] = by[event.key] ?? [0, 0];
    if ((!along && !above) || !this.selected || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const step = STEP_DEG * (event.shiftKey ? FAST : 1);
    const [longitude, latitude] = angles(turned(this.sight.turn, this.selected));
    const up = Math.min(Math.max(latitude + step * above, -90), 90);
    this.move(turnedBack(this.sight.turn, vector(longitude + step * along, up)));
  }

  // The map on the screen: its size, middle, and half of its height (`scale`).
  size() {
    const width = this.canvas.clientWidth;
    const scale = Math.max((width - 2 * MARGIN) / 4, 1);
    return { width, height: 2 * scale + 2 * MARGIN, left: width / 2, top: scale + MARGIN, scale };
  }

  draw() {
    const { width, height, left, top, scale } = this.size();
    if (!width) return;
    const pen = sharpPen(this.canvas, width, height);
    this.canvas.style.aspectRatio = `${width} / ${height}`;
    pen.font = `${TEXT}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    this.dark = matchMedia("(prefers-color-scheme: dark)").matches;
    this.ground = this.dark ? "#0a0d12" : "#f2f5fa";
    this.text = getComputedStyle(this.canvas).color;
    this.taken = [];
    this.place = (at) => {
      const [right, down] = flat(this.sight ? turned(this.sight.turn, at) : at);
      return [left + scale * right, top + scale * down];
    };
    this.limb(pen, left, top, scale);
    if (!this.sight) return;
    const { fields, bodies } = this.sight;
    const signs = [...fields.map(({ axes }) => axes[2]), ...bodies.map((one) => one.direction)];
    for (const [x, y] of [...signs, ...Object.values(this.sight.marks)].map(this.place))
      this.taken.push({ left: x - SIGN, top: y - TEXT / 2, wide: 2 * SIGN });
    for (const body of bodies) this.fillBody(pen, body, left, top, scale);
    this.grid(pen);
    for (const field of this.sight.now) this.field(pen, field, true);
    for (const field of fields) this.field(pen, field, false);
    for (const [name, mark] of Object.entries(this.sight.marks)) this.mark(pen, name, mark);
    for (const body of bodies) this.body(pen, body);
    if (this.sight.stars) for (const star of this.stars) this.star(pen, star);
    if (this.selected) this.ring(pen);
  }

  colour(name) {
    return (COLOURS[name] ?? COLOURS.other)[Number(this.dark)];
  }

  limb(pen, left, top, scale) {
    pen.beginPath();
    pen.ellipse(left, top, 2 * scale, scale, 0, 0, 2 * Math.PI);
    pen.fillStyle = this.ground;
    pen.fill();
    pen.strokeStyle = "#888";
    pen.lineWidth = 1;
    pen.stroke();
  }

  // A line on the sphere; it may leave the map on one side and continue on the other.
  line(pen, points) {
    const far = this.size().scale;
    let before = null;
    pen.beginPath();
    for (const at of points) {
      const [x, y] = this.place(at);
      if (before && Math.hypot(x - before[0], y - before[1]) < far) pen.lineTo(x, y);
      else pen.moveTo(x, y);
      before = [x, y];
    }
    pen.stroke();
  }

  // Grid of the map's own axes, which are the stars' axes if there are stars.
  grid(pen) {
    const here = (along, above) => turnedBack(this.sight.turn, vector(along, above));
    const span = (from, to) => Array.from({ length: 61 }, (_, i) => from + ((to - from) * i) / 60);
    pen.strokeStyle = "#8886";
    for (let along = -180; along < 180; along += GRID_DEG)
      this.line(pen, span(-90, 90).map((above) => here(along === -180 ? -179.999 : along, above)));
    for (let above = 90 - GRID_DEG; above > -90; above -= GRID_DEG)
      this.line(pen, span(-179.999, 179.999).map((along) => here(along, above)));
    if (!this.sight.stars) return;
    for (let along = 0; along < 360; along += LABELS_DEG)
      if (along !== 180) this.word(pen, `${along}°`, here(along, 0), this.text, 9);
    for (let above = LABELS_DEG; above >= -LABELS_DEG; above -= GRID_DEG)
      if (above) this.word(pen, `${above > 0 ? "+" : "−"}${Math.abs(above)}°`, here(0, above), this.text, 9);
  }

  fillBody(pen, { name, direction: centre, radius_deg }, left, top, scale) {
    if (radius_deg * scale < (2 * FINE) / RAD) return; // no larger than its sign
    pen.fillStyle = this.colour(name);
    pen.globalAlpha = 0.22;
    const edge = Math.cos(radius_deg * RAD);
    for (let y = -scale; y < scale; y += FINE)
      for (let x = -2 * scale; x < 2 * scale; x += FINE) {
        const at = direction((x + FINE / 2) / scale, (y + FINE / 2) / scale);
        if (at && dot(turnedBack(this.sight.turn, at), centre) > edge)
          pen.fillRect(left + x, top + y, FINE, FINE);
      }
    pen.globalAlpha = 1;
  }

  body(pen, { name, direction: centre, radius_deg }) {
    const colour = this.colour(name);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = 1.5;
    if (radius_deg > 2) this.line(pen, circle(centre, radius_deg));
    disc(pen, this.place(centre), radius_deg > 2 ? 2 : 5);
    this.word(pen, name, centre, colour, 12, true);
  }

  field(pen, { name, axes, outline }, now) {
    const [, down, boresight] = axes;
    const colour = this.colour("field");
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = now ? 1 : 2;
    pen.setLineDash(now ? [4, 4] : []);
    this.line(pen, [...outline, outline[0]]);
    const up = boresight.map((part, i) => part - 0.14 * down[i]);
    if (!now) this.line(pen, [boresight, up]);
    pen.setLineDash([]);
    disc(pen, this.place(boresight), now ? 2 : 3.5);
    this.word(pen, now ? `${name} now` : name, boresight, colour, 16, true);
  }

  mark(pen, name, at) {
    const [x, y] = this.place(at);
    pen.fillStyle = this.text;
    pen.fillRect(x - 3, y - 0.5, 6, 1);
    pen.fillRect(x - 0.5, y - 3, 1, 6);
    this.word(pen, name, at, this.text, 10, true);
  }

  star(pen, { name, v_mag, at }) {
    pen.fillStyle = this.text;
    disc(pen, this.place(at), Math.max(0.5, 2.2 - 0.45 * v_mag));
    if (name && v_mag < NAMED) this.word(pen, name, at, this.text, 10);
  }

  ring(pen) {
    pen.strokeStyle = this.text;
    pen.lineWidth = 2;
    ring(pen, this.place(this.selected), 9);
  }

  // Text beside a direction where there is room; with `must` in the worst case over other text.
  word(pen, text, at, colour, aside, must = false) {
    const [x, y] = this.place(at);
    const wide = pen.measureText(text).width;
    const { width, height } = this.size();
    const around = (away) => [
      [x - wide / 2, y + away],
      [x - wide / 2, y - away],
      [x + away, y],
      [x - away - wide, y],
    ];
    const spots = (must ? [aside, 2 * aside, 3 * aside] : [aside])
      .flatMap(around)
      .map(([from, middle]) => ({ left: from, top: middle - TEXT / 2, wide }));
    const inside = (box) => box.left >= 0 && box.left + wide <= width && box.top >= 0 && box.top + TEXT <= height;
    const free = (box) => !this.taken.some((other) => overlap(box, other, TEXT + 1, 5));
    const box = spots.find((one) => inside(one) && free(one)) ?? (must ? spots.find(inside) : null);
    if (!box) return;
    this.taken.push(box);
    pen.textAlign = "left";
    pen.lineWidth = 3;
    pen.lineJoin = "round";
    pen.strokeStyle = this.ground;
    pen.strokeText(text, box.left, box.top + TEXT / 2);
    pen.fillStyle = colour;
    pen.fillText(text, box.left, box.top + TEXT / 2);
  }
}
