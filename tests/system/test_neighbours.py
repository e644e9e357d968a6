"""All three devices with a hostile neighbour on every port; honest clients see no error.

In wall time: CUBESTACK_NEIGHBOURS_S=600 lets it go on for as long; -s shows what was measured.
"""

import contextlib
import http.client
import json
import os
import random
import re
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.transport.streams import open_transport
from tests.system.conftest import Served

LENGTH_S = float(os.environ.get("CUBESTACK_NEIGHBOURS_S", "4"))
TOKEN = "a token of the test"
NAMES = ("cubestar", "cubesense", "aramis")
TIMEOUT_S = 30.0
SLOWEST_PACE = 0.9
"""Least virtual time per wall time, where nothing else keeps the machine busy."""

Address = tuple[str, int]
UNFINISHED = (
    b"",
    b"GET / HT",
    b"POST /pause HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\nx",
    b"POST /pause HTTP/1.1\r\nHost: [\r\nTransfer-Encoding: chunked\r\n\r\nfffffff\r\n",
)


def hold(address: Address, chance: random.Random) -> None:
    """Many connections that send a byte now and then."""
    kept = [socket.create_connection(address, TIMEOUT_S) for _ in range(40)]
    for one in kept:
        one.sendall(chance.choice(UNFINISHED))
    for one in kept:
        with contextlib.suppress(OSError):
            one.sendall(b"x")
    for one in kept:
        one.close()


def shout(address: Address, chance: random.Random) -> None:
    """Random bytes, as many as are taken at once, then it leaves without a word."""
    with socket.create_connection(address, TIMEOUT_S) as one:
        one.setblocking(False)
        for _ in range(50):
            one.send(chance.randbytes(1 << 15))


def enter(address: Address, _chance: random.Random) -> None:
    """A second client of a port that has one, which wants to stay."""
    with socket.create_connection(address, TIMEOUT_S) as one:
        one.settimeout(0.2)
        one.sendall(bytes.fromhex("1f7f801fff") * 1000)
        while one.recv(1 << 16):
            pass


def slow_down(address: Address, _chance: random.Random) -> None:
    """RFC 2217: 1 baud, 500 bytes, and away."""
    with socket.create_connection(address, TIMEOUT_S) as one:
        one.sendall(bytes((255, 251, 44, 255, 250, 44, 1, 0, 0, 0, 1, 255, 240)) + b"\x1f" * 500)


def guess(address: Address, chance: random.Random) -> None:
    """Requests without the token, and some that are none."""
    connection = http.client.HTTPConnection(*address, timeout=TIMEOUT_S)
    for path in ("/state", "/devices/cubestar/act", "/?token=x", "//evil.example/?token=x", "/%00"):
        connection.request("POST", path, chance.randbytes(1000), {"Authorization": "Bearer x"})
        answer = connection.getresponse()
        assert answer.status < http.HTTPStatus.INTERNAL_SERVER_ERROR
        answer.read()
        connection.close()


@pytest.mark.slow
def test_honest_clients_see_no_error_beside_hostile_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CUBESTACK_TOKEN", TOKEN)
    over, faults = threading.Event(), list[BaseException]()

    def forever(act: Callable[[], object]) -> None:
        while not over.is_set() and not faults:
            try:
                act()
            except OSError:
                over.wait(0.005)  # it was cut off, as it should be
            except BaseException as error:
                faults.append(error)

    with ExitStack() as stack:
        words = [*NAMES, "--tcp", "0", "--control", "0"]
        served = stack.enter_context(Served(words, tmp_path, last="AraMiS serves"))
        ports = re.findall(r"tcp://([\d.]+):(\d+)", served.said)
        found = re.search(r"control on http://([\d.]+):(\d+)", served.said)
        assert found is not None, served.said
        addresses = [(host, int(port)) for host, port in ports]
        control = found[1], int(found[2])
        free = stack.enter_context(Served(["cubestar", "--rfc2217", "0"], tmp_path, last="Ctrl-C"))
        rfc2217 = re.search(r"rfc2217://([\d.]+):(\d+)", free.said)
        assert rfc2217 is not None
        lonely = rfc2217[1], int(rfc2217[2])
        chance = random.Random(5)
        acts = [partial(act, control, chance) for act in (hold, shout, guess)]
        acts += [partial(act, one, chance) for one in addresses for act in (enter, shout)]
        lines = dict(zip(NAMES, (addresses[0], addresses[1], addresses[-1]), strict=True))
        nodes = {name: honest(stack, name, address) for name, address in lines.items()}
        threads = [threading.Thread(target=forever, args=(act,), daemon=True) for act in acts]
        for thread in threads:
            thread.start()
        stack.callback(lambda: [one.join(TIMEOUT_S) for one in threads])
        stack.callback(over.set)
        answers, slowest_s = 0, 0.0
        begin_s, begun = time.monotonic(), state(control)
        while time.monotonic() < begin_s + LENGTH_S:
            asked_s = time.monotonic()
            for node in nodes.values():
                node.telemetry("Identification")
            now = state(control)
            answers += 1
            slowest_s = max(slowest_s, time.monotonic() - asked_s)
            with contextlib.suppress(OSError):
                slow_down(lonely, chance)
        took_s = time.monotonic() - begin_s
        over.set()
        assert ask_alone(lonely)
        assert not faults
    pace = (now - begun) / took_s
    print(f"\n{took_s:.0f} s: {answers} rounds, the slowest {slowest_s:.2f} s, pace {pace:.3f}")
    assert answers >= LENGTH_S / 2
    if "CUBESTACK_NEIGHBOURS_S" in os.environ:
        assert pace > SLOWEST_PACE


def honest(stack: ExitStack, name: str, address: Address) -> NodeClient:
    interface: Interface = device(name).interface
    transport = open_transport(f"tcp://{address[0]}:{address[1]}", interface.baud)
    return stack.enter_context(NodeClient(transport, interface))


def state(control: Address) -> float:
    """Virtual time in s; every request must be answered."""
    connection = http.client.HTTPConnection(*control, timeout=TIMEOUT_S)
    connection.request("GET", "/state", headers={"Authorization": f"Bearer {TOKEN}"})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    assert answer.status == http.HTTPStatus.OK, content
    return float(json.loads(content)["time_s"])


def ask_alone(address: Address) -> bool:
    """Whether a client of RFC 2217, in which ff is doubled, gets its answer after the others."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        with contextlib.suppress(OSError), socket.create_connection(address, TIMEOUT_S) as one:
            one.settimeout(2.0)
            one.sendall(bytes.fromhex("1f7f801fffff"))
            answer = b""
            while b"\x1f\x7f" not in answer:
                answer += one.recv(1000)
            return True
    return False
