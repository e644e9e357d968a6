"""`cubestack emulate` beside clients that flood, never read, or are stopped in mid-frame, at once.

On each transport, in wall time: CUBESTACK_BAD_CLIENTS_S=60 lets them do it for as long, which also
runs the transports that the short test leaves out; -s shows what was measured.
"""

import os
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from cubestack.firmware_model.formats.i2c_socket import (
    Call,
    pack_hello,
    pack_rdwr,
    packet,
    request,
    socket_path,
)
from cubestack.firmware_model.formats.linux_i2c import RdwrMessage
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device_names
from cubestack.host.transport.smbus import CubeSMBus
from cubestack.host.transport.streams import open_transport
from tests.system.conftest import Served

LONG = "CUBESTACK_BAD_CLIENTS_S" in os.environ
LENGTH_S = float(os.environ.get("CUBESTACK_BAD_CLIENTS_S", "0.9"))
BUS = 16 + os.getpid() % 200
BAD_CLIENT = (sys.executable, "-I", "-S", str(Path(__file__).with_name("bad_client.py")))
SLOWEST_ANSWER_S = 5.0  # on a machine with work of its own
GROWTH_BYTES = 4 << 20

IDENTIFY = encode_frame(b"\x80")
RDWR = request(0, Call.RDWR, pack_rdwr([RdwrMessage(CUBESENSE.i2c_address, 1, 8)]))
READ_BUS = packet(request(0, Call.HELLO, pack_hello())) + packet(RDWR)


def memory_bytes(process: subprocess.Popen[str]) -> int:
    pages = Path(f"/proc/{process.pid}/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's RFC 2217
@pytest.mark.parametrize("transport", ["tcp", "pty", "rfc2217"])
def test_other_clients_are_served_and_memory_stays_constant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, transport: str
) -> None:
    if transport != "tcp" and not LONG:
        pytest.skip("the long run only")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    options = [f"--{transport}", "./tty" if transport == "pty" else "0"]
    with ExitStack() as stack:
        arguments = [*device_names(), "--i2c", str(BUS), *options]
        emulator = stack.enter_context(Served(arguments, tmp_path, last="--bus"))
        words = emulator.said.split()
        ports = [words[i - 1] for i, word in enumerate(words) if word == "at"]
        cubestar, node, bench, aramis = (
            str(tmp_path / port) if transport == "pty" else port for port in ports
        )
        bus = str(socket_path(BUS))
        for role, port, question in (
            ("flood", cubestar, IDENTIFY),
            ("unread", bench, b"s"),
            ("stopped", aramis, IDENTIFY),
            *((role, bus, READ_BUS) for role in ("flood", "unread", "stopped")),
        ):
            arguments = [*BAD_CLIENT, role, port.replace("rfc2217", "tcp"), question.hex()]
            bad = subprocess.Popen(arguments)
            stack.callback(bad.wait)
            stack.callback(bad.kill)
        line = stack.enter_context(NodeClient(open_transport(node, CUBESENSE.baud), CUBESENSE))
        smbus = stack.enter_context(CubeSMBus(BUS))
        clients = {"serial": line, "i2c": I2cClient(smbus, CUBESENSE)}
        answers = dict.fromkeys(clients, 0)
        slowest_s = dict.fromkeys(clients, 0.0)
        memory: list[int] = []
        start_s = time.monotonic()
        while (now_s := time.monotonic() - start_s) < LENGTH_S or len(memory) < 2:
            for name, client in clients.items():
                asked_s = time.monotonic()
                client.telemetry("Identification")
                slowest_s[name] = max(slowest_s[name], time.monotonic() - asked_s)
                answers[name] += 1
            if now_s > LENGTH_S / 3:
                memory.append(memory_bytes(emulator.process))
        assert emulator.process.poll() is None
    grown = memory[-1] - memory[0]
    print(
        f"\n{transport}, {LENGTH_S:g} s: {answers} answers, the slowest after {slowest_s} s, "
        f"memory {memory[0]} bytes, {grown:+d} in the last two thirds, at most "
        f"{max(memory) - memory[0]:+d}"
    )
    assert min(answers.values()) >= min(20, 5 * LENGTH_S)
    assert max(slowest_s.values()) < SLOWEST_ANSWER_S
    assert grown < GROWTH_BYTES
