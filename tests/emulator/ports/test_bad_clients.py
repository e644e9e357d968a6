"""Several lines of one device at once, and clients that do what they should not."""

import contextlib
import tracemalloc

from cubestack.emulator.ports.endpoint import PtyEndpoint, TcpEndpoint
from cubestack.emulator.ports.pump import Pump
from cubestack.emulator.ports.rfc2217 import Rfc2217Endpoint
from cubestack.emulator.ports.serial_port import MAX_UNREAD, MAX_UNSENT
from cubestack.emulator.uart import Uart
from cubestack.emulator.virtual_time import PS_PER_S, Kernel

NS_PER_MS = 1_000_000
SPARE_BYTES = 1_000_000


class Line:
    """A line of a device that answers every byte with ``answers`` bytes."""

    def __init__(self, kernel: Kernel, answers: int) -> None:
        self.received = bytearray()
        self.heard = 0
        self._answers = answers
        self.uart = Uart(kernel, 115_200, self._on_byte, lambda: None, silence_bytes=1000)

    def _on_byte(self, byte: int) -> None:
        self.heard += 1
        self.received = self.received[-100:] + bytes([byte])
        if self.uart.backlog < 10_000:
            self.uart.send(bytes([byte]) * self._answers)


class Wall:
    """Wall time that passes when the pump waits, as rounded by ``wait_ready``.

    Something happens in each wait.
    """

    def __init__(self) -> None:
        self.ns = 0
        self.during_wait = lambda: None

    def clock(self) -> int:
        self.ns += 1000
        return self.ns

    def wait(self, _watched, timeout_s: float) -> None:
        self.during_wait()
        self.ns += max(NS_PER_MS, int(timeout_s * 1e9))


def test_polite_client_is_served_beside_three_bad_ones(tmp_path, terminal_at, connection_to):
    """One floods, one never reads, one stops in mid-frame; the fourth exchanges a byte a wait."""
    kernel, wall = Kernel(), Wall()
    lines = [Line(kernel, answers) for answers in (1, 2000, 1, 1)]
    flooded, unread, stopped, polite = lines
    with contextlib.ExitStack() as stack:
        flood_port = Rfc2217Endpoint("127.0.0.1", 0, flooded.uart)
        unread_port = TcpEndpoint("127.0.0.1", 0, unread.uart)
        stop_port = PtyEndpoint(tmp_path / "ttySTOP", stopped.uart)
        polite_port = PtyEndpoint(tmp_path / "ttyPOLITE", polite.uart)
        ports = [flood_port, unread_port, stop_port, polite_port]
        flooder, reader = connection_to(flood_port.address), connection_to(unread_port.address)
        halting = terminal_at(tmp_path / "ttySTOP")
        good = terminal_at(tmp_path / "ttyPOLITE")
        for thing in (*ports, flooder, reader, halting, good):
            stack.callback(thing.close)
        for client in (flooder, reader):
            client.socket.setblocking(False)
        halting.write(b"\x1f\x7f\x14")
        steps, echoed = 0, 0
        pump = Pump(
            kernel,
            ports,
            lambda: any(line.uart.busy for line in lines),
            pace="real",
            clock_ns=wall.clock,
            wait=wall.wait,
        )

        def step() -> None:
            nonlocal steps, echoed
            steps += 1
            for client, data in ((flooder, bytes(100_000)), (reader, b"?" * 100)):
                with contextlib.suppress(BlockingIOError):
                    client.socket.send(data)
            with contextlib.suppress(BlockingIOError):
                echoed += len(good.read_now())
            good.write(b"x")
            if steps == 200:
                tracemalloc.start()
            if steps == 600:
                pump.stop()

        wall.during_wait = step
        pump.run()
        grown, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert kernel.now > PS_PER_S // 2
        assert polite.heard >= 590
        assert echoed >= 580
        assert flooded.heard > 0.8 * kernel.now / PS_PER_S * 11_520 > 1000  # its wire is full
        assert flooded.uart.host_backlog <= MAX_UNSENT
        assert bytes(stopped.received) == b"\x1f\x7f\x14"
        assert len(unread_port._unread) <= MAX_UNREAD
        assert (grown, peak) < (SPARE_BYTES, SPARE_BYTES)


def test_two_lines_of_a_device_at_once(tmp_path, terminal_at):
    """As a CubeSense has them, with rates of their own."""
    kernel, wall = Kernel(), Wall()
    node, bench = Line(kernel, 1), Line(kernel, 3)
    with contextlib.ExitStack() as stack:
        ports = [
            PtyEndpoint(tmp_path / name, line.uart)
            for name, line in (("tty", node), ("tty.bench", bench))
        ]
        clients = [terminal_at(tmp_path / name) for name in ("tty", "tty.bench")]
        for thing in (*ports, *clients):
            stack.callback(thing.close)
        pump = Pump(
            kernel,
            ports,
            lambda: node.uart.busy or bench.uart.busy,
            pace="real",
            clock_ns=wall.clock,
            wait=wall.wait,
        )
        waits = 0

        def step() -> None:
            nonlocal waits
            waits += 1
            if waits == 2:
                clients[0].write(b"abc")
                clients[1].write(b"q")
            if waits == 20:
                pump.stop()

        wall.during_wait = step
        pump.run()
        assert (clients[0].read(3), clients[1].read(3)) == (b"abc", b"qqq")
