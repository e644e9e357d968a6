// The measured and, if known, the true attitude on a sphere of the sky seen from outside.

import { atNextFrame, make, note } from "./dom.js";
import { disc, line, ring } from "./draw.js";
import { cross, RAD, vector } from "./sphere.js";

const SIZE = 420;
const RADIUS = 150;
const LENGTH = 1.18; // of the boresight, in radii
const AXIS = 0.35; // of the image's axes, in radii
const TURN_DEG = 10; // per arrow key
const ASIDE_DEG = 35; // of the first boresight from the viewer
const MEASURED = "#2f81f7";
const TRUE = "#d29922";
const STEPS = 60;

export class Attitude {
  constructor(place, about) {
    const none = about.missing.results;
    this.device = about.device;
    this.drawSoon = atNextFrame(() => this.draw());
    this.azimuth = -30 * RAD;
    this.height = 20 * RAD;
    this.status = note(none ?? "no attitude yet", { id: "attitude-status" });
    this.canvas = make("canvas", {
      id: "sphere",
      width: SIZE,
      height: SIZE,
      tabIndex: 0,
      role: "img",
      hidden: Boolean(none),
    });
    this.canvas.setAttribute("aria-label", "attitude on a sphere of the sky; arrow keys turn it");
    this.canvas.onkeydown = (event) => this.turnBy(event);
    this.canvas.onpointerdown = (event) => this.canvas.setPointerCapture(event.pointerId);
    this.canvas.onpointermove = (event) => {
      if (event.buttons) this.turn(event.movementX / RADIUS, event.movementY / RADIUS);
    };
    place.append(this.status, this.canvas);
    if (!none) this.draw();
  }

  update(results, truth = {}) {
    this.canvas.hidden = !("ra_deg" in results);
    if (this.canvas.hidden) {
      this.status.textContent = results.error ?? `${this.device} reports no attitude`;
      return;
    }
    const valid = results.ra_deg !== null;
    if (valid) this.measured = axes(results);
    if (valid && !this.turned) this.azimuth = (ASIDE_DEG - 90 - results.ra_deg) * RAD;
    this.turned ||= valid;
    this.truth = typeof truth.ra_deg === "number" ? axes(truth) : null;
    const words = [];
    if (valid) words.push(`measured ${text(results)}`);
    else words.push(`no valid attitude${this.measured ? "; showing the last one" : ""}`);
    if (this.truth) words.push(`truth ${text(truth)}`);
    if (this.truth && valid)
      words.push(`total error ${turn(this.measured, this.truth).toFixed(4)}°`);
    this.status.textContent = words.join("; ");
    this.drawSoon();
  }

  turnBy(event) {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const [across, down] = by[event.key] ?? [0, 0];
    if (!across && !down) return;
    event.preventDefault();
    this.turn(across * TURN_DEG * RAD, down * TURN_DEG * RAD);
  }

  turn(across, down) {
    this.azimuth += across;
    this.height = Math.min(Math.max(this.height + down, -Math.PI / 2), Math.PI / 2);
    this.draw();
  }

  // Column, row and depth (positive in front) of a point; x is right, z up, seen along -y.
  project([x, y, z]) {
    const [c, s] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [right, far] = [c * x - s * y, s * x + c * y];
    const [ch, sh] = [Math.cos(this.height), Math.sin(this.height)];
    const [up, near] = [ch * z + sh * far, sh * z - ch * far];
    return [SIZE / 2 + RADIUS * right, SIZE / 2 - RADIUS * up, near];
  }

  draw() {
    const pen = this.canvas.getContext("2d");
    const text = getComputedStyle(document.body).color;
    pen.clearRect(0, 0, SIZE, SIZE);
    pen.font = "14px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    for (let ra = 0; ra < 360; ra += 30) this.curve(pen, (t) => vector(ra, 180 * t - 90));
    for (let dec = -60; dec <= 60; dec += 30) this.curve(pen, (t) => vector(360 * t, dec));
    pen.fillStyle = text;
    for (let ra = 0; ra < 360; ra += 90) this.word(pen, `${ra / 15} h`, vector(ra, 0));
    this.word(pen, "N", vector(0, 90));
    this.word(pen, "S", vector(0, -90));
    pen.strokeStyle = "#888";
    ring(pen, [SIZE / 2, SIZE / 2], RADIUS);
    if (this.truth) this.arrow(pen, this.truth, TRUE, [6, 4]);
    if (this.measured) this.arrow(pen, this.measured, MEASURED, []);
    pen.textAlign = "left";
    pen.fillStyle = MEASURED;
    pen.fillText("– measured", 8, SIZE - 34);
    if (this.measured) this.name(pen, this.measured);
    pen.fillStyle = TRUE;
    pen.fillText("- - truth", 8, SIZE - 14);
  }

  // Its front half is drawn stronger.
  curve(pen, at) {
    for (let step = 0; step < STEPS; step++) {
      const from = this.project(at(step / STEPS));
      const to = this.project(at((step + 1) / STEPS));
      pen.strokeStyle = from[2] > 0 ? "#888b" : "#8883";
      line(pen, from, to);
    }
  }

  word(pen, text, direction) {
    const [column, row, near] = this.project(direction.map((part) => 1.1 * part));
    pen.globalAlpha = near > 0 ? 1 : 0.35;
    pen.fillText(text, column, row);
    pen.globalAlpha = 1;
  }

  // Labels the axes of the image.
  name(pen, { boresight, right, up }) {
    for (const [text, side] of [["up", up], ["right", right]]) {
      const at = boresight.map((part, i) => LENGTH * part + 1.25 * AXIS * side[i]);
      const [column, row] = this.project(at);
      pen.fillText(text, column - pen.measureText(text).width / 2, row);
    }
  }

  // Draws the boresight, with up and right of the image at its end.
  arrow(pen, { boresight, right, up }, colour, dash) {
    const end = boresight.map((part) => LENGTH * part);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.setLineDash(dash);
    for (const [width, from, to] of [
      [3, [0, 0, 0], end],
      [2, end, end.map((part, i) => part + AXIS * up[i])],
      [1, end, end.map((part, i) => part + AXIS * right[i])],
    ]) {
      const [start, stop] = [this.project(from), this.project(to)];
      pen.lineWidth = width;
      line(pen, start, stop);
    }
    pen.setLineDash([]);
    pen.lineWidth = 1;
    disc(pen, this.project(end), 5);
  }
}

// Camera axes on the sky; roll turns the image's up from north to east.
export function axes({ ra_deg, dec_deg, roll_deg }) {
  const boresight = vector(ra_deg, dec_deg);
  const north = vector(ra_deg, dec_deg + 90);
  const east = vector(ra_deg + 90, 0);
  const [c, s] = [Math.cos(roll_deg * RAD), Math.sin(roll_deg * RAD)];
  const up = north.map((part, i) => c * part + s * east[i]);
  return { boresight, up, right: cross(boresight, up) };
}

// Rotation angle between two sets of axes in degrees, precise for small ones too.
export function turn(a, b) {
  const rows = (one) => [one.right, one.up, one.boresight];
  const far = rows(a).flatMap((row, i) => row.map((part, j) => (part - rows(b)[i][j]) ** 2));
  const size = Math.sqrt(far.reduce((sum, part) => sum + part, 0)); // sqrt(8) sin(angle / 2)
  return (2 * Math.asin(Math.min(size / Math.sqrt(8), 1))) / RAD;
}

function text({ ra_deg, dec_deg, roll_deg }) {
  return [ra_deg, dec_deg, roll_deg].map((deg) => `${deg.toFixed(4)}°`).join(" ");
}
