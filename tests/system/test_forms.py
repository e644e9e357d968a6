"""Loops in C++ and reads of whole frames change no byte, time or charge."""

from typing import Any

import numpy as np
import pytest

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


def observed(name: str, profile: str, seed: int) -> tuple[Any, ...]:
    """Traffic and charges of an image and of all telemetry behind it, and the time at the end."""
    with open_device(name, scene(name, seed), seed=seed, profile=profile) as opened:
        ear, client = Ear(opened.board.uart), opened.client.client
        opened.client.observe()
        for message in client.interface.telemetries:
            for _ in range(1 + 12 * message.steps):
                client.request(bytes([message.id]))
        meter = opened.board.processor.meter
        charges = meter.total, dict(meter.counts), list(meter.phases.items())
        return vars(ear), charges, opened.board.kernel.now


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", ["cubestar", "aramis", "cubesense"])
def test_forms_are_equal(name: str, profile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fast = observed(name, profile, 1)
    assert loops_in_use() is not None
    assert len(fast[0]["sent"]) > 20
    monkeypatch.delattr(DirectSerial, "read_on")
    monkeypatch.setattr("cubestack.emulator.sim.firmware_loops.inner_loops", lambda *_: None)
    with python_form():
        assert observed(name, profile, 1) == fast
        assert loops_in_use() is None
