// The latest results beside the truth, pointings on a map of the sky, and the log of results.

import { atNextFrame, beside, button, disabledIf, make, row } from "./dom.js";
import { disc, line, ring } from "./draw.js";
import { saveFile } from "./server.js";
import { apart, fromParts } from "./sphere.js";

const TRAIL = 600;
const GRID_DEG = 30;
const [ALPHA, BETA] = ["_alpha_deg", "_beta_deg"]; // ends of the names of a direction's angles

export class Results {
  // `subscribe(on)` requests results in every update.
  constructor(place, about, path, report, subscribe) {
    this.trail = []; // past pointings
    this.drawSoon = atNextFrame(() => this.draw());
    const none = about.missing.results;
    this.on = make("input", { type: "checkbox", id: "results-on", checked: !none, ...disabledIf(none) });
    this.on.onchange = () => subscribe(this.on.checked);
    this.count = make("span", { className: "quiet", textContent: none ?? "" });
    this.table = make("tbody");
    this.sky = make("canvas", { width: 720, height: 400, role: "img", hidden: true });
    this.sky.setAttribute("aria-label", "pointings of the sensor on the sky");
    const heads = ["", "measured", "truth", "error"].map((text) => make("th", { textContent: text }));
    const name = about.device.toLowerCase();
    const file = (end) => () => saveFile(`${path}/results/${end}`, `${name}.${end}`, report);
    place.append(
      row(
        beside("update every second", this.on),
        button("Save log as CSV", "save", file("csv"), none),
        button("Save log as Parquet", "save-parquet", file("parquet"), none ?? about.missing.parquet),
        this.count,
      ),
      make("table", {}, make("thead", {}, make("tr", {}, ...heads)), this.table),
      this.sky,
    );
    subscribe(this.on.checked);
  }

  // `logged` is the number of lines in the server's log.
  update(results, truth = {}, logged = 0) {
    if ("error" in results) {
      this.count.textContent = results.error;
      return;
    }
    const rows = Object.entries(results).map(([name, value]) => {
      const true_ = name.endsWith("_deg") ? truth[name] : undefined;
      const known = true_ !== undefined && true_ !== null;
      const error = known && value !== null ? wrapped(value - true_) : null;
      if (known) return tableRow(name, text(name, value), text(name, true_), error);
      const all = make("td", { className: "value", colSpan: 3, textContent: text(name, value) });
      return make("tr", {}, make("th", { scope: "row", textContent: name }), all);
    });
    for (const { name, answer, true_ } of directions(results, truth)) {
      const error = answer && apart(answer, true_);
      const shown = tableRow(`${name} direction`, answer ? components(answer) : "–", components(true_), error);
      shown.className = "direction";
      rows.push(shown);
    }
    this.table.replaceChildren(...rows);
    this.count.textContent = `${logged} lines in the log`;
    if (!("ra_deg" in results)) return;
    if (results.ra_deg !== null) this.trail.push([results.ra_deg, results.dec_deg]);
    if (this.trail.length > TRAIL) this.trail.shift();
    this.truth = truth;
    this.drawSoon();
  }

  draw() {
    const { truth } = this;
    this.sky.hidden = false;
    const pen = this.sky.getContext("2d");
    const { width, height } = this.sky;
    const style = getComputedStyle(document.body);
    const margin = 34;
    const x = (ra) => margin + (1 - ra / 360) * (width - 2 * margin); // east is left
    const y = (dec) => 12 + (0.5 - dec / 180) * (height - 2 * margin);
    pen.clearRect(0, 0, width, height);
    pen.font = "15px system-ui, sans-serif";
    pen.strokeStyle = "#8886";
    pen.fillStyle = style.color;
    pen.textAlign = "center";
    for (let ra = 0; ra <= 360; ra += 2 * GRID_DEG) {
      line(pen, [x(ra), y(-90)], [x(ra), y(90)]);
      if (ra < 360) pen.fillText(`${ra}°`, x(ra), y(-90) + 18);
    }
    pen.textAlign = "right";
    for (let dec = -90; dec <= 90; dec += GRID_DEG) {
      line(pen, [x(360), y(dec)], [x(0), y(dec)]);
      pen.fillText(`${dec}°`, x(360) - 4, y(dec) + 5);
    }
    pen.textAlign = "center";
    pen.fillText("right ascension; declination upward", width / 2, height - 4);
    pen.fillStyle = "#2f81f7";
    for (const [ra, dec] of this.trail) disc(pen, [x(ra), y(dec)], 2);
    const last = this.trail.at(-1);
    if (last) disc(pen, [x(last[0]), y(last[1])], 6);
    if (truth.ra_deg !== undefined) {
      pen.strokeStyle = "#d29922";
      pen.lineWidth = 2;
      ring(pen, [x(truth.ra_deg), y(truth.dec_deg)], 11);
      pen.lineWidth = 1;
    }
  }
}

// Directions with a known truth, as unit vectors; `answer` is null if nothing was detected.
function directions(results, truth) {
  const names = Object.keys(results).filter((name) => name.endsWith(ALPHA));
  return names.flatMap((alpha) => {
    const name = alpha.slice(0, -ALPHA.length);
    const beta = name + BETA;
    const numbers = (from) => [from[alpha], from[beta]].every((part) => typeof part === "number");
    if (!numbers(truth)) return [];
    const answer = numbers(results) ? fromParts(results[alpha], results[beta]) : null;
    return [{ name, answer, true_: fromParts(truth[alpha], truth[beta]) }];
  });
}

function components(vector) {
  return vector.map((part) => part.toFixed(4)).join(" ");
}

function tableRow(name, answer, true_, error) {
  const texts = [answer, true_, error === null ? "–" : error.toFixed(4)];
  const cells = texts.map((text) => make("td", { className: "value", textContent: text }));
  return make("tr", {}, make("th", { scope: "row", textContent: name }), ...cells);
}

function wrapped(deg) {
  return ((((deg + 180) % 360) + 360) % 360) - 180;
}

function text(name, value) {
  if (value === null) return "–";
  const whole = typeof value !== "number" || (Number.isInteger(value) && !name.endsWith("_deg"));
  return whole ? String(value) : value.toFixed(5);
}
