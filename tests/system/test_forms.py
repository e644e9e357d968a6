"""Loops in C++ and frames that are one event change no byte, time or charge."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.line import DirectSerial
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.mcu.inner_loops import loops_in_use, python_form
from cubestack.host.emulation.emulated import open_device
from tests.system.conftest import Ear


def scene(name: str, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    where = rng.uniform(0, 360), np.degrees(np.arcsin(rng.uniform(-1, 1))), rng.uniform(0, 360)
    return None if name == "cubesense" else SkyScene.pointing(*where)


Seen = dict[str, Any]


def observed(name: str, profile: str, seed: int, *, tapped: bool = False) -> tuple[Seen, Seen]:
    """Answers with their times and charges of an image and of all telemetry behind it; with an
    observer of bytes also the traffic at the device."""
    with open_device(name, scene(name, seed), seed=seed, profile=profile) as opened:
        ear = vars(Ear(opened.board.uart)) if tapped else {}
        client, kernel = opened.client.client, opened.board.kernel
        opened.client.observe()
        answers = [
            (client.request(bytes([message.id])), kernel.now)
            for message in client.interface.telemetries
            for _ in range(1 + 12 * message.steps)
        ]
        meter = opened.board.processor.meter
        charges = {"total": meter.total, "counts": dict(meter.counts), "phases": meter.phases}
        return {"answers": answers, **charges}, ear


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", ["cubestar", "aramis", "cubesense"])
def test_forms_are_equal(name: str, profile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fast, _ = observed(name, profile, 1)
    assert loops_in_use() is not None
    assert len(fast["answers"]) > 20
    heard, traffic = observed(name, profile, 1, tapped=True)
    assert heard == fast
    monkeypatch.delattr(DirectSerial, "read_on")
    monkeypatch.setattr(Uart, "_at_once", lambda _uart: 1)
    monkeypatch.setattr("cubestack.emulator.sim.firmware_loops.inner_loops", lambda *_: None)
    with python_form():
        assert observed(name, profile, 1, tapped=True) == (fast, traffic)
        assert loops_in_use() is None
