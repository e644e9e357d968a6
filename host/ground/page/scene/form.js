// A form for the table of a scene file, generated from the declaration of its keys. An empty field is
// not in the table; it shows the default.

import { button, choose, labelled, make, note, row } from "../dom.js";

// A field for each of `keys`; calls `changed` after each change.
export class SceneForm {
  constructor(keys, changed) {
    this.keys = keys;
    this.changed = changed;
    this.fields = new Map(Object.entries(keys).map(([name, key]) => [name, field(name, key, changed)]));
    const own = [...this.fields.values()];
    const plain = own.filter((one) => !one.apart).map((one) => one.element);
    const apart = own.filter((one) => one.apart).map((one) => one.element);
    this.element = make("div", { className: "scene-form" }, row(...plain), ...apart);
    this.element.addEventListener("input", changed);
  }

  // The table; throws an Error that names an invalid field.
  get table() {
    const values = [...this.fields].map(([name, one]) => [name, one.value]);
    return Object.fromEntries(values.filter(([, value]) => value !== undefined));
  }

  set table(table) {
    for (const [name, one] of this.fields) one.value = table[name];
  }

  set(name, value) {
    const one = this.fields.get(name);
    if (one) one.value = value;
  }

  // Every present key with this role: its path, and functions that get and set its value.
  keysWith(role, path = "") {
    const own = Object.entries(this.keys)
      .filter(([, key]) => key.role === role)
      .map(([name, key]) => ({
        name: path + name,
        key,
        get: () => this.fields.get(name).value ?? key.default,
        set: (value) => {
          this.set(name, value);
          this.clearAlternatives(name);
        },
      }));
    const groups = [...this.fields].flatMap(([name, one]) => one.groups?.(`${path}${name}.`) ?? []);
    return [...own, ...groups.flatMap(([form, where]) => form.keysWith(role, where))];
  }

  // Empties the keys that exclude this one.
  clearAlternatives(name) {
    for (const [other, key] of Object.entries(this.keys))
      if (key.instead?.includes(name) || this.keys[name].instead?.includes(other)) this.set(other, undefined);
  }

  // Marks the fields that an error names.
  mark(error) {
    for (const [name, one] of this.fields) one.mark(new RegExp(`\\b${name}\\b`).test(error ?? ""));
  }
}

function field(name, key, changed) {
  if (key.type === "table") return group(name, key, changed);
  if (key.type === "tables") return several(name, { [name]: key }, changed, (rows) => rows[name]);
  if (key.type === "kinds") return several(name, key.kinds, changed);
  const one = key.type === "list" && key.count ? numbers(name, key) : single(name, key);
  return { ...one, get value() { return one.get(); }, set value(value) { one.set(value); } };
}

function about(name, key) {
  const limits = [key.low ?? key.of?.low, key.high ?? key.of?.high];
  const [low, high] = limits.map((limit) => (limit === undefined ? "" : String(limit)));
  const span = low && high ? `; ${low} to ${high}` : low ? `; ${low} or more` : "";
  const usual = key.default === null ? "" : `; default ${shown(key.default)}`;
  return `${name}: ${key.meaning}${span}${key.unit && ` ${key.unit}`}${usual}`;
}

function shown(value) {
  return Array.isArray(value) ? value.map(shown).join(", ") : String(value ?? "");
}

function caption(name, key) {
  return key.unit ? `${name} [${key.unit}]` : name;
}

function single(name, key) {
  const common = { title: about(name, key), className: "scene-value" };
  common.ariaLabel = caption(name, key);
  const isNumber = key.type === "number" || key.type === "whole";
  const choices = key.type === "flag" ? ["true", "false"] : key.choices;
  const usual = key.default === null ? "–" : shown(key.default);
  const input = choices
    ? choose([{ value: "", textContent: `(${usual})` }, ...choices], common)
    : make("input", { ...common, placeholder: usual, autocomplete: "off", spellcheck: false });
  if (isNumber) Object.assign(input, limited(key));
  const get = () => {
    if (input.validity.badInput) throw new Error(`${name} must be a number`);
    const text = input.value.trim();
    if (!text) return undefined;
    if (isNumber) return Number(text);
    if (key.type === "flag") return text === "true";
    return key.type === "list" ? parseList(text) : text;
  };
  const set = (value) => {
    input.value = value === undefined ? "" : Array.isArray(value) ? listText(value) : String(value);
  };
  return { element: labelled(caption(name, key), input), get, set, mark: (bad) => markInvalid(input, bad) };
}

