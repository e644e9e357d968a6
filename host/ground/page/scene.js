// What an emulation's cameras see: on a map of the sky, in a form of all keys, or as a whole file.

import { choose, labelled, make } from "./dom.js";
import { SceneForm } from "./sceneform.js";
import { SkyMap } from "./skymap.js";
import { ask } from "./server.js";
import { angles, vector } from "./sphere.js";

const POINTING = "pointing";

export class Scene {
  // `path` leads to the target, `act(what, asked)` does something and tells of it.
  constructor(place, about, path, act) {
    this.path = path;
    this.act = act;
    const why = about.missing.controls;
    const formless = why ?? about.missing.scene_form;
    this.map = new SkyMap((at) => this.put(at));
    this.canvas = this.map.canvas;
    this.told = make("p", { className: "quiet", id: "scene-told", role: "status" });
    this.help = make("p", { className: "quiet", id: "scene-help", textContent: formless ? "" : "here is what the key says whose field one is in" });
    const button = (text, id, onclick, reason) =>
      make("button", { textContent: text, id, type: "button", onclick, disabled: Boolean(reason), title: reason ?? "" });
    const none = { disabled: Boolean(formless), title: formless ?? "" };
    this.kind = choose([], { id: "scene-kind", onchange: () => this.choose(this.kind.value), ...none });
    this.what = choose([], { id: "scene-what", onchange: () => this.show(), ...none });
    this.place = make("div", { id: "scene-keys" });
    this.place.addEventListener("focusin", (event) => {
      if (event.target.title) this.help.textContent = event.target.title;
    });
    const apply = button("Apply", "scene-apply", () => this.apply(), formless);
    apply.className = "main";
    this.text = make("textarea", {
      rows: 7,
      id: "scene-text",
      spellcheck: false,
      disabled: Boolean(why),
      title: why ?? "",
      placeholder: 'kind = "sky"\nra_deg = 10.0\ndec_deg = -30.0\nroll_deg = 0.0',
    });
    place.append(
      make(
        "div",
        { className: "row" },
        labelled("kind of scene", this.kind),
        labelled("the map puts", this.what),
        button("Present scene", "scene-present", () => this.present(), formless),
        apply,
      ),
      this.canvas,
      this.told,
      this.help,
      this.place,
      make(
        "details",
        {},
        make("summary", { textContent: "a whole scene file" }),
        labelled("its text", this.text),
        button("Show", "show-scene", () => this.apply({ text: this.text.value }), why),
      ),
    );
    this.canvas.hidden = Boolean(formless);
    this.told.textContent = formless ?? "";
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
      await this.present();
    } catch (error) {
      this.tell(error.message);
    }
  }

  // Fills the form with what is seen now.
  async present() {
    try {
      const { table, sight, follows } = await ask(`${this.path}/scene`);
      this.follows = follows;
      this.kind.value = table.kind;
      this.choose(table.kind, table);
      this.tell("");
      this.show(sight);
    } catch (error) {
      this.tell(error.message);
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
      const done = await this.act("scene", ask(`${this.path}/scene`, body ?? { table: this.table }));
      if (done) await this.present();
    } catch (error) {
      this.tell(error.message);
    }
  }

  // The map shows what is filled in: one question at a time, and the last one always.
  async changed() {
    this.asks = true;
    if (this.asking) return;
    this.asking = true;
    while (this.asks) {
      this.asks = false;
      try {
        const { sight } = await ask(`${this.path}/scene/look`, { table: this.table });
        this.tell("");
        this.show(sight);
      } catch (error) {
        this.tell(error.message);
      }
    }
    this.asking = false;
  }

  tell(error) {
    this.error = error;
    this.form?.accuse(error);
    this.say();
  }

  // What the map puts: the camera's boresight, or any key that is a direction.
  get things() {
    const [[ra], [dec]] = ["ra", "dec"].map((role) => this.form.found(role));
    const pointing = ra && dec && {
      name: POINTING,
      get: () => this.sight?.fields[0]?.axes[2] ?? vector(ra.get() ?? 0, dec.get() ?? 0),
      put: (at) => {
        const [along, above] = angles(at);
        ra.put(rounded(along, 2));
        dec.put(rounded(above, 2));
      },
    };
    const others = this.form.found("direction").map(({ name, key, get, put }) => ({
      name,
      get: () => unit(get()),
      put: (at) => put(key.count ? at.map((part) => rounded(part, 4)) : angles(at).map((one) => rounded(one, 2))),
    }));
    return [...(pointing ? [pointing] : []), ...others];
  }

  put(at) {
    const thing = this.things.find(({ name }) => name === this.what.value);
    if (!thing) return;
    thing.put(at);
    this.map.show(this.sight, at); // the rest follows when it is known
    this.changed();
  }

  show(sight = this.sight) {
    this.sight = sight;
    const { things } = this;
    const names = things.map(({ name }) => name);
    if (names.join() !== [...this.what.options].map((one) => one.value).join()) {
      const before = this.what.value;
      this.what.replaceChildren(...choose(names).children);
      this.what.value = names.includes(before) ? before : (names[0] ?? "");
    }
    const thing = things.find(({ name }) => name === this.what.value);
    this.map.show(sight, thing?.get() ?? null);
    this.say();
  }

  say() {
    this.told.className = this.error ? "bad" : "quiet";
    const { title, fields, bodies } = this.sight ?? { fields: [], bodies: [] };
    const where = this.sight?.stars
      ? (one) => angles(one).map((deg) => `${deg.toFixed(1)}°`)
      : (one) => one.map((part) => part.toFixed(2));
    const at = (name, one) => `${name} ${where(one).join(" ")}`;
    const words = [
      ...fields.map(({ name, axes }) => at(name, axes[2])),
      ...bodies.map(({ name, direction }) => at(name, direction)),
    ];
    this.told.textContent = this.error || [title, ...words, this.follows].filter(Boolean).join("; ");
    const keys = "a click or arrow keys, with shift faster, put what is chosen above";
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
