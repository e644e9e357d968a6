// Shows the selected target, and distributes its live updates to the parts of the page.
//
// Parts are built with the section that they fill, `about`: the target's tables, the `path` of its
// requests, and `report(text, kind)`, which writes a line into the log.

import { Attitude } from "./attitude.js";
import { Answer } from "./answer.js";
import { Commands, Favourites } from "./commands.js";
import { make } from "./dom.js";
import { Emulation } from "./emulation.js";
import { Faults } from "./faults.js";
import { Lamps } from "./lamps.js";
import { Pictures } from "./picture.js";
import { Playback, Transcript } from "./recording.js";
import { Results } from "./results.js";
import { Scene } from "./scene/scene.js";
import { ask, listen } from "./server.js";
import { Settings } from "./settings.js";
import { Start } from "./start.js";
import { Tabs } from "./tabs.js";
import { Telemetry } from "./telemetry.js";
import { Timeline } from "./timeline.js";
import { Transfer } from "./transfer.js";
import { Waveform } from "./waveform.js";

const MOST_LINES = 500;

// What an operator needs at once, then everything else, in tabs of one purpose each.
const FIRST = { picture: "Image", answer: "Latest result", log: "Log", playback: "Playback" };
const TABS = {
  commands: ["Commands", { commands: "Commands", settings: "Settings and registers", transfer: "Image transfer" }],
  telemetry: ["Telemetry", { telemetry: "Telemetry frames", health: "Flags, supplies, link" }],
  results: ["Results", { attitude: "Attitude", results: "Results", timeline: "Timeline" }],
  scene: ["Scene", { scene: "Scene" }],
  faults: ["Faults", { faults: "Faults" }],
  time: ["Time", { emulation: "Virtual time", start: "Profile and firmware" }],
  record: ["Record", { transcript: "Recording", waveform: "Waveform" }],
};

const opened = Date.now();
const lines = make("ol", { id: "lines", tabIndex: 0, "aria-live": "polite", "aria-labelledby": "log-title" });
const link = document.getElementById("link");
let live = null;
let targets = [];
let selected = -1;
let frozen = false;
const tabs = new Tabs(Object.fromEntries(Object.entries(TABS).map(([name, [title]]) => [name, title])), () => place());
let reloading = false;

function section(id, name) {
  const title = make("h2", { id: `${id}-title`, textContent: name });
  return make("section", { id, "aria-labelledby": title.id }, title);
}

function sections(titles) {
  return Object.entries(titles).map(([id, name]) => section(id, name));
}

function addSections() {
  const first = make("div", { id: "first" }, ...sections(FIRST));
  for (const [name, [, titles]] of Object.entries(TABS)) tabs.panel(name).append(...sections(titles));
  document.querySelector("main").append(first, tabs.list, tabs.panels);
  document.getElementById("log").append(lines);
  document.getElementById("freeze").onclick = freeze;
  document.addEventListener("keydown", shortcut);
}

// The address names the target and the tab: `#CubeStar/scene`.
function follow() {
  const [device, tab] = decodeURIComponent(location.hash.slice(1)).split("/");
  tabs.show(tab);
  const number = Math.max(targets.findIndex((about) => about.device === device), 0);
  if (number !== selected) select(number);
}

function place() {
  history.replaceState(null, "", `#${encodeURIComponent(targets[selected].device)}/${tabs.shown}`);
}

// Holds what the page shows; the device and its time go on.
function freeze() {
  frozen = !frozen;
  const button = document.getElementById("freeze");
  button.setAttribute("aria-pressed", String(frozen));
  button.textContent = frozen ? "Resume display" : "Pause display";
}

function shortcut(event) {
  const types = event.target.closest("input, select, textarea, dialog");
  if (event.key === "p" && !types && !event.ctrlKey && !event.altKey && !event.metaKey)
    document.getElementById("take").click();
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
  place();
  for (const section of document.querySelectorAll("section:not(#log)"))
    section.replaceChildren(section.querySelector("h2"));
  const at = (part) => document.getElementById(part);
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
  const commands = new Commands(at("commands"), about, execute);
  new Favourites(at("commands"), about, commands);
  new Settings(at("settings"), about, path, report);
  new Transcript(at("transcript"), about, path, report);
  const playback = new Playback(at("playback"), about, path, report);
  const waveform = new Waveform(at("waveform"), about, path, report);
  const emulation = new Emulation(at("emulation"), about, control);
  new Faults(at("faults"), about, execute);
  new Start(at("start"), about, path, reported);
  new Scene(at("scene"), about, path, reported);
  const pictures = new Pictures(at("picture"), about, path, (every_s) => subscribe({ every_s }), reported);
  const answer = new Answer(at("answer"), about);
  const transfer = new Transfer(at("transfer"), path, about, report);
  const attitude = new Attitude(at("attitude"), about);
  const timeline = new Timeline(at("timeline"), about, (names) => show("timeline", names));
  const lamps = new Lamps(at("health"), about, (names) => show("lamps", names), (set) => answer.showFlags(set));
  const results = new Results(at("results"), about, path, report, (on) => subscribe({ results: on }));
  const telemetry = new Telemetry(at("telemetry"), about, (names) => show("telemetry", names));
  let latest = 0; // virtual time of the last message
  live = listen(
    `${path}/live`,
    (message) => {
      if ((message.restarts ?? about.restarts) !== about.restarts) {
        reload();
        return;
      }
      const { broken, error } = message.link;
      link.className = broken ? "bad" : "good";
      link.textContent = `${about.name}: ${broken ? error : "answers"}`;
      if (frozen) return;
      lamps.updateLink(message.link);
      transfer.update(message.transfer);
      playback.update(message.playback);
      const { truth, time_s } = message.emulation ?? {};
      if (time_s < latest) {
        lamps.update({});
        answer.forget();
      }
      latest = time_s ?? latest; // it has none while the emulation does not answer
      if (message.values) {
        telemetry.update(message.values);
        lamps.update(message.values);
      }
      if (message.results) {
        answer.update(message.results, truth, message.summary);
        results.update(message.results, truth, message.results_logged);
        attitude.update(message.results, truth);
      }
      const time = time_s ?? (Date.now() - opened) / 1000;
      timeline.update(textsOf(message.results), message.values ?? {}, time);
      if (message.pictures) pictures.update(message.pictures, message.emulation.busy);
      if (message.emulation) {
        emulation.update(message.emulation);
        pictures.updateTime(message.emulation);
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
  window.addEventListener("hashchange", follow);
  follow();
}

start().catch((error) => report(error.message, "bad"));
