import contextlib
import io
import os
import threading

import pytest

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.ports.rfc2217 import Rfc2217Endpoint
from cubestack.emulator.ports.tcp import TcpEndpoint
from cubestack.firmware_model.formats.linux_i2c import socket_path
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.cli.main import main
from cubestack.host.emulation.emulated import open_device

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
    # pyserial's RFC 2217
    pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning"),
]

BUS = 16 + os.getpid() % 200
TIMEOUT_S = 60
COMMANDS = (
    "read 128 NodeType; write DetectionThreshold1 77; read Configuration Threshold1;"
    "write 41 Threshold=78; read Configuration;"
    "watch Configuration 2 0.01; list 41; read 250"
)
SAID = ("NodeType  4", "Threshold1  77", "Threshold2   78 DN", "DetectionThreshold2: done")
KINDS = ("pty", "tcp", "rfc2217", "i2c", "recorded", "recorded i2c")


@contextlib.contextmanager
def serving(kind, folder):
    """Serves a CubeSense on a port of ``kind``; yields the target that opens it."""
    with open_device("cubesense") as opened, contextlib.ExitStack() as stack:
        board = opened.board
        adapter = I2cAdapter(board.kernel, board.i2c_bus)
        if kind == "pty":
            port, target = PtyEndpoint(folder / "tty", board.uart), str(folder / "tty")
        elif kind == "i2c":
            port, target = I2cServer(socket_path(BUS), adapter), f"i2c:{BUS}:0x1b"
        else:
            make = TcpEndpoint if kind == "tcp" else Rfc2217Endpoint
            port = make("127.0.0.1", 0, board.uart)
            target = port.name
        stack.callback(port.close)
        scheduler = RealtimeScheduler(
            board.kernel, [port], lambda: board.busy() or adapter.busy, Pace(board.kernel, "fast")
        )
        thread = threading.Thread(target=scheduler.run)
        thread.start()
        stack.callback(thread.join, TIMEOUT_S)
        stack.callback(scheduler.stop)
        yield target


@pytest.fixture
def shell_on(tmp_path, monkeypatch, run):
    """Runs commands on a kind of target; exit status, output, errors."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def call(kind, commands, *options):
        if kind.startswith("recorded"):
            made = tmp_path / "session.rec"
            call("i2c" if "i2c" in kind else "tcp", commands, "--record", made)
            assert load_recording(made).setup.target.startswith(("i2c:", "tcp://"))
            return run("shell", f"recorded:{made}", "-c", commands)
        with serving(kind, tmp_path) as target:
            return run("shell", target, "--device", "cubesense", "-c", commands, *options)

    return call


@pytest.fixture(scope="module")
def emulated():
    """Result of the commands on a device in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["shell", "emulated:cubesense", "-c", COMMANDS])
    return code, out.getvalue(), err.getvalue()


def test_emulated_device_runs_the_commands(emulated):
    code, out, err = emulated
    assert code == 2
    for text in SAID:
        assert text in out
    assert "near: " in err


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_target_gives_the_same_output(shell_on, emulated, kind):
    assert shell_on(kind, COMMANDS) == emulated
