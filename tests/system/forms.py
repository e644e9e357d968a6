"""Devices in two forms: inner loops and light in C++ with frames that are one event, or Python,
NumPy and each byte alone.

`python -m tests.system.forms SKIES PLANS` compares as many skies of each sensor and profile, and
lives with random faults of a CubeStar and of a CubeSense.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.line import DirectSerial
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.mcu.inner_loops import python_form
from cubestack.host.emulation.emulated import open_device
from cubestack.host.terminal import progress
from tests.system.conftest import Ear
from tests.system.life import life, pair_life

SENSORS = ("cubestar", "aramis", "cubesense")
LIGHTS = ("distortion", "pixels", "spots", "globe")

Seen = dict[str, Any]


@contextmanager
def slow_form() -> Iterator[None]:
    """Use Python, NumPy and single bytes within the block."""
    with ExitStack() as stack:
        stack.enter_context(patch.object(DirectSerial, "read_on", None))
        stack.enter_context(patch.object(Uart, "_at_once", lambda _uart: 1))
        for target in (
            "cubestack.emulator.sim.firmware_loops.inner_loops",
            *(f"cubestack.emulator.light.{light}.light_library" for light in LIGHTS),
        ):
            stack.enter_context(patch(target, lambda *_: None))
        stack.enter_context(python_form())
        yield


def scene(name: str, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    where = rng.uniform(0, 360), np.degrees(np.arcsin(rng.uniform(-1, 1))), rng.uniform(0, 360)
    return None if name == "cubesense" else SkyScene.pointing(*where)


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


def differs(play: Callable[[], Any]) -> bool:
    fast = play()
    with slow_form():
        return bool(play() != fast)


def main(skies: int, plans: int) -> int:
    jobs: dict[str, Callable[[], Any]] = {
        f"{name} {profile} {seed}": lambda name=name, profile=profile, seed=seed: observed(
            name, profile, seed
        )
        for seed in range(skies)
        for name in SENSORS
        for profile in PROFILES
    }
    for seed in range(plans):
        jobs[f"faults of cubestar {seed}"] = lambda seed=seed: life(seed)
        jobs[f"faults of cubesense {seed}"] = lambda seed=seed: pair_life(seed, "one-search")
    wrong = [name for name in progress(jobs, len(jobs), "forms") if differs(jobs[name])]
    print(f"{len(jobs)} compared, {len(wrong)} differ{': ' * bool(wrong)}{', '.join(wrong)}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])))
