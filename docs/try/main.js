// The page: picture, result, terminal.

import { Board, COLUMNS, ROWS } from "./board.js";
import { Device } from "./device.js";
import { decoded, encoded, framed, hex } from "./serial.js";

const MOST_LINES = 500;
const $ = (id) => document.getElementById(id);
const degrees = (radians) => (radians * 180) / Math.PI;

async function load(name, how) {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name} is missing: python -m docs.make_try builds it`);
  return answer[how]();
}

// Grey values of a PNG without filters, as docs/make_try.py writes it.
async function pixels(png) {
  const data = new DataView(png), parts = [];
  for (let at = 8; at < png.byteLength; at += 12 + data.getUint32(at)) {
    if (data.getUint32(at + 4) === 0x49444154) parts.push(png.slice(at + 8, at + 8 + data.getUint32(at)));
  }
  const inflated = new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate"));
  const rows = new Uint8Array(await new Response(inflated).arrayBuffer());
  const grey = new Uint8Array(COLUMNS * ROWS);
  for (let row = 0; row < ROWS; row++) {
    const start = row * (COLUMNS + 1) + 1;
    grey.set(rows.subarray(start, start + COLUMNS), row * COLUMNS);
  }
  return grey;
}

// All records of a telemetry frame that shows the next one at each read.
async function records(device, name, count) {
  const found = [];
  for (let n = 0; n < count; n++) found.push(await device.telemetry(name));
  return found;
}

async function takePicture(device) {
  await device.perform("CaptureAndProcess");
  const { taskStatus } = await device.telemetry("TaskStatus");
  const { NumStarsDetected } = await device.telemetry("DetectionSummary");
  const { numIdStars } = await device.telemetry("NumIdStars");
  const stars = await records(device, "StarPositions", NumStarsDetected);
  const named = await records(device, "HipparcosNumber", numIdStars);
  const attitude = await device.telemetry("AttitudeQuaternion");
  for (const star of stars)
    star.name = named.find((one) => one.StarNumber === star.StarNumber)?.Hipparcos;
  stars.sort((a, b) => a.StarNumber - b.StarNumber);
  return { taskStatus, stars, identified: numIdStars, attitude };
}

// Right ascension and declination of the boresight; the quaternion is inertial to camera.
function boresight({ Q0: x, Q1: y, Q2: z, Q3: w }) {
  const ra = degrees(Math.atan2(2 * (y * z + w * x), 2 * (x * z - w * y)));
  return { ra: (ra + 360) % 360, dec: degrees(Math.asin(1 - 2 * (x * x + y * y))) };
}

function draw(picture, stars) {
  const context = $("picture").getContext("2d");
  const image = context.createImageData(COLUMNS, ROWS);
  picture.forEach((grey, n) => {
    const shown = 255 * Math.min(1, grey / 64) ** 0.6; // faint stars too
    image.data.set([shown, shown, shown, 255], 4 * n);
  });
  context.putImageData(image, 0, 0);
  context.font = "15px system-ui, sans-serif";
  context.lineWidth = 2;
  for (const { X_Coordinate: x, Y_Coordinate: y, name } of stars) {
    context.strokeStyle = context.fillStyle = name ? "#5dd879" : "#f0b429";
    context.beginPath();
    if (name) context.arc(x, y, 12, 0, 2 * Math.PI);
    else context.rect(x - 10, y - 10, 20, 20);
    context.stroke();
    if (name) context.fillText(name, x > COLUMNS - 80 ? x - 70 : x + 15, y + 5);
  }
}

function show({ taskStatus, stars, identified, attitude }, sky) {
  const found = `${stars.length} stars detected, ${identified} identified.`;
  let words = `${found} No attitude: task status ${taskStatus}.`;
  if (attitude.Valid) {
    const { ra, dec } = boresight(attitude);
    const across = (ra - sky.ra) * Math.cos((dec * Math.PI) / 180), up = dec - sky.dec;
    const off = Math.round(3600 * Math.hypot(((across + 540) % 360) - 180, up));
    words =
      `${found} The camera points at right ascension ${ra.toFixed(3)}°, declination ` +
      `${dec.toFixed(3)}°: ${off} arcsec from the truth.`;
  }
  $("result").textContent = words;
  $("picture").setAttribute("aria-label", `Picture of the sky. ${words}`);
  $("stars").replaceChildren(
    ...stars.map((star) => {
      const row = document.createElement("tr");
      const columns = [star.X_Coordinate.toFixed(2), star.Y_Coordinate.toFixed(2)];
      for (const text of [star.StarNumber, ...columns, star.name ?? "not identified"])
        row.insertCell().textContent = text;
      return row;
    }),
  );
}

function log(text) {
  const line = document.createElement("div");
  line.textContent = text;
  $("log").append(line);
  while ($("log").childElementCount > MOST_LINES) $("log").firstChild.remove();
  $("log").scrollTop = $("log").scrollHeight;
}

// Controls keep the focus while a job runs.
function setBusy(busy) {
  for (const one of document.querySelectorAll("button, input, select")) {
    one.disabled = false;
    one.setAttribute("aria-disabled", busy);
  }
}

const reported = ({ ms, sent, bytes }) =>
  log(`${ms.toFixed(3)} ms ${sent ? "to" : "from"} the sensor: ${hex(bytes)}`);

async function enter(device, line) {
  const [name, ...values] = line.trim().split(/[\s,]+/);
  if (!name) return;
  if (name === "wait") {
    if (!(values[0] >= 1 && values[0] <= 60_000)) throw new Error("wait takes 1 to 60000 ms.");
    return device.wait(Math.round(values[0]));
  }
  const bytes = line.trim().split(/\s+/);
  if (bytes.every((one) => /^[0-9a-f]{2}$/i.test(one))) {
    if (!(await device.exchange(bytes.map((one) => parseInt(one, 16))))) log("no answer");
    return;
  }
  const message = device.message(name, values.length);
  const telemetry = message.kind === "telemetry";
  const payload = await device.exchange(framed([message.id, ...(telemetry ? [] : encoded(message, values))]));
  if (!payload) log("no answer");
  else if (telemetry)
    for (const [field, value] of Object.entries(decoded(message, payload))) log(`  ${field} ${value}`);
}

async function start() {
  const [wasm, firmware, messages, skies] = await Promise.all([
    load("board.wasm", "arrayBuffer"),
    load("firmware.bin", "arrayBuffer"),
    load("messages.json", "json"),
    load("skies.json", "json"),
  ]);
  await Promise.all(
    skies.map(async (sky) => (sky.pixels = await pixels(await load(sky.file, "arrayBuffer")))),
  );
  const module = await WebAssembly.compile(wasm);
  let sky, board, device, busy = false;
  const powerUp = async () => {
    sky = skies[$("sky").value];
    board = new Board(module, new Uint8Array(firmware), sky.pixels);
    device = new Device(board, messages, reported);
    log(`power-up: ${$("sky").selectedOptions[0].text}`);
    $("file").href = sky.file;
    $("file").hidden = false;
  };
  const act = async (job) => {
    if (busy) return;
    setBusy((busy = true));
    try {
      await job();
      $("status").textContent = `Ready, ${(board.ms / 1000).toFixed(3)} s after power-up.`;
    } catch (error) {
      $("status").textContent = error.message;
    }
    setBusy((busy = false));
  };
  $("sky").append(
    ...skies.map(({ ra, dec }, n) => new Option(`right ascension ${ra.toFixed(0)}°, declination ${dec.toFixed(0)}°`, n)),
  );
  $("names").append(...messages.map(({ name, meaning }) => new Option(meaning, name)));
  $("sky").onchange = () => act(powerUp);
  $("take").onclick = () =>
    act(async () => {
      $("status").textContent = "Taking a picture.";
      const seen = await takePicture(device);
      draw(board.picture, seen.stars);
      show(seen, sky);
    });
  $("terminal").onsubmit = (event) => {
    event.preventDefault();
    act(() => enter(device, $("line").value));
  };
  await act(powerUp);
}

start().catch((error) => {
  $("status").textContent = error.message;
});
