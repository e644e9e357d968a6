// What the page asks of its server, and what that tells by itself.

const AGAIN_MS = 1000;

export async function ask(path, body = null) {
  return (await fetched(path, body)).json();
}

// The answer as it is, such as a file; throws what the server says against it.
export async function fetched(path, body = null) {
  const call = body === null ? {} : { method: "POST", body: JSON.stringify(body) };
  let answer;
  try {
    answer = await fetch(path, call);
  } catch {
    throw new Error("the program behind this page does not answer");
  }
  if (!answer.ok) throw new Error((await answer.json()).error);
  return answer;
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
