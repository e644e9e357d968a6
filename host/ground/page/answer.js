// The latest result in words, its angles beside the truth, and the flags that are set.

import { axes, turn } from "./attitude.js";
import { make, note } from "./dom.js";
import { apart, fromParts } from "./sphere.js";

const [ALPHA, BETA] = ["_alpha_deg", "_beta_deg"]; // ends of the names of a direction's angles
const ARCSEC = 3600; // per degree
const SMALL = 0.1; // errors below are shown in arcsec

export class Answer {
  constructor(place, about) {
    this.why = about.missing.results;
    this.summary = make("p", { id: "summary", role: "status", textContent: this.why ?? "waiting for the device" });
    const heads = ["angle", "measured", "truth", "error"].map((text) => make("th", { textContent: text, scope: "col" }));
    this.angles = make("tbody");
    this.table = make("table", { id: "angles", hidden: true }, make("thead", {}, make("tr", {}, ...heads)), this.angles);
    this.truth = note("", { id: "truth" });
    this.flags = make("ul", { id: "flags-set", className: "flags" });
    this.flags.setAttribute("aria-label", "flags that are set");
    place.append(this.summary, this.table, this.truth, this.flags);
    this.emulated = !about.missing.controls;
  }

  update(results, truth = {}, summary = "") {
    const failed = "error" in results;
    this.summary.className = failed ? "bad" : "";
    this.summary.textContent = failed ? results.error : summary && `${summary[0].toUpperCase()}${summary.slice(1)}.`;
    if (failed) return;
    const rows = angleRows(results, truth);
    this.table.hidden = !rows.length;
    this.angles.replaceChildren(...rows);
    const off = error(results, truth);
    const what = truth.ra_deg === undefined ? "Direction" : "Attitude";
    const compared = off === null ? "Results are compared with the truth." : `${what} ${small(off)} from the truth.`;
    this.truth.textContent = this.emulated ? compared : "The truth is known for emulated devices only.";
  }

  // Time went back, and what was read is of a time that has not come.
  forget() {
    this.summary.className = "";
    this.summary.textContent = "Time went back. Results are read again when it runs.";
    for (const cell of this.angles.querySelectorAll("td")) cell.textContent = "–";
    this.truth.textContent = "Results are compared with the truth.";
  }

  // `set`: elements of the flags that are set.
  showFlags(set) {
    this.flags.replaceChildren(...set);
  }
}

// Angle between the measured attitude and the true one, or the largest between directions, in deg;
// null if either is unknown.
function error(results, truth) {
  const known = ({ ra_deg, dec_deg, roll_deg }) => [ra_deg, dec_deg, roll_deg].every(Number.isFinite);
  if (known(results) && known(truth)) return turn(axes(results), axes(truth));
  const found = directions(results, truth).map(({ answer, true_ }) => answer && true_ && apart(answer, true_));
  const angles = found.filter((angle) => angle !== null);
  return angles.length ? Math.max(...angles) : null;
}

// A row for each angle, and the error of each direction.
function angleRows(results, truth) {
  const rows = Object.entries(results)
    .filter(([name]) => name.endsWith("_deg"))
    .map(([name, value]) => {
      const true_ = truth[name] ?? null;
      const error = true_ !== null && value !== null ? wrapped(value - true_) : null;
      return tableRow(label(name), text(value), true_ === null ? "–" : text(true_), error);
    });
  for (const { name, answer, true_ } of directions(results, truth)) {
    const error = answer && true_ && apart(answer, true_);
    const row = tableRow(`${label(name)} direction`, "", "", error);
    row.title = `measured ${components(answer)}, true ${components(true_)}`;
    rows.push(row);
  }
  return rows;
}

// Directions as unit vectors; null if nothing was detected, or no truth is known.
function directions(results, truth) {
  const names = Object.keys(results).filter((name) => name.endsWith(ALPHA));
  return names
    .map((name) => name.slice(0, -ALPHA.length))
    .map((name) => ({ name, answer: direction(results, name), true_: direction(truth, name) }));
}

function direction(angles, name) {
  const [alpha, beta] = [angles[name + ALPHA], angles[name + BETA]];
  return typeof alpha === "number" && typeof beta === "number" ? fromParts(alpha, beta) : null;
}

function components(vector) {
  return vector?.map((part) => part.toFixed(4)).join(" ") ?? "–";
}

function tableRow(name, answer, true_, error) {
  const texts = [answer, true_, error === null ? "–" : small(error)];
  const cells = texts.map((text) => make("td", { className: "value", textContent: text }));
  return make("tr", {}, make("th", { scope: "row", textContent: name }), ...cells);
}

const NAMES = { ra: "right ascension", dec: "declination" };

function label(name) {
  const plain = name.replace(/_deg$/, "");
  return NAMES[plain] ?? plain.replaceAll("_", " ");
}

function text(deg) {
  return deg === null ? "–" : `${deg.toFixed(4).replace(/^-(?=[0.]+$)/, "")}°`;
}

function small(deg) {
  return Math.abs(deg) < SMALL ? `${(deg * ARCSEC).toFixed(1)}″` : `${deg.toFixed(4)}°`;
}

function wrapped(deg) {
  return ((((deg + 180) % 360) + 360) % 360) - 180;
}
