// What the page asks of its server, and what that tells by itself.

const AGAIN_MS = 1000;

export async function ask(path, body = null) {
  const call = body === null ? {} : { method: "POST", body: JSON.stringify(body) };
  let answer;
  try {
    answer = await fetch(path, call);
  } catch {
    throw new Error("the program behind this page does not answer");
  }
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error);
  return told;
}

// A WebSocket that comes back; `hear` gets each message, `gone` is told of a lost one.
export function listen(path, hear, gone) {
  const address = new URL(path, location.href);
  address.protocol = address.protocol.replace("http", "ws");
  let socket = null;
  let wanted = null;
  let ended = false;
  const open = () => {
    socket = new WebSocket(address);
    socket.onopen = () => wanted && socket.send(JSON.stringify(wanted));
    socket.onmessage = (event) => hear(JSON.parse(event.data));
    socket.onclose = () => {
      if (ended) return;
      gone();
      setTimeout(open, AGAIN_MS);
    };
  };
  open();
  return {
    want(message) {
      wanted = message;
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(wanted));
    },
    close() {
      ended = true;
      socket.close();
    },
  };
}
