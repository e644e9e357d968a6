// A telemetry frame, and plots of any of its numbers over time.

import { atNextFrame, beside, button, choose, labelled, make, note, row } from "./dom.js";

const HEIGHT = 260;
const ZOOM = 2;
const MOVE = 0.25; // share of the time span
const MOST_POINTS = 3600; // of a plot: one hour at one point per second

const COLOURS = ["#2f81f7", "#d29922", "#3fb950", "#db61a2", "#a371f7", "#f0883e"];

export class Telemetry {
  // `subscribe(names)` requests telemetry frames in every update.
  constructor(place, about, subscribe) {
    this.byName = new Map(
      about.telemetries.filter((one) => one.supported).map((one) => [one.name, one]),
    );
    this.subscribe = subscribe;
    this.cells = new Map();
    this.plotted = [];
    this.times = [];
    this.drawSoon = atNextFrame(() => this.draw(true));
    this.name = choose([...this.byName.keys()], { id: "frame", onchange: () => this.show() });
    this.meaning = note();
    this.table = make("tbody");
    this.figure = make("div", { id: "plot" });
    this.zoomed = false; // to a time span that new values do not change
    const look = (text, id, title, factor, share) =>
      Object.assign(button(text, id, () => this.look(factor, share)), { title, ariaLabel: title });
    this.buttons = row(
      look("+", "plot-in", "Shorter time span", 1 / ZOOM, 0),
      look("−", "plot-out", "Longer time span", ZOOM, 0),
      look("◀", "plot-earlier", "Earlier", 1, -MOVE),
      look("▶", "plot-later", "Later", 1, MOVE),
      button("All", "plot-all", () => this.all()),
    );
    this.buttons.id = "plot-buttons";
    this.buttons.hidden = true;
    place.append(
      row(labelled("frame", this.name)),
      this.meaning,
      make("table", {}, this.table),
      this.buttons,
      this.figure,
    );
    new ResizeObserver(() => this.fit()).observe(this.figure);
    this.show();
  }

  // The frames that are shown or plotted.
  names() {
    return [...new Set([this.name.value, ...this.plotted.map((one) => one.frame)])];
  }

  show() {
    const one = this.byName.get(this.name.value);
    if (!one) return;
    const note = one.changes ? "; reading it has side effects" : "";
    this.meaning.textContent = `${one.id}: ${one.meaning}${note}`;
    this.cells.clear();
    const rows = one.fields.map((field) => {
      const value = make("td", { className: "value", textContent: "–" });
      this.cells.set(field.name, value);
      const number = !field.type.startsWith("bytes");
      const plot = make("input", {
        type: "checkbox",
        checked: this.plotted.some((p) => p.frame === one.name && p.field.name === field.name),
        onchange: () => this.toggle(one.name, field, plot.checked),
        title: `plot ${field.name}`,
        disabled: !number,
      });
      const name = make("th", { scope: "row", title: field.details, textContent: field.name });
      const unit = make("td", { className: "quiet", textContent: field.unit });
      return make("tr", {}, name, value, unit, make("td", {}, beside("plot", plot)));
    });
    this.table.replaceChildren(...rows);
    this.subscribe(this.names());
  }

  toggle(frame, field, on) {
    this.plotted = this.plotted.filter((p) => p.frame !== frame || p.field !== field);
    if (on) this.plotted.push({ frame, field, values: this.times.map(() => null) });
    this.subscribe(this.names());
    this.draw();
  }

  update(values) {
    const shown = values[this.name.value];
    const one = this.byName.get(this.name.value);
    if (shown && one) {
      for (const field of one.fields) {
        const cell = this.cells.get(field.name);
        cell.textContent = "error" in shown ? "–" : text(field, shown);
      }
      this.meaning.classList.toggle("bad", "error" in shown);
      this.meaning.textContent = shown.error ?? `${one.id}: ${one.meaning}`;
    }
    if (!this.plotted.length) return;
    this.times.push(Date.now() / 1000);
    for (const p of this.plotted) p.values.push(Number(values[p.frame]?.[p.field.name] ?? NaN));
    if (this.times.length > MOST_POINTS) {
      this.times.shift();
      for (const p of this.plotted) p.values.shift();
    }
    this.drawSoon();
  }

  draw(more = false) {
    const data = [this.times, ...this.plotted.map((p) => p.values)];
    if (more && this.plot) {
      this.plot.setData(data, !this.zoomed);
      if (this.zoomed) this.plot.redraw();
      return;
    }
    this.plot?.destroy();
    this.plot = null;
    this.zoomed = false;
    this.buttons.hidden = !this.plotted.length;
    if (!this.plotted.length) {
      this.times = [];
      return;
    }
    const text = getComputedStyle(document.body).color;
    const axis = { stroke: text, grid: { stroke: "#8884", width: 1 } };
    const time = { ...axis, label: "time of day" };
    const units = new Set(this.plotted.map((p) => p.field.unit).filter(Boolean));
    const series = this.plotted.map((p, index) => ({
      label: `${p.frame}.${p.field.name}${p.field.unit ? ` [${p.field.unit}]` : ""}`,
      stroke: COLOURS[index % COLOURS.length],
      dash: index < COLOURS.length ? [] : [6, 4],
      points: { size: 5 },
    }));
    this.plot = new globalThis.uPlot(
      {
        width: this.figure.clientWidth || 300,
        height: HEIGHT,
        axes: [time, { ...axis, label: [...units].join(", ") || "value" }],
        series: [{ label: "time", value: "{HH}:{mm}:{ss}.{fff}" }, ...series],
        hooks: { setSelect: [() => (this.zoomed = true)] }, // by dragging
      },
      data,
      this.figure,
    );
    this.plot.over.addEventListener("dblclick", () => (this.zoomed = false));
  }

  // Zooms by a factor, and moves by a share of the visible time span.
  look(factor, share) {
    const { min, max } = this.plot.scales.x;
    const [middle, half] = [(min + max) / 2 + share * (max - min), ((max - min) / 2) * factor];
    this.zoomed = true;
    this.plot.setScale("x", { min: middle - half, max: middle + half });
  }

  all() {
    this.zoomed = false;
    this.draw(true);
  }

  fit() {
    if (this.figure.clientWidth) this.plot?.setSize({ width: this.figure.clientWidth, height: HEIGHT });
  }
}

function text(field, values) {
  const value = values[field.name];
  const name = valueName(field, values);
  if (name) return `${name} (${value})`;
  if (typeof value === "number" && !Number.isInteger(value)) return value.toPrecision(7);
  return String(value);
}

// The name of the field's value in a frame; undefined if it has none.
export function valueName(field, values) {
  const value = Number(values[field.name]);
  const [other, sets] = field.choices_by ?? [];
  const choices = field.choices ?? sets?.[Number(values[other])] ?? {};
  return Object.keys(choices).find((name) => choices[name] === value);
}

export function hasNames(field) {
  return Boolean(field.choices ?? field.choices_by);
}
