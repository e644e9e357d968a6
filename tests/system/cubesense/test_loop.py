import time
from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.emulation.emulated import AnyEmulated
from tests.system.conftest import Open
from tests.tiers import quick

from .conftest import FACING

TURNS = 6

TURNING = replace(FACING, rate_deg_s=(0.5, -1.0, 2.0))


def loop(opened: AnyEmulated, swap: bool, turns: int = TURNS) -> list[dict[Camera, Measurement]]:
    """Reads both results every second; with ``swap`` each picture goes to its own memory in even
    turns, to the other one in odd turns, else always to its own."""
    cubesense, kernel = opened.client, opened.board.kernel
    cubesense.client.pause(0.3)
    found = []
    for turn in range(turns + 1):
        due = kernel.now + PS_PER_S
        memories = {camera: Sram((camera + turn * swap) % 2) for camera in Camera}
        found.append({c: cubesense.result_then_schedule(c, sram) for c, sram in memories.items()})
        cubesense.client.pause((due - kernel.now) / PS_PER_S)
    return found[1:]


@pytest.mark.parametrize(
    ("gateware", "swap"), [("one-search", False), ("both-searches", True), ("corrected", True)]
)
def test_every_iteration_measures_the_current_second(
    session: Open, gateware: str, swap: bool
) -> None:
    """But for the other memory with one search: its nadir image crosses the link in 11 s."""
    with session(TURNING, set=f"lens=nominal,gateware={gateware}") as opened:
        turns = loop(opened, swap)
    for number, turn in enumerate(turns):
        other = swap and number % 2
        stored = CaptureResult.STORED_OTHER_SRAM if other else CaptureResult.STORED_OWN_SRAM
        for camera, found in turn.items():
            assert (found.detected, found.capture) == (True, stored)
            # Within the second in which it was taken, what the sensor sees turns by 2.3 deg.
            middle_ps = round((number + 0.4) * PS_PER_S)
            truth = TURNING.truth(CameraTarget[camera.name], middle_ps)
            off = found.alpha_deg - truth.alpha_deg, found.beta_deg - truth.beta_deg
            assert np.hypot(*off) < 1.5


@pytest.mark.parametrize("scene", quick([EarthSunScene(), TURNING], 1), ids=["still", "turning"])
def test_emulation_is_faster_than_real_time(session: Open, scene: EarthSunScene) -> None:
    with session(scene) as opened:
        loop(opened, True, 1)
        before_s, before_ps = time.process_time(), opened.board.kernel.now
        loop(opened, True, TURNS)
        spent_s = time.process_time() - before_s
        virtual_s = (opened.board.kernel.now - before_ps) / PS_PER_S
    assert spent_s < virtual_s
