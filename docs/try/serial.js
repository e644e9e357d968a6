// The node's serial protocol: frames, and the fields of messages. messages.json has the tables.

const ESCAPE = 0x1f, START = 0x7f, END = 0xff;

export function framed(payload) {
  const doubled = payload.flatMap((byte) => (byte === ESCAPE ? [ESCAPE, ESCAPE] : [byte]));
  return [ESCAPE, START, ...doubled, ESCAPE, END];
}

// Collects bytes; returns the payload when a frame is whole, else null.
export class Deframer {
  #payload = null;
  #escaped = false;

  take(byte) {
    if (byte === ESCAPE && !this.#escaped) {
      this.#escaped = true;
      return null;
    }
    const special = this.#escaped && byte !== ESCAPE;
    this.#escaped = false;
    if (!special) {
      this.#payload?.push(byte);
      return null;
    }
    const whole = byte === END ? this.#payload : null;
    this.#payload = byte === START ? [] : null;
    return whole;
  }
}

// The values of a telemetry frame, by the names of its fields.
export function decoded(message, payload) {
  const data = new DataView(new Uint8Array(payload).buffer);
  return Object.fromEntries(message.fields.map((field) => [field.name, value(field, data)]));
}

// Kind and number of bits of a field's type, such as u16.
const typed = (field) => [/^\D+/.exec(field.type)[0], Number(/\d+$/.exec(field.type)[0])];

function value(field, data) {
  const [kind, bits] = typed(field), at = field.byte_offset;
  switch (kind) {
    case "bytes":
      return hex(new Uint8Array(data.buffer, at, bits));
    case "f":
      return data.getFloat32(at, true);
    case "bool":
      return (data.getUint8(at) >> (field.bit_offset & 7)) & 1;
    case "enum":
      return Object.entries(field.choices).find(([, n]) => n === data.getUint8(at))?.[0] ??
        data.getUint8(at);
    default:
      return data[`get${kind === "i" ? "Int" : "Uint"}${bits}`](at, true) / field.scale;
  }
}

export function hex(bytes) {
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join(" ");
}

// Parameters of a telecommand as bytes; throws for another number of them than it has.
export function encoded(message, values) {
  const { fields, length } = message;
  if (values.length !== fields.length) {
    const names = fields.map((field) => field.name).join(", ") || "none";
    throw new Error(`${message.name} has ${fields.length} parameters (${names}), not ${values.length}`);
  }
  const data = new DataView(new ArrayBuffer(length));
  fields.forEach((field, n) => {
    const [kind, bits] = typed(field);
    const number = field.choices?.[values[n]] ?? Number(values[n]);
    if (Number.isNaN(number)) throw new Error(`${field.name} is a number, not ${values[n]}`);
    if (kind === "f") data.setFloat32(field.byte_offset, number, true);
    else if (kind === "bytes") throw new Error(`${message.name} can only be sent as bytes`);
    else data[`setUint${kind === "bool" ? 8 : bits}`](field.byte_offset, Math.round(number * field.scale), true);
  });
  return [...new Uint8Array(data.buffer)];
}
