from contextlib import closing
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev import running
from cubestack.emulator.i2cdev.adapter import I2cAdapter


def test_a_program_without_supervisor_is_served_until_it_ends(
    adapter: I2cAdapter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "shim_library", lambda: tmp_path / "none.so")
    bus = running.emulated_bus(adapter.env, lambda: False, adapter, tmp_path / "bus")
    said: list[str] = []
    command = ["sh", "-c", "exit 3"]
    with closing(bus.port):
        code = running.run_program(
            command, 7, bus, pace="fast", route="preload", report=said.append
        )
    assert code == 3
    assert said[0] == "/dev/i2c-7 is served by preload, as requested"
