// The board in WebAssembly: bytes in, bytes out, in virtual time. board/board.cpp has its parts.

export const COLUMNS = 1024, ROWS = 512;

export class Board {
  #calls;

  // `module`: a WebAssembly.Module; `firmware`: bytes of the flash; `sky`: grey values, row by row.
  constructor(module, firmware, sky) {
    const system = {}; // nothing of it is called unless the program fails
    for (const { module: owner, name } of WebAssembly.Module.imports(module))
      (system[owner] ??= {})[name] = () => 0;
    this.#calls = new WebAssembly.Instance(module, system).exports;
    this.#calls._initialize();
    this.#memory(this.#calls.board_flash(), 1 << 20).fill(0xff).set(firmware);
    this.ms = 0; // since power-up
    this.#memory(this.#calls.board_sky(), COLUMNS * ROWS).set(sky); // what the camera sees
    this.#calls.board_power_up();
  }

  // The memory in which the firmware keeps its image.
  get picture() {
    return this.#memory(this.#calls.board_external(), COLUMNS * ROWS).slice();
  }

  // The host starts to send, now.
  write(bytes) {
    for (const byte of bytes) this.#calls.board_write(byte);
  }

  // Runs for some whole milliseconds; returns the bytes sent to the host, and when each arrives.
  run(ms) {
    this.ms += ms;
    const count = this.#calls.board_run(this.ms);
    const bytes = this.#memory(this.#calls.board_sent(), count).slice();
    const at = new DataView(this.#calls.memory.buffer, this.#calls.board_sent_ms(), 8 * count);
    return [...bytes].map((byte, n) => ({ byte, ms: at.getFloat64(8 * n, true) }));
  }

  #memory(address, count) {
    return new Uint8Array(this.#calls.memory.buffer, address, count);
  }
}
