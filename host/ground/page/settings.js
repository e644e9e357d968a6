// Settings and registers beside their defaults, read on request because reading takes wire time.

import { button, make, row } from "./dom.js";
import { ask } from "./server.js";

const DIGITS = 6; // of a float32 that are compared

export class Settings {
  constructor(place, about, path, report) {
    this.path = path;
    this.report = report;
    const none = about.settings.length ? null : `${about.device} has no settings in telemetry`;
    this.settings = this.table(place, "settings", "setting", none, about.settings, {
      name: (one) => `${one.telecommand}.${one.parameter}`,
      where: (one) => `${one.frame}.${one.field}`,
      read: (rows) => this.readSettings(rows),
    });
    const { registers, sensor_registers } = about.missing;
    this.table(place, "registers", "register", registers, about.registers, {
      name: (one) => one.name,
      where: registerPlace,
      read: (rows) => this.readRegisters(rows),
    });
    this.table(place, "sensor", "image sensor register", sensor_registers, about.sensor_registers, {
      name: (one) => one.name,
      where: registerPlace,
      read: (rows) => this.readSensor(rows),
    });
  }

  table(place, id, what, missing, list, { name, where, read }) {
    const status = make("span", { id: `${id}-status`, className: "quiet", textContent: missing ?? "" });
    const rows = list.map((one) => {
      const value = make("td", { className: "value", textContent: "–" });
      const element = make(
        "tr",
        { title: `${where(one)}: ${one.details ?? one.meaning}` },
        make("th", { scope: "row", textContent: name(one) }),
        value,
        make("td", { className: "value quiet", textContent: text(one.default) }),
        make("td", { className: "quiet", textContent: one.unit ?? "" }),
      );
      return { one, element, value };
    });
    const readAll = async () => {
      act.disabled = true;
      status.textContent = "reading";
      try {
        await read(rows);
        const differing = rows.filter(({ element }) => element.classList.contains("differs")).length;
        status.textContent = `${differing} of ${rows.length} differ from their default`;
      } catch (error) {
        status.textContent = "reading failed";
        this.report(`${what}s\n  ${error.message}`, "bad");
      }
      act.disabled = false;
    };
    const act = button(`Read ${what}s`, `read-${id}`, readAll, missing);
    place.append(row(act, status));
    if (!list.length) return;
    const titles = [what, "value", "default", "unit"];
    const head = titles.map((title) => make("th", { textContent: title, scope: "col" }));
    const body = make("tbody", { id: `${id}-rows` }, ...rows.map(({ element }) => element));
    const summary = make("summary", { textContent: `${list.length} ${what}s` });
    const table = make("table", {}, make("thead", {}, make("tr", {}, ...head)), body);
    place.append(
      make("details", { open: id === "settings" }, summary, make("div", { className: "frame", tabIndex: 0, role: "group", ariaLabel: summary.textContent }, table)),
    );
  }

  async readSettings(rows) {
    const frames = [...new Set(rows.map(({ one }) => one.frame))];
    for (const frame of frames) {
      const { data } = await ask(`${this.path}/shell`, { line: `read ${frame}` });
      for (const each of rows.filter(({ one }) => one.frame === frame))
        mark(each, data.values[each.one.field]);
    }
  }

  async readRegisters(rows) {
    for (const each of rows.filter(({ one }) => one.reads)) {
      const { data } = await ask(`${this.path}/shell`, { line: `read ${each.one.name}` });
      mark(each, data.values[each.one.name]);
    }
  }

  async readSensor(rows) {
    for (const each of rows) {
      if (each.one.access === "wo") continue;
      const name = encodeURIComponent(each.one.name);
      const { value, bits } = await ask(`${this.path}/sensor-registers/${name}`);
      mark(each, value);
      const texts = Object.entries(bits).map(([bit, state]) => `${bit} ${state}`);
      if (texts.length) each.element.title = `${address(each.one)}: ${texts.join(", ")}`;
    }
  }
}

function mark({ one, element, value }, found) {
  value.textContent = text(found);
  const differs = !same(one, found);
  element.classList.toggle("differs", differs);
  value.setAttribute("aria-label", `${text(found)}${differs ? ", differs from its default" : ""}`);
}

function same({ type, default: reset }, found) {
  if (found === null) return false;
  if (type === "f32") return found.toPrecision(DIGITS) === reset.toPrecision(DIGITS);
  return typeof found === "string" ? found === reset : Number(found) === Number(reset);
}

function registerPlace(one) {
  return `${address(one)}, ${one.access}`;
}

function address(one) {
  return `0x${one.address.toString(16).padStart(2, "0")}`;
}

function text(value) {
  if (value === null || value === undefined) return "";
  return typeof value !== "number" || Number.isInteger(value) ? String(value) : String(+value.toPrecision(DIGITS));
}
