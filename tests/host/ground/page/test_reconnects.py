import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

import pytest

from ..browser import line, shown, station


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


pytestmark = pytest.mark.xdist_group("other pages")


@pytest.fixture
def relayed() -> Iterator[tuple[Relay, str]]:
    """A relay, and the address of the page through it."""
    with station("emulated:cubesense") as address:
        parts = urlsplit(address)
        assert parts.port is not None
        relay = Relay(parts.port)
        yield relay, address.replace(f":{parts.port}", f":{relay.port}")
        relay.close()


@pytest.mark.slow
def test_page_reconnects(chromium: Any, relayed: tuple[Relay, str]) -> None:
    relay, address = relayed
    with shown(chromium, address) as page:
        page.evaluate("window.here = true")
        line(page, "write DetectionThreshold1 77")
        page.select_option("#frame", "Configuration")
        value = page.locator("#telemetry td.value").first
        value.filter(has_text="77").wait_for(state="attached")
        relay.cut()
        page.locator("#link.bad").filter(has_text="reconnecting").wait_for(state="attached")
        assert "does not answer" in line(page, "read Identification")
        relay.up = True
        page.wait_for_selector("#link:not(.bad) >> text=emulated:cubesense")
        line(page, "write DetectionThreshold1 78")
        value.filter(has_text="78").wait_for(state="attached")
        assert page.evaluate("window.here")


@pytest.mark.slow
def test_page_reports_another_program_at_its_address(
    chromium: Any, relayed: tuple[Relay, str]
) -> None:
    relay, address = relayed
    with station("emulated:cubesense") as other, shown(chromium, address) as page:
        page.wait_for_selector("#link >> text=emulated:cubesense")
        relay.cut()
        relay.to_port = urlsplit(other).port or 0
        relay.up = True
        page.locator("#link.bad").filter(has_text="open the printed address").wait_for(
            state="attached"
        )


@pytest.mark.slow
def test_two_pages_in_one_browser_are_independent(chromium: Any) -> None:
    """A browser shares its cookies between all ports of a host."""
    with (
        station("emulated:cubesense") as one,
        station("emulated:cubesense") as other,
        shown(chromium, one, alone=True) as page,
    ):
        second = page.context.new_page()
        second.goto(other)
        second.wait_for_selector("#line")
        for each in (page, second):
            assert "NodeType" in line(each, "read Identification")
