// Settings beside their defaults, and registers by name: read when it is asked for, as reading takes
// time on the wire.

import { make } from "./dom.js";
import { ask } from "./server.js";

const DIGITS = 6; // in which a setting of 32 bits is compared

export class Settings {
  // `path` leads to the target, `tell(text, kind)` tells what went wrong.
  constructor(place, about, path, tell) {
    this.path = path;
    this.tell = tell;
    const none = about.settings.length ? null : `${about.device} shows no setting in telemetry`;
    this.settings = this.table(place, "settings", "setting", none, about.settings, {
      name: (one) => `${one.telecommand}.${one.parameter}`,
      shown: (one) => `${one.frame}.${one.field}`,
      read: (rows) => this.readSettings(rows),
    });
    const { registers, sensor_registers } = about.missing;
    this.table(place, "registers", "register", registers, about.registers, {
      name: (one) => one.name,
      shown: (one) => `${address(one)}, ${one.access}`,
      read: (rows) => this.readRegisters(rows),
    });
    this.table(place, "sensor", "image sensor register", sensor_registers, about.sensor_registers, {
      name: (one) => one.name,
      shown: (one) => `${address(one)}, ${one.access}`,
      read: (rows) => this.readSensor(rows),
    });
  }

  table(place, id, what, missing, list, { name, shown, read }) {
    const told = make("span", { id: `${id}-told`, className: "quiet" });
    const rows = list.map((one) => {
      const value = make("td", { className: "value", textContent: "–" });
      const row = make(
        "tr",
        { title: `${shown(one)}: ${one.details ?? one.meaning}` },
        make("th", { scope: "row", textContent: name(one) }),
        value,
        make("td", { className: "value quiet", textContent: text(one.default) }),
        make("td", { className: "quiet", textContent: one.unit ?? "" }),
      );
      return { one, row, value };
    });
    const act = make("button", {
      textContent: `Read ${what}s`,
      id: `read-${id}`,
      type: "button",
      disabled: Boolean(missing),
      title: missing ?? "",
      onclick: async () => {
        act.disabled = true;
        told.textContent = "being read";
        try {
          await read(rows);
          const differing = rows.filter(({ row }) => row.classList.contains("differs")).length;
          told.textContent = `${differing} of ${rows.length} differ from their default`;
        } catch (error) {
          told.textContent = "not read to the end";
          this.tell(`${what}s\n  ${error.message}`, "bad");
        }
        act.disabled = false;
      },
    });
    if (missing) told.textContent = missing;
    place.append(make("div", { className: "row" }, act, told));
    if (!list.length) return;
    const titles = [what, "value", "default", ""];
    const head = titles.map((title) => make("th", { textContent: title, scope: "col" }));
    const body = make("tbody", { id: `${id}-rows` }, ...rows.map(({ row }) => row));
    const summary = make("summary", { textContent: `${list.length} ${what}s` });
    const table = make("table", {}, make("thead", {}, make("tr", {}, ...head)), body);
    place.append(
      make("details", { open: id === "settings" }, summary, make("div", { className: "frame" }, table)),
    );
  }

  async readSettings(rows) {
    const frames = [...new Set(rows.map(({ one }) => one.frame))];
    for (const frame of frames) {
      const { data } = await ask(`${this.path}/do`, { line: `read ${frame}` });
      for (const each of rows.filter(({ one }) => one.frame === frame))
        mark(each, data.values[each.one.field]);
    }
  }

  async readRegisters(rows) {
    for (const each of rows.filter(({ one }) => one.reads)) {
      const { data } = await ask(`${this.path}/do`, { line: `read ${each.one.name}` });
      mark(each, data.values[each.one.name]);
    }
  }

  async readSensor(rows) {
    for (const each of rows) {
      if (each.one.access === "wo") continue;
      const name = encodeURIComponent(each.one.name);
      const { value, bits } = await ask(`${this.path}/sensor-registers/${name}`);
      mark(each, value);
      const named = Object.entries(bits).map(([bit, held]) => `${bit} ${held}`);
      if (named.length) each.row.title = `${address(each.one)}: ${named.join(", ")}`;
    }
  }
}

function mark({ one, row, value }, found) {
  value.textContent = text(found);
  const differs = !same(one, found);
  row.classList.toggle("differs", differs);
  value.setAttribute("aria-label", `${text(found)}${differs ? ", differs from its default" : ""}`);
}

function same({ type, default: reset }, found) {
  if (found === null) return false;
  if (type === "f32") return found.toPrecision(DIGITS) === reset.toPrecision(DIGITS);
  return typeof found === "string" ? found === reset : Number(found) === Number(reset);
}

function address(one) {
  return `0x${one.address.toString(16).padStart(2, "0")}`;
}

function text(value) {
  if (value === null || value === undefined) return "";
  return typeof value !== "number" || Number.isInteger(value) ? String(value) : String(+value.toPrecision(DIGITS));
}
