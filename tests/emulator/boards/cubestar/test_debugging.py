"""GDB itself as the client of a board with own firmware, and a client that speaks by hand."""

import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from io import StringIO
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.boards.debugging import open_debugger
from cubestack.emulator.iss.gdb.packets import framed
from cubestack.emulator.iss.gdb.session import Session
from cubestack.emulator.iss.image import Image, load_image
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S
from tests.emulator.boards.cubestar.builds import build, needs_both_compilers

pytestmark = needs_both_compilers

GDB = shutil.which("gdb-multiarch")
needs_gdb = pytest.mark.skipif(GDB is None, reason="needs gdb-multiarch")

SKY = SkyScene(np.array([0.0, 0.0, 0.0, 1.0]), mag_limit=3.0)
LIMIT_S = 60  #: Wall time of a session with GDB


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Image:
    return load_image(build("debugged", tmp_path_factory.mktemp("debugged")))


@pytest.fixture
def board(image: Image) -> Iterator[CubeStarFirmwareBoard]:
    board = CubeStarFirmwareBoard(SKY, image, seed=3)
    yield board
    board.close()


@pytest.fixture
def endpoint(board: CubeStarFirmwareBoard) -> GdbEndpoint:
    endpoint = open_debugger(board, 0)
    board.on_close.append(endpoint.close)
    return endpoint


def send_bytes(board: CubeStarFirmwareBoard, data: bytes, period_ms: int = 5) -> None:
    def write() -> Any:
        for byte in data:
            yield board.kernel.timeout(period_ms * PS_PER_MS)
            board.uart.host_writes(bytes([byte]))

    board.kernel.process(write())


def variable(board: CubeStarFirmwareBoard, name: str) -> int:
    address = board.insight.symbols.variables[name].address
    return int.from_bytes(board.machine.peek(address, 4), "little")


