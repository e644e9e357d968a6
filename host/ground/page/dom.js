// Builds elements from data. Text from a device is set as text, never as markup.

export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== "list") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

export function choose(options, attributes = {}) {
  const made = options.map((option) =>
    make("option", typeof option === "string" ? { value: option, textContent: option } : option),
  );
  return make("select", attributes, ...made);
}

export function labelled(text, control, attributes = {}) {
  return make("label", attributes, text, control);
}

// A control after its label's text, on the same line.
export function beside(text, control) {
  return labelled(text, control, { className: "beside" });
}

export function row(...children) {
  return make("div", { className: "row" }, ...children);
}

export function note(textContent, attributes = {}) {
  return make("p", { className: "quiet", textContent: textContent ?? "", ...attributes });
}

// Attributes that disable a control and show the reason `why`, if there is one.
export function disabledIf(why) {
  return { disabled: Boolean(why), title: why ?? "" };
}

export function button(textContent, id, onclick, why = null) {
  return make("button", { textContent, ...(id && { id }), type: "button", onclick, ...disabledIf(why) });
}

// Disables all controls in an element, with the reason.
export function disable(place, why) {
  for (const one of place.querySelectorAll("button, input, select, textarea")) {
    one.disabled = true;
    one.title = why;
  }
}

// Calls `draw` once in the browser's next frame, however often it is requested before.
export function atNextFrame(draw) {
  let requested = false;
  return () => {
    if (requested) return;
    requested = true;
    requestAnimationFrame(() => {
      requested = false;
      draw();
    });
  };
}

export function save(blob, name) {
  const address = URL.createObjectURL(blob);
  make("a", { href: address, download: name }).click();
  URL.revokeObjectURL(address);
}

export async function base64(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}
