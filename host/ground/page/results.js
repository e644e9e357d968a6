// What the device answered last, beside the truth where it is emulated, on the sky, and in a log.

import { atNextFrame, labelled, make, save } from "./dom.js";
import { fetched } from "./server.js";
import { apart, fromParts } from "./sphere.js";

const TRAIL = 600;
const GRID_DEG = 30;
const [ALPHA, BETA] = ["_alpha_deg", "_beta_deg"]; // ends of the names of a direction's angles

export class Results {
  // `path` leads to the target, `tell(text, kind)` tells what went wrong, `want(on)` says whether
  // results are to be read again and again.
  constructor(place, about, path, tell, want) {
    this.trail = []; // where it looked
    this.drawSoon = atNextFrame(() => this.draw());
    const none = about.missing.results;
    this.on = make("input", { type: "checkbox", id: "results-on", disabled: Boolean(none) });
    this.on.checked = !none;
    this.on.onchange = () => want(this.on.checked);
    this.count = make("span", { className: "quiet" });
    this.table = make("tbody");
    this.sky = make("canvas", { width: 720, height: 400, role: "img", hidden: true });
    this.sky.setAttribute("aria-label", "where the sensor looks on the sky");
    const heads = ["", "answer", "truth", "error"].map((text) => make("th", { textContent: text }));
    const name = about.device.toLowerCase();
    const button = (text, id, onclick, why) =>
      make("button", { textContent: text, id, type: "button", onclick, disabled: Boolean(why), title: why ?? "" });
    const file = (end) => async () => {
      try {
        save(await (await fetched(`${path}/results/${end}`)).blob(), `${name}.${end}`);
      } catch (error) {
        tell(`log of results\n  ${error.message}`, "bad");
      }
    };
    place.append(
      make(
        "div",
        { className: "row" },
        labelled("read every second", this.on, { className: "beside" }),
        button("Save log as CSV", "save", file("csv"), none),
        button("Save log as Parquet", "save-parquet", file("parquet"), none ?? about.missing.parquet),
        this.count,
      ),
      make("table", {}, make("thead", {}, make("tr", {}, ...heads)), this.table),
      this.sky,
    );
    if (none) this.count.textContent = none;
    want(this.on.checked);
  }

  // `kept` lines are in the log, which the server has.
  hear(results, truth = {}, kept = 0) {
    if ("error" in results) {
      this.count.textContent = results.error;
      return;
    }
    const rows = Object.entries(results).map(([name, value]) => {
      const true_ = name.endsWith("_deg") ? truth[name] : undefined;
      const known = true_ !== undefined && true_ !== null;
      const error = known && value !== null ? turned(value - true_) : null;
      if (known) return row(name, worded(name, value), worded(name, true_), error);
      const all = make("td", { className: "value", colSpan: 3, textContent: worded(name, value) });
      return make("tr", {}, make("th", { scope: "row", textContent: name }), all);
    });
    for (const { name, answer, true_ } of directions(results, truth)) {
      const error = answer && apart(answer, true_);
      const shown = row(`${name} direction`, answer ? pointed(answer) : "–", pointed(true_), error);
      shown.className = "direction";
      rows.push(shown);
    }
    this.table.replaceChildren(...rows);
    this.count.textContent = `${kept} lines`;
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
      line(pen, x(ra), y(-90), x(ra), y(90));
      if (ra < 360) pen.fillText(`${ra}°`, x(ra), y(-90) + 18);
    }
    pen.textAlign = "right";
    for (let dec = -90; dec <= 90; dec += GRID_DEG) {
      line(pen, x(360), y(dec), x(0), y(dec));
      pen.fillText(`${dec}°`, x(360) - 4, y(dec) + 5);
    }
    pen.textAlign = "center";
    pen.fillText("right ascension; declination upward", width / 2, height - 4);
    pen.fillStyle = "#2f81f7";
    for (const [ra, dec] of this.trail) dot(pen, x(ra), y(dec), 2);
    const last = this.trail.at(-1);
    if (last) dot(pen, x(last[0]), y(last[1]), 6);
    if (truth.ra_deg !== undefined) {
      pen.strokeStyle = "#d29922";
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(x(truth.ra_deg), y(truth.dec_deg), 11, 0, 2 * Math.PI);
      pen.stroke();
      pen.lineWidth = 1;
    }
  }
}

// Unit vectors of what is answered as two angles, and is known; none where nothing was detected.
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

function pointed(vector) {
  return vector.map((part) => part.toFixed(4)).join(" ");
}

function row(name, answer, true_, error) {
  const texts = [answer, true_, error === null ? "–" : error.toFixed(4)];
  const cells = texts.map((text) => make("td", { className: "value", textContent: text }));
  return make("tr", {}, make("th", { scope: "row", textContent: name }), ...cells);
}

function turned(deg) {
  return ((((deg + 180) % 360) + 360) % 360) - 180;
}

function worded(name, value) {
  if (value === null) return "–";
  const whole = typeof value !== "number" || (Number.isInteger(value) && !name.endsWith("_deg"));
  return whole ? String(value) : value.toFixed(5);
}

function line(pen, fromX, fromY, toX, toY) {
  pen.beginPath();
  pen.moveTo(fromX, fromY);
  pen.lineTo(toX, toY);
  pen.stroke();
}

function dot(pen, x, y, radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
}
