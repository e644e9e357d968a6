// Shows the selected target, and distributes its live updates to the parts of the page.
//
// Parts are built with the section that they fill, `about`: the target's tables, the `path` of its
// requests, and `report(text, kind)`, which writes a line into the log.

import { Attitude } from "./attitude.js";
import { Commands, Favourites } from "./commands.js";
import { make } from "./dom.js";
import { Emulation } from "./emulation.js";
import { Lamps } from "./lamps.js";
import { Pictures } from "./picture.js";
import { Playback, Transcript } from "./recording.js";
import { Results } from "./results.js";
import { Scene } from "./scene/scene.js";
import { ask, listen } from "./server.js";
import { Settings } from "./settings.js";
import { Start } from "./start.js";
import { Telemetry } from "./telemetry.js";
import { Timeline } from "./timeline.js";
import { Transfer } from "./transfer.js";
import { Waveform } from "./waveform.js";

const MOST_LINES = 500;

const TITLES = {
  playback: "Playback",
  picture: "Image",
  transfer: "Image transfer",
  attitude: "Attitude",
  commands: "Commands",
  settings: "Settings and registers",
  log: "Log",
  transcript: "Recording",
  results: "Results",
  timeline: "Timeline",
  health: "Health",
  emulation: "Emulation",
  start: "Profile and firmware",
  scene: "Scene",
  waveform: "Waveform",
  telemetry: "Telemetry",
};

const opened = Date.now();
const lines = make("ol", { id: "lines", "aria-live": "polite" });
const link = document.getElementById("link");
let live = null;
let targets = [];
let selected = 0;
let reloading = false;

function addSections() {
  for (const [id, textContent] of Object.entries(TITLES)) {
    const title = make("h2", { id: `${id}-title`, textContent });
    const attributes = { id, "aria-labelledby": title.id, hidden: id === "playback" };
    document.querySelector("main").append(make("section", attributes, title));
  }
  document.getElementById("log").append(lines);
}

function report(text, kind = "") {
  const time = new Date().toLocaleTimeString();
  lines.prepend(make("li", { className: kind, textContent: `${time} ${text}` }));
  while (lines.children.length > MOST_LINES) lines.lastChild.remove();
}

// Reports the answer to a request, or its error; returns the answer or null.
async function reported(what, request) {
  try {
    const answer = await request;
    const rows = (answer.rows ?? []).map(([name, text]) => (name ? `${name}: ${text}` : text));
    report([what, ...rows].join("\n  "), "good");
    return answer;
  } catch (error) {
    report(`${what}\n  ${error.message}`, "bad");
    return null;
  }
}

function textsOf(results = {}) {
  return Object.fromEntries(Object.entries(results).filter(([, v]) => typeof v === "string"));
}

function select(number) {
  live?.close();
  selected = number;
  const about = targets[number];
  document.title = `${about.device} – cubestack`;
  for (const section of document.querySelectorAll("main > section:not(#log)"))
    section.replaceChildren(section.querySelector("h2"));
  const place = (part) => document.getElementById(part);
  const path = `/targets/${number}`;
  const execute = (line) => reported(line, ask(`${path}/shell`, { line }));
  const control = (call, body) => reported(call, ask(`${path}/${call}`, body));
  const subscription = { show: [], results: false };
  const frames = {}; // by the part that shows them
  const subscribe = (more) => {
    Object.assign(subscription, more);
    live?.subscribe(subscription);
  };
  const show = (part, names) => {
    frames[part] = names;
    subscribe({ show: [...new Set(Object.values(frames).flat())] });
  };
  live = null; // the parts' subscriptions are sent together, once it is open
  const commands = new Commands(place("commands"), about, execute);
  new Favourites(place("commands"), about, commands);
  new Settings(place("settings"), about, path, report);
  new Transcript(place("transcript"), about, path, report);
  const playback = new Playback(place("playback"), about, path, report);
  const waveform = new Waveform(place("waveform"), about, path, report);
  const emulation = new Emulation(place("emulation"), about, control, execute);
  new Start(place("start"), about, path, reported);
  new Scene(place("scene"), about, path, reported);
  const pictures = new Pictures(place("picture"), about, path, (every_s) => subscribe({ every_s }));
  const transfer = new Transfer(place("transfer"), path, about, report);
  const attitude = new Attitude(place("attitude"), about);
  const timeline = new Timeline(place("timeline"), about, (names) => show("timeline", names));
  const lamps = new Lamps(place("health"), about, (names) => show("lamps", names));
  const results = new Results(place("results"), about, path, report, (on) => subscribe({ results: on }));
  const telemetry = new Telemetry(place("telemetry"), about, (names) => show("telemetry", names));
  live = listen(
    `${path}/live`,
    (message) => {
      if ((message.restarts ?? about.restarts) !== about.restarts) {
        reload();
        return;
      }
      link.className = message.link.broken ? "bad" : "";
      link.textContent = about.name;
      lamps.updateLink(message.link);
      transfer.update(message.transfer);
      playback.update(message.playback);
      const { truth, time_s } = message.emulation ?? {};
      if (message.values) {
        telemetry.update(message.values);
        lamps.update(message.values);
      }
      if (message.results) {
        results.update(message.results, truth, message.results_logged);
        attitude.update(message.results, truth);
      }
      const time = time_s ?? (Date.now() - opened) / 1000;
      timeline.update(textsOf(message.results), message.values ?? {}, time);
      if (message.pictures) pictures.update(message.pictures, message.emulation.busy);
      if (message.emulation) {
        emulation.update(message.emulation);
        waveform.update(message.emulation);
        lamps.updateSupplies(message.emulation);
      }
      for (const line of message.log ?? []) report(line);
    },
    async () => {
      link.className = "bad";
      link.textContent = "connection to the server lost; reconnecting";
      // Another server on the same port rejects this page's token.
      await ask("/targets").catch((error) => (link.textContent = `${error.message}; reconnecting`));
    },
  );
  live.subscribe(subscription);
  for (const [index, button] of [...document.getElementById("targets").children].entries())
    button.setAttribute("aria-current", String(index === number));
}

// After a restart of the emulation, its tables and options may be others.
async function reload() {
  if (reloading) return;
  reloading = true;
  try {
    targets = await ask("/targets");
    select(selected);
  } catch (error) {
    report(error.message, "bad");
  }
  reloading = false;
}

async function start() {
  addSections();
  link.textContent = "waiting for the devices to start";
  targets = await ask("/targets");
  const buttons = targets.map((about, number) =>
    make("button", { textContent: about.device, onclick: () => select(number) }),
  );
  document.getElementById("targets").replaceChildren(...buttons);
  select(0);
}

start().catch((error) => report(error.message, "bad"));
