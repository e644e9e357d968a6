"""Both sensors once a second, by results that schedule the next measurement; satellite turning."""

import time

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene, Target
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.devices.emulated import AnyEmulated
from tests.system.conftest import Ear, Open, Wire

from .conftest import NADIR_DEG, SUN_DEG

TURNS = 6

Turns = list[dict[Camera, Measurement]]


def turning(seed: int = 1) -> EarthSunScene:
    return EarthSunScene.facing(
        sun_deg=SUN_DEG, nadir_deg=NADIR_DEG, rate_deg_s=(0.5, -1.0, 2.0), seed=seed
    )


def loop(opened: AnyEmulated, turns: int = TURNS) -> Turns:
    """Read both results every second; the memories change places from turn to turn."""
    cubesense, kernel = opened.client, opened.board.kernel
    cubesense.client.pause(0.3)
    found: Turns = []
    for turn in range(turns + 1):
        due = kernel.now + PS_PER_S
        found.append(
            {
                camera: cubesense.result_then_schedule(camera, Sram((camera + turn) % 2))
                for camera in Camera
            }
        )
        cubesense.client.pause((due - kernel.now) / PS_PER_S)
    return found[1:]


def test_every_turn_measures_a_second_further_on(session: Open) -> None:
    scene = turning()
    with session(scene) as opened:
        turns = loop(opened)
    for number, turn in enumerate(turns):
        own = number % 2 == 0
        for camera, found in turn.items():
            assert found.detected
            stored = CaptureResult.STORED_OWN_SRAM if own else CaptureResult.STORED_OTHER_SRAM
            assert found.capture is stored
            # Within the second in which it was taken, what the sensor sees turns by 2.3 deg.
            middle_ps = round((number + 0.4) * PS_PER_S)
            truth = scene.truth(Target[camera.name], middle_ps)
            off = found.alpha_deg - truth.alpha_deg, found.beta_deg - truth.beta_deg
            assert np.hypot(*off) < 1.5


def wire(session: Open, seed: int) -> tuple[Wire, list[bytes], int]:
    """Bytes that the node sends, each with its time; the memories in the end; and the end."""
    view = EarthSunView(turning(seed), FisheyeCondition(hot_pixels=20, seed=seed))
    with session(view, seed=seed) as opened:
        sent = Ear(opened.board.uart).wire
        loop(opened, 3)
        for message in opened.client.client.interface.telemetries:
            opened.client.client.request(bytes([message.id]))
        memories = [memory.tobytes() for memory in opened.board.engine.memories.values()]
        return sent, memories, opened.board.kernel.now


def test_a_seed_repeats_to_the_byte_and_the_picosecond(session: Open) -> None:
    first = wire(session, 1)
    assert len(first[0]) > 30
    assert wire(session, 1) == first
    assert wire(session, 2)[:2] != first[:2]


@pytest.mark.parametrize("turned", [False, True])
def test_one_core_is_faster_than_real_time(session: Open, turned: bool) -> None:
    """Processor time, which other programs on the machine do not lengthen much."""
    with session(turning() if turned else EarthSunScene()) as opened:
        loop(opened, 1)
        before_s, before_ps = time.process_time(), opened.board.kernel.now
        loop(opened, TURNS)
        spent_s = time.process_time() - before_s
        virtual_s = (opened.board.kernel.now - before_ps) / PS_PER_S
    assert spent_s < virtual_s