def session(board: CubeStarFirmwareBoard, endpoint: GdbEndpoint, script: str) -> str:
    """GDB's output for the commands in ``script``; virtual time runs while GDB lets it."""
    first = f"set confirm off; set pagination off; target remote {endpoint.name}"
    commands = f"{first}; {script}".split("; ")
    words = [word for command in commands for word in ("-ex", command)]
    program = subprocess.Popen(
        [GDB, "-nx", "-batch", str(board.image.path), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said: list[str] = []
    reader = threading.Thread(target=lambda: said.append(program.communicate(timeout=LIMIT_S)[0]))
    reader.start()
    while reader.is_alive():
        if board.kernel.paused or not endpoint.connected:
            endpoint.serve(0.02)
        else:
            board.kernel.step()
    assert said, "gdb did not end"
    return said[0]


@needs_gdb
def test_gdb_session_loads_breaks_watches_and_injects_faults(
    board: CubeStarFirmwareBoard, endpoint: GdbEndpoint
) -> None:
    send_bytes(board, b"abc")
    said = session(
        board,
        endpoint,
        "load; compare-sections .text; monitor reset halt; maintenance flush register-cache; "
        "info registers pc; break uart_handler; continue; backtrace; print received; "
        "watch received; continue; continue; print last; delete; break sleep; continue; x/i $pc; "
        "stepi; print $xpsr & 0x1ff; print ticks; monitor faults inject latch-up imager; "
        "monitor power; monitor time; x/4xb 0xC0000000; delete; detach",
    )
    for words in (
        *("Loading section .text", "matched.", "<reset_handler>"),
        *("Breakpoint 1, uart_handler () at", "#1  <signal handler called>", "#2  "),
        *("$1 = 0\n", "Old value = 0\nNew value = 1\n", "$2 = 97", "wfi"),
        *("injected: latch-up imager", "imager on 3", "0xc0000000:"),
        "[Inferior 1 (Remote target) detached]",
    ):
        assert words in said
    assert "asleep" in said or "awake" in said
    assert board.power.current_ma("imager") > 300
    ticks = variable(board, "ticks")
    board.kernel.advance_to(board.kernel.now + 20 * PS_PER_MS)
    assert variable(board, "ticks") == pytest.approx(ticks + 20, abs=1)


@needs_gdb
def test_time_advances_while_stepping_through_sleep(
    board: CubeStarFirmwareBoard, endpoint: GdbEndpoint
) -> None:
    said = session(
        board,
        endpoint,
        "break sleep; continue; continue; stepi; print $xpsr & 0x1ff; "
        "print/x $pc == (long)systick_handler; next; next",
    )
    assert "$1 = 15" in said or "$1 = 0" in said
    assert board.kernel.now > PS_PER_MS


@needs_gdb
def test_caught_fault_is_reported_to_gdb_as_a_signal(
    board: CubeStarFirmwareBoard, endpoint: GdbEndpoint
) -> None:
    send_bytes(board, b"a\0")
    script = "monitor catch on; continue; backtrace; monitor report; monitor catch off"
    said = session(board, endpoint, script)
    assert "Program received signal SIGBUS" in said
    assert "fail" in said
    assert "BusFault" in said


def traced(image: Image, debug: Any) -> tuple[str, int]:
    """The trace of a board that sends back some bytes, and the number of halts."""
    board = CubeStarFirmwareBoard(SKY, image, seed=3)
    send_bytes(board, bytes(range(1, 250)), 7)
    stream = StringIO()
    uarts = board.uarts
    history = board.insight.history
    trace = VcdTrace(stream, "star", board.kernel, uarts, board.engine, board.probes, history)
    halts = debug(board) if debug is not None else 0
    end_ps = PS_PER_S // 2
    while board.kernel.now < end_ps:
        board.kernel.step()
    trace.close()
    board.close()
    return stream.getvalue(), halts if isinstance(halts, int) else len(halts)


def test_trace_is_identical_with_and_without_gdb(image: Image) -> None:
    """Attached and running; and halted at hundreds of breakpoints and watchpoints."""
    alone, _ = traced(image, None)
    assert alone.count("\n") > 1000

    def attached(board: CubeStarFirmwareBoard) -> int:
        endpoint = open_debugger(board, 0)
        client = socket.create_connection(endpoint.address)
        endpoint.serve(0.1)
        client.sendall(framed(b"vCont;c"))
        endpoint.serve(0.1)
        assert not board.kernel.paused
        board.on_close += [endpoint.close, client.close]
        return 0

    assert traced(image, attached)[0] == alone

    def halting(board: CubeStarFirmwareBoard) -> list[int]:
        endpoint = open_debugger(board, 0)
        board.on_close.append(endpoint.close)
        debugger = board.processor.debugger
        debugger.attach()
        halts: list[int] = []
        symbols = board.insight.symbols

        def resume() -> None:
            halts.append(board.machine.now_ps)
            if len(halts) % 3:
                debugger.resume()
            else:
                debugger.step(0, 0)

        debugger.serve = resume
        for name in ("uart_handler", "systick_handler"):
            function = symbols.function(name)
            debugger.set_breakpoint(function.address, True)
        debugger.set_watchpoint(symbols.variables["received"].address, 4, "write", True)
        return halts

    with_halts, count = traced(image, halting)
    assert count > 500
    assert with_halts == alone


def test_gdb_waits_for_a_client(image: Image) -> None:
    board = CubeStarFirmwareBoard(SKY, image, seed=3)
    endpoint = open_debugger(board, 0, wait=True)
    board.on_close.append(endpoint.close)
    assert board.kernel.paused
    assert board.machine.instructions == 0
    board.close()


def test_second_client_is_rejected(board: CubeStarFirmwareBoard, endpoint: GdbEndpoint) -> None:
    first = socket.create_connection(endpoint.address)
    endpoint.serve(0.1)
    second = socket.create_connection(endpoint.address)
    endpoint.serve(0.1)
    assert second.recv(10) == b""
    assert board.kernel.paused
    first.close()
    endpoint.serve(0.1)
    assert not board.kernel.paused
    assert not endpoint.connected
    third = socket.create_connection(endpoint.address)
    endpoint.serve(0.1)
    third.sendall(framed(b"?"))
    endpoint.serve(0.1)
    assert third.recv(100).startswith(b"+$T02")
    for client in (second, third):
        client.close()


def test_gdb_port_listens_on_loopback_only(endpoint: GdbEndpoint) -> None:
    assert endpoint.address[0] == "127.0.0.1"


def test_unhandled_fault_is_reported_once(board: CubeStarFirmwareBoard) -> None:
    said: list[str] = []
    board.connect_console(said.append)
    send_bytes(board, b"a\0")
    board.kernel.advance_to(200 * PS_PER_MS)
    (report,) = said
    assert report.startswith("the firmware does not handle a fault\n")
    assert "BFAR 70000000" in report or "IMPRECISERR" in report
    assert "fail" in report
    assert "uart_handler" in report


MONITOR = (
    *("time", "camera", "power", "pins", "regs", "regs CMU", "regs X", "regs 0x20000000", "faults"),
    *("faults log", "faults clear", "faults inject latch-up imager", "faults inject x", "report"),
    *("faults inject uart-drop uart rate=x", "symbols main", "symbols 0x100", "symbols q", "reset"),
    *("reset halt", "catch on", "catch off", "help", "", "bogus x"),
)


def test_board_survives_any_packets(board: CubeStarFirmwareBoard, endpoint: GdbEndpoint) -> None:
    """Drawn packets at a board that runs, with clients that come and go."""
    rng = np.random.default_rng(5)
    debugger: Any = board.processor.debugger
    debugger.poll = debugger.serve = lambda: None
    places = (0, 0x100, 0x2000_0000, 0x2001_FFF0, 0x4000_C000, 0xE000_E010, 0xC000_0000, 1 << 31)
    for _ in range(8):
        client = Session(debugger)
        for _ in range(40):
            at, other = int(rng.choice(places)) + 4 * int(rng.integers(64)), int(rng.integers(5))
            packets = (
                *f"? g p{other * 9:x} m{at:x},40 c s vRun; z{other},{at:x},4".split(),
                *f"Z{other},{at:x},4 vCont;r{at:x},{at + 64:x} M{at:x},4:01020304".split(),
                *f"vFlashErase:0,100000000 X{at:x},2:ab vFlashWrite:{at:x}:abc vFlashDone".split(),
                f"qRcmd,{str(rng.choice(MONITOR)).encode().hex()}",
            )
            client.receive(framed(str(rng.choice(packets)).encode()))
            for _ in range(int(rng.integers(100))):
                if board.kernel.paused:
                    break
                board.kernel.step()
            client.look()
            if not board.kernel.paused:
                client.receive(b"\x03")
        client.close()
        assert not board.kernel.paused
        before_ps = board.kernel.now
        for _ in range(300):
            board.kernel.step()
        assert board.kernel.now > before_ps
