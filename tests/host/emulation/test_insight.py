import socket
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards import debugging
from cubestack.emulator.iss.insight.observer import Observer
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.host.emulation.records import InsightFiles, open_gdb
from tests.emulator.iss.efm32gg.bench import MS, Bench


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.parametrize("count", [1, 2, 3])
def test_profile_sums_the_cycles_of_all_devices(tmp_path: Path, count: int) -> None:
    path, cycles = tmp_path / "profile", 0
    with ExitStack() as stack:
        watch = InsightFiles(profile=path).open(stack)
        for number in range(1, count + 1):
            bench = Bench()
            observer = Observer(bench.machine, Symbols(None))
            before = bench.machine.cycles
            emulated: Any = SimpleNamespace(
                board=SimpleNamespace(insight=SimpleNamespace(observer=observer))
            )
            watch(emulated)
            bench.run_for(number * MS)
            cycles += bench.machine.cycles - before
            observer.close()
    assert int(path.read_text().split("totals: ")[1]) == pytest.approx(cycles, abs=100)


def test_closing_a_device_closes_its_debugger(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        debugging, "open_debugger", lambda _board, port, **_: GdbEndpoint(port, target)
    )
    target: Any = SimpleNamespace()
    emulated: Any = SimpleNamespace(board=SimpleNamespace(insight=object(), on_close=[]))
    endpoint = open_gdb(emulated, 0, wait=False)
    socket.create_connection(endpoint.address).close()
    for act in emulated.board.on_close:
        act()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(endpoint.address)
