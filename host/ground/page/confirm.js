// Asks before an action that interrupts or erases something.

import { make } from "./dom.js";

// Whether the user confirms the action `what`; `risk` says what it does.
export function confirmed(what, risk) {
  const title = make("h2", { id: "confirm-title", textContent: `${what}?` });
  const cancel = make("button", { value: "", textContent: "Cancel", autofocus: true });
  const accept = make("button", { value: "yes", id: "confirm", className: "risk", textContent: what });
  const form = make("form", { method: "dialog" }, accept, cancel);
  const dialog = make("dialog", {}, title, make("p", { textContent: risk }), form);
  dialog.setAttribute("aria-labelledby", title.id);
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.onclose = () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    };
  });
}
