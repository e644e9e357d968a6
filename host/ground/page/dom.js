// Elements from data. Text is set as text: what a device says is never markup.

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

// `draw` with the next frame that the browser shows, once however often it is asked for by then.
export function atNextFrame(draw) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  };
}

// A file for the user, as if it were downloaded.
export function save(blob, name) {
  const address = URL.createObjectURL(blob);
  make("a", { href: address, download: name }).click();
  URL.revokeObjectURL(address);
}