function limited({ low, high, type }) {
  const step = type === "whole" ? 1 : "any";
  return { type: "number", step, ...(low !== undefined && { min: low }), ...(high !== undefined && { max: high }) };
}

// Parses a list with commas, in which lists have brackets.
function parseList(text) {
  try {
    return JSON.parse(`[${text}]`);
  } catch {
    return text; // the server rejects it and names the key
  }
}

function listText(list) {
  return list.map((one) => JSON.stringify(one)).join(", ");
}

function numbers(name, key) {
  const usual = Array.isArray(key.default) ? key.default : [];
  const inputs = Array.from({ length: key.count }, (_, at) =>
    make("input", {
      ...limited({ ...key.of, ...key, type: key.of.type }),
      ariaLabel: `${caption(name, key)}, ${at + 1} of ${key.count}`,
      title: about(name, key),
      placeholder: shown(usual[at] ?? "–"),
      className: "scene-value",
    }),
  );
  const get = () => {
    if (inputs.some((one) => one.validity.badInput)) throw new Error(`${name} must be numbers`);
    if (inputs.every((one) => !one.value)) return undefined;
    return inputs.map((one, at) => (one.value ? Number(one.value) : (usual[at] ?? 0)));
  };
  const set = (value) => inputs.forEach((one, at) => (one.value = value?.[at] ?? ""));
  const element = make("div", { className: "scene-list", role: "group" }, caption(name, key), make("div", {}, ...inputs));
  element.setAttribute("aria-label", name);
  return { element, get, set, mark: (bad) => inputs.forEach((one) => markInvalid(one, bad)) };
}

function markInvalid(input, bad) {
  if (bad) input.setAttribute("aria-invalid", "true");
  else input.removeAttribute("aria-invalid");
}

// A nested table; absent while all its fields are empty.
function group(name, key, changed) {
  const form = new SceneForm(key.keys, changed);
  const summary = make("summary", { textContent: name, title: key.meaning });
  const element = make("details", {}, summary, note(key.meaning), form.element);
  return {
    apart: true,
    element,
    groups: (path) => [[form, path]],
    mark: (bad) => summary.classList.toggle("bad", bad),
    get value() {
      const { table } = form;
      return Object.keys(table).length ? table : undefined;
    },
    set value(table) {
      form.table = table ?? {};
      element.open = Boolean(table);
    },
  };
}

// Tables that the user adds and removes: of several named kinds, or with `only` of one.
function several(name, kinds, changed, only = null) {
  let rows = []; // kind, form, element
  const list = make("div");
  const kind = choose(Object.keys(kinds), { ariaLabel: `kind of ${name}`, hidden: Boolean(only) });
  const add = (which, table = {}) => {
    const { keys, meaning } = kinds[which];
    const form = new SceneForm(keys, changed);
    form.table = table;
    const remove = button("Remove", "", () => {
      rows = rows.filter((one) => one !== entry);
      element.remove();
      changed();
      adds.focus();
    });
    remove.ariaLabel = `remove ${which}`;
    const head = row(make("strong", { textContent: which }), remove);
    const element = make("div", { className: "scene-row" }, head, note(meaning), form.element);
    const entry = { which, form, element };
    rows.push(entry);
    list.append(element);
  };
  const adds = button("Add", "", () => {
    add(kind.value);
    changed();
  });
  adds.ariaLabel = `add to ${name}`;
  const summary = make("summary", { textContent: name });
  const element = make("details", {}, summary, row(kind, adds), list);
  return {
    apart: true,
    element,
    groups: (path) => rows.map(({ which, form }, at) => [form, only ? `${path}${at + 1}.` : `${which}.`]),
    mark: (bad) => summary.classList.toggle("bad", bad),
    get value() {
      const tables = {};
      for (const { which, form } of rows) (tables[which] ??= []).push(form.table);
      if (!rows.length) return undefined;
      return only ? only(tables) : tables;
    },
    set value(value) {
      rows = [];
      list.replaceChildren();
      const given = only ? { [name]: value ?? [] } : (value ?? {});
      for (const [which, tables] of Object.entries(given))
        for (const table of [tables].flat()) add(which, table);
      element.open = rows.length > 0;
    },
  };
}
