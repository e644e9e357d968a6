// A client of the board's serial port. Virtual time passes only while a request waits for its
// answer, or for `wait`; each request starts at a whole millisecond.

import { Deframer, decoded, framed } from "./serial.js";

const BOOT_MS = 10, ANSWER_MS = 1000, PROCESSED_MS = 10_000, POLL_MS = 20;
const SLICE_MS = 25; // of wall time; then the browser draws

export class Device {
  #board;
  #messages;
  #deframer = new Deframer();
  #arriving = []; // bytes that are on the line

  // `report({ ms, sent, bytes })` is called with each frame on the line.
  constructor(board, messages, report) {
    this.#board = board;
    this.#messages = messages;
    this.report = report;
    board.run(BOOT_MS);
  }

  // With parameters, the telecommand of that name, else the telemetry frame if there is one.
  message(name, parameters = 0) {
    const found = this.#messages.filter((one) => one.name.toLowerCase() === name.toLowerCase());
    if (!found.length) throw new Error(`There is no message ${name}.`);
    return found.find((one) => one.kind === (parameters ? "telecommand" : "telemetry")) ?? found[0];
  }

  // Sends bytes; returns the payload of the next frame, null without an answer.
  async exchange(bytes) {
    this.#board.write(bytes);
    this.report({ ms: this.#board.ms, sent: true, bytes });
    return this.#until((payload) => payload, ANSWER_MS);
  }

  async telemetry(name) {
    const message = this.message(name);
    const payload = await this.exchange(framed([message.id]));
    if (payload?.length !== message.length) throw new Error(`No answer to ${name}.`);
    return decoded(message, payload);
  }

  // Sends a telecommand, and waits until it is processed.
  async perform(name) {
    const payload = await this.exchange(framed([this.message(name).id]));
    if (payload?.[0] !== 0) throw new Error(`${name} was not accepted.`);
    const until = this.#board.ms + PROCESSED_MS;
    while (!(await this.telemetry("TcmdProcessed")).Processed) {
      if (this.#board.ms > until) throw new Error(`${name} was not processed.`);
      await this.wait(POLL_MS);
    }
  }

  wait(ms) {
    return this.#until(() => false, ms);
  }

  // Runs until `wanted` accepts the payload of a frame, at most for `ms`.
  async #until(wanted, ms) {
    let slice = performance.now();
    for (const end = this.#board.ms + ms; this.#board.ms < end; ) {
      this.#arriving.push(...this.#board.run(1));
      let accepted = null;
      while (this.#arriving.length && this.#arriving[0].ms <= this.#board.ms) {
        const { byte, ms: at } = this.#arriving.shift();
        const payload = this.#deframer.take(byte);
        if (!payload) continue;
        this.report({ ms: at, sent: false, bytes: framed(payload), payload });
        if (wanted(payload)) accepted ??= payload;
      }
      if (accepted) return accepted;
      if (performance.now() - slice > SLICE_MS) {
        await new Promise((go) => setTimeout(go));
        slice = performance.now();
      }
    }
    return null;
  }
}
