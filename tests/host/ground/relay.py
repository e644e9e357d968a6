"""A TCP relay between browser and server that can be interrupted."""

import socket
import threading
from contextlib import suppress


class Relay:
    """Forwards connections at ``port`` to another local port while it is ``up``."""

    def __init__(self, to_port: int) -> None:
        self.to_port = to_port
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self.up = True
        self._open = list[socket.socket]()
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def cut(self) -> None:
        """Closes all connections and rejects new ones."""
        self.up = False
        for one in self._open:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._server.shutdown(socket.SHUT_RDWR)
        self.cut()
        for thread in self._threads:
            thread.join()
        for one in (*self._open, self._server):
            one.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._server.accept()
                self._open.append(near)
                if not self.up:
                    near.close()
                    continue
                far = socket.create_connection(("127.0.0.1", self.to_port))
                self._open.append(far)
                for ends in ((near, far), (far, near)):
                    thread = threading.Thread(target=_pass_on, args=ends)
                    self._threads.append(thread)
                    thread.start()


def _pass_on(source: socket.socket, sink: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(1 << 16):
            sink.sendall(data)
        sink.shutdown(socket.SHUT_RDWR)
