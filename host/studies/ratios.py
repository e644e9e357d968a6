"""Ratios of the costs of two ways to do the same, measured in turn in one run.

Both ways have the same results; tests prove that. Each ratio is the reference's processor time by
ours, so it depends little on the machine and on its load.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cubestack.emulator.light import pixels, spots
from cubestack.emulator.light.library import light_library
from cubestack.emulator.light.noise import FrameNoise
from cubestack.firmware_model.mcu.inner_loops import python_form
from cubestack.host.emulation.emulated import AnyEmulated, open_device

ROUNDS = 5
"""Turns of both ways; the best of each counts."""

SHAPE = (512, 1024)
STARS, SIGMA_PX = 300, 0.8

MEANINGS: Mapping[str, str] = {
    "light_ratio": "light of a frame with 300 stars and noise: NumPy by C++",
    "DEVICE_loops_ratio": "an image and its processing: the firmware's loops in Python by C++",
    "DEVICE_serial_ratio": "a read of all telemetry: an event for each byte by one for a frame",
    "DEVICE_reuse_ratio": "an image on a fresh device by one on a device in use",
}
"""Meaning of each ratio, by its name in the JSON output."""


def ratio(ours: Callable[[], object], reference: Callable[[], object]) -> float:
    """Processor time of ``reference`` by that of ``ours``."""
    best = [float("inf"), float("inf")]
    for _ in range(ROUNDS):
        for place, run in enumerate((ours, reference)):
            started = time.process_time()
            run()
            best[place] = min(best[place], time.process_time() - started)
    return round(best[1] / best[0], 2)


def light_ratio() -> dict[str, float]:
    """Empty without a C++ compiler."""
    library = light_library()
    if library is None:
        return {}
    rng = np.random.default_rng(1)
    places = rng.uniform(0, (SHAPE[1], SHAPE[0]), (STARS, 2))
    star = (places, rng.uniform(100, 10_000, STARS), SIGMA_PX, spots.reach_px(SIGMA_PX), SHAPE)
    model = pixels.PixelModel(dark=20.0, steady=25.0, gain=0.1, noise=FrameNoise((1, 2)))
    return {
        "light_ratio": ratio(
            lambda: pixels.compiled(library, spots.compiled(library, *star), model),
            lambda: pixels.reference(spots.reference(*star), model),
        )
    }


def device_ratios(name: str) -> dict[str, float]:
    """The others, of an emulated device that takes images."""
    with open_device(name) as used:

        def in_python() -> None:
            with python_form():
                used.client.observe()

        def fresh() -> None:
            with open_device(name) as other:
                other.client.observe()

        used.client.observe()  # what the first image needs stays in memory
        return {
            f"{name}_loops_ratio": ratio(used.client.observe, in_python),
            f"{name}_serial_ratio": ratio(lambda: _read(used), lambda: _read_by_bytes(used)),
            f"{name}_reuse_ratio": ratio(used.client.observe, fresh),
        }


def _read(emulated: AnyEmulated) -> None:
    client: Any = emulated.client.client
    for message in client.interface.telemetries:
        if not message.starts_measurement:
            client.request(bytes([message.id]))


def _read_by_bytes(emulated: AnyEmulated) -> None:
    """An observer of bytes makes each an event of its own."""
    taps = emulated.board.uart.host_taps
    taps.append(_ignore)
    _read(emulated)
    taps.remove(_ignore)


def _ignore(_byte: int, _start_ps: int) -> None:
    pass
