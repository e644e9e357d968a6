// The scene of an emulation: on a map of the sky, in a form with all keys, or as the text of a file.

import { button, choose, disabledIf, labelled, make, note, row } from "../dom.js";
import { SceneForm } from "./form.js";
import { SkyMap } from "./skymap.js";
import { ask } from "../server.js";
import { angles, vector } from "../sphere.js";

const POINTING = "pointing";

export class Scene {
  // `reported(what, request)` reports the answer to a request.
  constructor(place, about, path, reported) {
    this.path = path;
    this.reported = reported;
    const why = about.missing.controls;
    const formless = why ?? about.missing.scene_form;
    this.map = new SkyMap((at) => this.move(at));
    this.canvas = this.map.canvas;
    this.status = note(formless, { id: "scene-status", role: "status" });
    this.help = note(formless ? "" : "Select a field to see its description.", { id: "scene-help" });
    const none = disabledIf(formless);
    this.kind = choose([], { id: "scene-kind", onchange: () => this.choose(this.kind.value), ...none });
    this.what = choose([], { id: "scene-what", onchange: () => this.show(), ...none });
    this.place = make("div", { id: "scene-keys", tabIndex: 0, role: "group", ariaLabel: "keys of the scene" });
    this.place.addEventListener("focusin", (event) => {
      if (event.target.title) this.help.textContent = event.target.title;
    });
    const apply = button("Apply", "scene-apply", () => this.apply(), formless);
    apply.className = "main";
    this.text = make("textarea", {
      rows: 7,
      id: "scene-text",
      spellcheck: false,
      ...disabledIf(why),
      placeholder: 'kind = "sky"\nra_deg = 10.0\ndec_deg = -30.0\nroll_deg = 0.0',
    });
    place.append(
      row(
        labelled("kind of scene", this.kind),
        labelled("map moves", this.what),
        button("Load current scene", "scene-load", () => this.load(), formless),
        apply,
      ),
      this.canvas,
      this.status,
      this.help,
      this.place,
      make(
        "details",
        {},
        make("summary", { textContent: "scene file" }),
        labelled("text", this.text),
        button("Apply file", "apply-file", () => this.apply({ text: this.text.value }), why),
      ),
    );
    this.canvas.hidden = Boolean(formless);
    if (!formless) this.start();
  }

  async start() {
    try {
      const [{ kinds }, { stars }] = await Promise.all(
        ["scene/keys", "stars"].map((what) => ask(`${this.path}/${what}`)),
      );
      this.kinds = kinds;
      this.map.stars = stars.map((star) => ({ ...star, at: vector(star.ra_deg, star.dec_deg) }));
      this.kind.replaceChildren(...choose(Object.keys(kinds)).children);
      await this.load();
    } catch (error) {
      this.setError(error.message);
    }
  }

  // Fills the form with the current scene.
  async load() {
    try {
      const { table, sight, follows } = await ask(`${this.path}/scene`);
      this.follows = follows;
      this.kind.value = table.kind;
      this.choose(table.kind, table);
      this.setError("");
      this.show(sight);
    } catch (error) {
      this.setError(error.message);
    }
  }

  choose(kind, table = null) {
    this.form = new SceneForm(this.kinds[kind], () => this.changed());
    this.form.table = table ?? {};
    this.place.replaceChildren(this.form.element);
    if (!table) this.changed();
  }

  get table() {
    return { kind: this.kind.value, ...this.form.table };
  }

  async apply(body = null) {
    try {
      const done = await this.reported("scene", ask(`${this.path}/scene`, body ?? { table: this.table }));
      if (done) await this.load();
    } catch (error) {
      this.setError(error.message);
    }
  }

  // Shows the form's scene on the map: one request at a time, and always the last one.
  async changed() {
    this.outdated = true;
    if (this.requesting) return;
    this.requesting = true;
    while (this.outdated) {
      this.outdated = false;
      try {
        const { sight } = await ask(`${this.path}/scene/look`, { table: this.table });
        this.setError("");
        this.show(sight);
      } catch (error) {
        this.setError(error.message);
      }
    }
    this.requesting = false;
  }

  setError(error) {
    this.error = error;
    this.form?.mark(error);
    this.showStatus();
  }

  // Objects that the map can move: the camera's boresight, and every key that is a direction.
  get movable() {
    const [[ra], [dec]] = ["ra", "dec"].map((role) => this.form.keysWith(role));
    const pointing = ra && dec && {
      name: POINTING,
      get: () => this.sight?.fields[0]?.axes[2] ?? vector(ra.get() ?? 0, dec.get() ?? 0),
      set: (at) => {
        const [along, above] = angles(at);
        ra.set(rounded(along, 2));
        dec.set(rounded(above, 2));
      },
    };
    const others = this.form.keysWith("direction").map(({ name, key, get, set }) => ({
      name,
      get: () => unit(get()),
      set: (at) => set(key.count ? at.map((part) => rounded(part, 4)) : angles(at).map((one) => rounded(one, 2))),
    }));
    return [...(pointing ? [pointing] : []), ...others];
  }

  move(at) {
    const object = this.movable.find(({ name }) => name === this.what.value);
    if (!object) return;
    object.set(at);
    this.map.show(this.sight, at); // before the server answers
    this.changed();
  }

  show(sight = this.sight) {
    this.sight = sight;
    const { movable } = this;
    const names = movable.map(({ name }) => name);
    if (names.join() !== [...this.what.options].map((one) => one.value).join()) {
      const before = this.what.value;
      this.what.replaceChildren(...choose(names).children);
      this.what.value = names.includes(before) ? before : (names[0] ?? "");
    }
    const object = movable.find(({ name }) => name === this.what.value);
    this.map.show(sight, object?.get() ?? null);
    this.showStatus();
  }

  showStatus() {
    this.status.className = this.error ? "bad" : "quiet";
    const { title, fields, bodies } = this.sight ?? { fields: [], bodies: [] };
    const where = this.sight?.stars
      ? (one) => angles(one).map((deg) => `${deg.toFixed(1)}°`)
      : (one) => one.map((part) => part.toFixed(2));
    const at = (name, one) => `${name} ${where(one).join(" ")}`;
    const words = [
      ...fields.map(({ name, axes }) => at(name, axes[2])),
      ...bodies.map(({ name, direction }) => at(name, direction)),
    ];
    this.status.textContent = this.error || [title, ...words, this.follows].filter(Boolean).join("; ");
    const keys = "click, or use arrow keys (faster with shift), to move the selected object";
    this.canvas.setAttribute("aria-label", `map of the sky: ${words.join("; ")}; ${keys}`);
  }
}

function unit(at) {
  if (!Array.isArray(at)) return null;
  if (at.length === 2) return vector(...at);
  const size = Math.hypot(...at);
  return size > 0 ? at.map((part) => part / size) : null;
}

function rounded(value, digits) {
  return Number(value.toFixed(digits));
}
