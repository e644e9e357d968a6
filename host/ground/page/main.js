// The page: which target is looked at, and what the parts of the page have to do with each other.

import { Attitude } from "./attitude.js";
import { Commands } from "./commands.js";
import { make } from "./dom.js";
import { Emulation } from "./emulation.js";
import { Favourites } from "./favourites.js";
import { Lamps } from "./lamps.js";
import { Pictures } from "./picture.js";
import { Playback } from "./playback.js";
import { Results } from "./results.js";
import { Scene } from "./scene.js";
import { ask, listen } from "./server.js";
import { Transcript } from "./transcript.js";
import { Settings } from "./settings.js";
import { Start } from "./start.js";
import { Telemetry } from "./telemetry.js";
import { Timeline } from "./timeline.js";
import { Transfer } from "./transfer.js";
import { Waveform } from "./waveform.js";

const KEPT_LINES = 500;

const begun = Date.now();

const parts = [
  "played",
  "picture",
  "wire",
  "attitude",
  "said",
  "results",
  "loop",
  "health",
  "emulation",
  "start",
  "scene",
  "commands",
  "settings",
  "waveform",
  "telemetry",
];
const lines = document.getElementById("lines");
const link = document.getElementById("link");
let live = null;
let targets = [];
let looked = 0;
let renews = false;

function tell(text, kind = "") {
  const time = new Date().toLocaleTimeString();
  lines.prepend(make("li", { className: kind, textContent: `${time} ${text}` }));
  while (lines.children.length > KEPT_LINES) lines.lastChild.remove();
}

async function told(what, asked) {
  try {
    const answer = await asked;
    const rows = (answer.rows ?? []).map(([name, text]) => (name ? `${name}: ${text}` : text));
    tell([what, ...rows].join("\n  "), "good");
    return answer;
  } catch (error) {
    tell(`${what}\n  ${error.message}`, "bad");
    return null;
  }
}

function worded(results = {}) {
  return Object.fromEntries(Object.entries(results).filter(([, v]) => typeof v === "string"));
}

function look(number) {
  live?.close();
  looked = number;
  const about = targets[number];
  document.title = `${about.device} – cubestack`;
  for (const part of parts) {
    const place = document.getElementById(part);
    place.replaceChildren(place.querySelector("h2"));
  }
  const place = (part) => document.getElementById(part);
  const path = `/targets/${number}`;
  const act = (line) => told(line, ask(`${path}/do`, { line }));
  const steer = (call, body) => told(call, ask(`${path}/${call}`, body));
  const wanted = { show: [], results: false };
  const frames = {}; // by the part that shows them
  const want = (more) => {
    Object.assign(wanted, more);
    live?.want(wanted);
  };
  const show = (part, names) => {
    frames[part] = names;
    want({ show: [...new Set(Object.values(frames).flat())] });
  };
  const commands = new Commands(place("commands"), about, act);
  new Favourites(place("commands"), about, commands);
  new Settings(place("settings"), about, path, tell);
  new Transcript(place("said"), about, path, tell);
  const played = new Playback(place("played"), about, path, tell);
  const waveform = new Waveform(place("waveform"), about, path, tell);
  const emulation = new Emulation(place("emulation"), about, steer, act);
  new Start(place("start"), about, path, told);
  new Scene(place("scene"), about, path, told);
  const pictures = new Pictures(place("picture"), about, path, (every_s) => want({ every_s }));
  live = null; // what the parts want is told when it is there
  const transfer = new Transfer(place("wire"), path, about, tell);
  const attitude = new Attitude(place("attitude"), about);
  const timeline = new Timeline(place("loop"), about, (names) => show("loop", names));
  const lamps = new Lamps(place("health"), about, (names) => show("lamps", names));
  const results = new Results(place("results"), about, path, tell, (on) => want({ results: on }));
  const telemetry = new Telemetry(place("telemetry"), about, (names) => show("telemetry", names));
  live = listen(
    `${path}/live`,
    (message) => {
      if ((message.begun ?? about.begun) !== about.begun) {
        renew();
        return;
      }
      link.className = message.link.broken ? "bad" : "";
      link.textContent = about.name;
      lamps.hearLink(message.link);
      transfer.hear(message.carried);
      played.hear(message.played);
      const { truth, time_s } = message.emulation ?? {};
      if (message.values) {
        telemetry.hear(message.values);
        lamps.hear(message.values);
      }
      if (message.results) {
        results.hear(message.results, truth, message.kept);
        attitude.hear(message.results, truth);
      }
      const time = time_s ?? (Date.now() - begun) / 1000;
      timeline.hear(worded(message.results), message.values ?? {}, time);
      if (message.pictures) pictures.hear(message.pictures, message.emulation.busy);
      if (message.emulation) {
        emulation.hear(message.emulation);
        waveform.hear(message.emulation);
        lamps.hearEmulation(message.emulation);
      }
      for (const line of message.log ?? []) tell(line);
    },
    async () => {
      link.className = "bad";
      link.textContent = "the program behind this page has gone; waiting for it";
      // Another one in its place does not know this page.
      await ask("/targets").catch((error) => (link.textContent = `${error.message}; waiting`));
    },
  );
  live.want(wanted);
  for (const [index, button] of [...document.getElementById("targets").children].entries())
    button.setAttribute("aria-current", String(index === number));
}

// What is looked at was started again: what there is of it may be other things.
async function renew() {
  if (renews) return;
  renews = true;
  try {
    targets = await ask("/targets");
    look(looked);
  } catch (error) {
    tell(error.message, "bad");
  }
  renews = false;
}

async function start() {
  link.textContent = "waiting for the devices to start";
  targets = await ask("/targets");
  const buttons = targets.map((about, number) =>
    make("button", { textContent: about.device, onclick: () => look(number) }),
  );
  document.getElementById("targets").replaceChildren(...buttons);
  look(0);
}

start().catch((error) => tell(error.message, "bad"));
