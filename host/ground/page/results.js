// What the latest result has beside its angles, pointings on a map of the sky, and the log of results.

import { atNextFrame, beside, button, disabledIf, make, row } from "./dom.js";
import { disc, line, ring } from "./draw.js";
import { saveFile } from "./server.js";

const TRAIL = 600;
const GRID_DEG = 30;

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
    const name = about.device.toLowerCase();
    const file = (end) => () => saveFile(`${path}/results/${end}`, `${name}.${end}`, report);
    place.append(
      row(
        beside("update every second", this.on),
        button("Save log as CSV", "save", file("csv"), none),
        button("Save log as Parquet", "save-parquet", file("parquet"), none ?? about.missing.parquet),
        this.count,
      ),
      make("table", {}, this.table),
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
    const rows = Object.entries(results)
      .filter(([name]) => !name.endsWith("_deg"))
      .map(([name, value]) => {
        const head = make("th", { scope: "row", textContent: name.replaceAll("_", " ") });
        return make("tr", {}, head, make("td", { className: "value", textContent: text(value) }));
      });
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

function text(value) {
  if (value === null) return "–";
  return typeof value !== "number" || Number.isInteger(value) ? String(value) : value.toFixed(5);
}
