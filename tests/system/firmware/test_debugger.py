import io
import json
import re
import socket
import time
from pathlib import Path
from typing import Any

import pytest

import cubestack
from cubestack.emulator.boards.debugging import open_debugger
from cubestack.emulator.iss.gdb.packets import framed
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.host.emulation.records import start_trace
from tests.conftest import Run
from tests.emulator.boards.cubestar.builds import build, needs_toolchain
from tests.system.conftest import Emulate

pytestmark = needs_toolchain


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sleeps between ticks of 1 ms and echoes each byte."""
    return build("debugged", tmp_path_factory.mktemp("debugged"))


class Client:
    def __init__(self, address: str) -> None:
        host, port = address.rsplit(":", 1)
        self._socket = socket.create_connection((host, int(port)), timeout=20)

    def ask(self, text: str) -> str:
        self.send(text)
        return self.answer()

    def send(self, text: str) -> None:
        self._socket.sendall(framed(text.encode()))

    def answer(self) -> str:
        data = b""
        while b"#" not in data[:-2]:
            part = self._socket.recv(4096)
            if not part:
                break
            data += part
        self._socket.sendall(b"+")
        return data.lstrip(b"+").removeprefix(b"$").partition(b"#")[0].decode()

    def monitor(self, command: str) -> str:
        return bytes.fromhex(self.ask("qRcmd," + command.encode().hex())).decode()

    def time_s(self) -> float:
        return float(self.monitor("time").split()[0])

    def close(self) -> None:
        self._socket.close()


def test_virtual_time_stops_while_gdb_halts_and_ports_stay_open(
    emulate: Emulate, program: Path, tmp_path: Path
) -> None:
    arguments = ("--firmware", program, "--tcp", 0, "--gdb", 0, "--gdb-wait")
    files = ("--profile-out", tmp_path / "profile", "--coverage-out", tmp_path / "coverage")
    with emulate(*arguments, *files) as served:
        address = re.search(r"target remote (\S+)", served.said)
        assert address is not None
        debugger = Client(address[1])
        assert debugger.ask("?").startswith("T02")
        assert debugger.time_s() < 1e-6  # the fetch of the reset vector
        host, port = served.port.removeprefix("tcp://").rsplit(":", 1)
        line = socket.create_connection((host, int(port)), timeout=20)
        sleep = Symbols(program.read_bytes()).function("sleep")
        assert sleep is not None
        assert debugger.ask(f"Z1,{sleep.address:x},2") == "OK"
        began = time.monotonic()
        assert "hwbreak" in debugger.ask("vCont;c")  # all is set up
        assert debugger.ask(f"z1,{sleep.address:x},2") == "OK"
        debugger.send("vCont;c")
        line.sendall(b"A")
        assert line.recv(1) == b"A"
        debugger._socket.sendall(b"\x03")
        assert debugger.answer().startswith("T02")
        halted_s = debugger.time_s()
        assert 0 < halted_s < time.monotonic() - began + 0.1
        line.sendall(b"B")
        time.sleep(0.4)  # wall time that must not count
        assert debugger.time_s() == halted_s
        debugger.send("c")
        began = time.monotonic()
        assert line.recv(1) == b"B"
        debugger._socket.sendall(b"\x03")
        debugger.answer()
        went_on_s = debugger.time_s() - halted_s
        assert went_on_s < time.monotonic() - began + 0.1  # no catching up
        assert debugger.ask("D") == "OK"
        debugger.close()
        line.sendall(b"C")
        assert line.recv(1) == b"C"
        again = Client(address[1])
        assert again.ask("?").startswith("T02")
        again.close()
        line.sendall(b"D")
        assert line.recv(1) == b"D"
        line.close()
    assert served.process.returncode == 0
    assert "uart_handler" in (tmp_path / "profile").read_text()
    coverage = (tmp_path / "coverage").read_text()
    assert "FNDA:4,uart_handler" in coverage
    assert "FNDA:0,fail" in coverage


def test_memory_prints_used_bytes(run: Run, program: Path) -> None:
    told = json.loads(run("memory", "cubestar", "--firmware", program, "--json").out)
    assert told["static"] == 12
    assert 32 <= told["stack"] < 256
    assert told["heap"] == 0
    assert told["flash"] == pytest.approx(750, abs=150)


def test_shell_peeks_at_registers_and_variables(run: Run, program: Path) -> None:
    commands = "time 0.0105; peek ticks; peek cmu.hfperclken0"
    shell = ("shell", "emulated:cubestar", "--firmware", program, "--json", "-c", commands)
    _, ticks, clocks = map(json.loads, run(*shell).out.splitlines())
    assert [*ticks["values"].values()] == [pytest.approx(9, abs=1)]
    assert clocks["values"]["CMU.HFPERCLKEN0"]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("memory", "cubestar"), "cubestar runs no own firmware; add --firmware"),
        (("shell", "emulated:cubestar", "-c", "peek CMU"), "start it with --firmware"),
        (("emulate", "cubestar", "--tcp", 0, "--gdb", 0), "--gdb: cubestar runs no own firmware"),
    ],
)
def test_debug_options_need_firmware(run: Run, arguments: tuple[object, ...], error: str) -> None:
    outcome = run(*arguments)
    assert outcome.code
    assert error in outcome.line


def processed(halting: bool) -> tuple[str, object, int]:
    """Trace of a boot and a picture with the reference firmware, memory, number of halts."""
    with cubestack.open_device("cubestar", firmware="reference", seed=2) as device:
        board: Any = device.board
        stream, halts = io.StringIO(), list[int]()
        trace = start_trace(device, stream)
        if halting:
            endpoint = open_debugger(board, 0)
            board.on_close.append(endpoint.close)
            debugger: Any = board.processor.debugger
            debugger.attach()

            def resume() -> None:
                halts.append(board.machine.now_ps)
                if len(halts) % 3:
                    debugger.resume()
                else:
                    debugger.step(0, 0)

            debugger.poll, debugger.serve = lambda: None, resume
            for name in ("uart_receive_handler", "time_us", "fpga_acknowledges"):
                debugger.set_breakpoint(board.insight.symbols.function(name).address, True)
        device.wait(0.3)
        device.client.capture_and_process()
        trace.close()
        state = board.machine.cycles, board.machine.registers(), board.machine.ram.tobytes()
        return stream.getvalue(), state, len(halts)


@pytest.mark.slow
def test_breakpoints_do_not_change_the_run() -> None:
    alone, halting = processed(False), processed(True)
    assert halting[2] > 1000
    assert alone[:2] == halting[:2]
