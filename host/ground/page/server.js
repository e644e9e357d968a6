// Requests to the server, and its live updates.

import { save } from "./dom.js";

const RECONNECT_MS = 1000;

export async function ask(path, body = null) {
  return (await fetched(path, body)).json();
}

// The raw answer, such as a file; throws the server's error.
export async function fetched(path, body = null) {
  const call = body === null ? {} : { method: "POST", body: JSON.stringify(body) };
  let answer;
  try {
    answer = await fetch(path, call);
  } catch {
    throw new Error("the server does not answer");
  }
  if (!answer.ok) throw new Error((await answer.json()).error);
  return answer;
}

// Saves the file at `path` as `name`.
export async function saveFile(path, name, report) {
  try {
    save(await (await fetched(path)).blob(), name);
  } catch (error) {
    report(`${name}\n  ${error.message}`, "bad");
  }
}

// A WebSocket that reconnects; calls `update` with each message, `lost` for each lost connection.
export function listen(path, update, lost) {
  const address = new URL(path, location.href);
  address.protocol = address.protocol.replace("http", "ws");
  let socket = null;
  let subscription = null;
  let ended = false;
  const open = () => {
    socket = new WebSocket(address);
    socket.onopen = () => subscription && socket.send(JSON.stringify(subscription));
    socket.onmessage = (event) => update(JSON.parse(event.data));
    socket.onclose = () => {
      if (ended) return;
      lost();
      setTimeout(open, RECONNECT_MS);
    };
  };
  open();
  return {
    subscribe(message) {
      subscription = message;
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(subscription));
    },
    close() {
      ended = true;
      socket.close();
    },
  };
}
