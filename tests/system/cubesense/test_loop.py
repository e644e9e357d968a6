"""Both sensors once a second, by results that schedule the next measurement; satellite turning."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.rtl.cxxrtl.build import find_compiler
from cubestack.emulator.scene.earth_sun import EarthSunScene, Target
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.devices.emulated import AnyEmulated

from .conftest import NADIR_DEG, SUN_DEG

TURNS = 6

Wire = list[tuple[bytes, int, int]]
Turns = list[dict[Camera, Measurement]]


def turning(seed: int = 1) -> EarthSunScene:
    return EarthSunScene.facing(
        sun_deg=SUN_DEG, nadir_deg=NADIR_DEG, rate_deg_s=(0.5, -1.0, 2.0), seed=seed
    )


def loop(session: AnyEmulated, turns: int = TURNS) -> Turns:
    """Read both results every second; the memories change places from turn to turn."""
    cubesense, kernel = session.client, session.board.kernel
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


def test_every_turn_measures_a_second_further_on(opened: Callable[..., Any]) -> None:
    scene = turning()
    with opened(scene) as session:
        turns = loop(session)
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


def wire(opened: Callable[..., Any], seed: int) -> tuple[Wire, list[bytes], int]:
    """Bytes that the node sends, each with its time; the memories in the end; and the end."""
    sent: Wire = []
    view = EarthSunView(turning(seed), FisheyeCondition(hot_pixels=20, seed=seed))
    with opened(view, seed=seed) as session:
        client = session.client.client  # at the line before it is listened to
        deliver = session.board.uart.line

        def listen(data: bytes, first_ps: int, byte_ps: int) -> None:
            sent.append((bytes(data), first_ps, byte_ps))
            deliver(data, first_ps, byte_ps)

        session.board.uart.line = listen
        loop(session, 3)
        for message in client.interface.telemetries:
            client.request(bytes([message.id]))
        memories = [memory.tobytes() for memory in session.board.engine.memories.values()]
        return sent, memories, session.board.kernel.now


def test_a_seed_repeats_to_the_byte_and_the_picosecond(opened: Callable[..., Any]) -> None:
    first = wire(opened, 1)
    assert len(first[0]) > 30
    assert wire(opened, 1) == first
    assert wire(opened, 2)[:2] != first[:2]


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.parametrize("turned", [False, True])
def test_one_core_is_faster_than_real_time(opened: Callable[..., Any], turned: bool) -> None:
    """Processor time, which other programs on the machine do not lengthen much."""
    with opened(turning() if turned else EarthSunScene()) as session:
        loop(session, 1)
        before_s, before_ps = time.process_time(), session.board.kernel.now
        loop(session, TURNS)
        spent_s = time.process_time() - before_s
        virtual_s = (session.board.kernel.now - before_ps) / PS_PER_S
    assert spent_s < virtual_s
