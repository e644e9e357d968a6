"""The reference firmware beside the Python program: everything that telemetry says of a picture.

::

    .venv/bin/python -m tests.system.firmware.reference_pictures --frames 200

Both boards have the same picture in memory: one that the firmware took of a random sky. Both
process it by telecommand, and all that telemetry then says of stars and attitude is compared.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, IdMode
from cubestack.firmware_model.interface.cubestar.telecommands import MOST_STARS
from cubestack.host.devices.registry import device
from cubestack.host.emulation.emulated import power_up

#: Frames that are read once, and those that give the next star at each read.
ONCE = (
    *("TaskStatus", "DetectionSummary", "NumIdStars", "BestStarIndex"),
    *("Star1Details", "Star2Details", "Star3Details", "MatchSummary", "Quaternion"),
    *("SphereicalCoordinates", "AttitudeData", "AttitudeQuaternion", "Results", "ErrorFlags"),
)
STEPPING = (
    *("StarPositions", "BodyUnitVectors", "IDStarsDetails", "InertialUnitVectors"),
    *("StarDetails", "HipparcosNumber"),
)
START_S = 0.05
"""Until a program listens after power-up."""

#: Fields with the time of an image, not its content.
OF_TIME = {"FrameCounter", "ImageTime"}

Telemetry = list[tuple[str, dict[str, Any]]]


@dataclass(frozen=True)
class Compared:
    """A picture.

    Attributes:
        mode: what was commanded.
        solved: whether both have an attitude of it.
        stars: centroids.
        differences: frames that differ, with both programs' values.
    """

    mode: str
    solved: bool
    stars: int
    differences: list[tuple[str, dict[str, Any], dict[str, Any]]]


def compare(frames: int, seed: int, firmware: str) -> Iterator[Compared]:
    """Takes random pictures and compares the telemetry of both programs."""
    rng, cubestar = np.random.default_rng(seed), device("cubestar")
    with ExitStack() as stack:
        scene = SkyScene(random_quaternion(rng))
        own = stack.enter_context(power_up(cubestar, scene, firmware=firmware, seed=seed))
        model = stack.enter_context(power_up(cubestar, scene, seed=seed))
        for one in (own, model):
            one.wait(START_S)
        model.client.capture()
        for _ in range(frames):
            mag_limit = float(rng.choice([3.8, 4.2, 4.5, 6.0]))
            own.scene = replace(SkyScene(random_quaternion(rng)), mag_limit=mag_limit)
            own.client.capture()
            model.board.external_ram[:IMAGE_BYTES] = own.board.external_ram[:IMAGE_BYTES]
            mode, parameters = _mode(rng, own.scene)
            said = []
            for one in (own, model):
                one.client.client.command("ClearErrorFlags")
                for name, values in parameters:
                    one.client.client.command(name, **values)
                one.client.process_image()
                one.client.client.command("SelectBestStars")
                said.append(_telemetry(one.client.client))
            yield _compared(mode, *said)


def _mode(rng: np.random.Generator, scene: Any) -> tuple[str, list[tuple[str, dict[str, Any]]]]:
    """A random mode and its telecommands: lost, assisted, or unchanged."""
    chosen = str(rng.choice(["lost", "assisted", "as it stands"]))
    if chosen == "lost":
        return chosen, [("setIDMode", {"IdMode": IdMode.LOST_IN_SPACE})]
    if chosen == "assisted":
        x, y, z = matrix_from_quaternion(scene.quaternion)[2] + rng.normal(0, 0.02, 3)
        hint = {
            "RightAscension": float(np.float32(np.arctan2(y, x))),
            "Declination": float(np.float32(np.arctan2(z, np.hypot(x, y)))),
        }
        return chosen, [("setTrackingMode", hint)]
    return chosen, []


def _telemetry(client: Any) -> Telemetry:
    said = [(name, client.telemetry(name)) for name in ONCE]
    stars = int(said[1][1]["NumStarsDetected"])
    said += [(name, client.telemetry(name)) for name in STEPPING for _ in range(stars + 1)]
    return [
        (name, {key: value for key, value in values.items() if key not in OF_TIME})
        for name, values in said
    ]


def _compared(mode: str, own: Telemetry, model: Telemetry) -> Compared:
    by_name = dict(model)
    differences = [
        (name, ours, theirs)
        for (name, ours), (_, theirs) in zip(own, model, strict=False)
        if ours != theirs
    ]
    stars = int(by_name["DetectionSummary"]["NumStarsDetected"])
    assert stars <= MOST_STARS
    return Compared(mode, bool(by_name["AttitudeQuaternion"]["Valid"]), stars, differences)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--firmware", default="reference")
    arguments = parser.parse_args()
    counted: Counter[str] = Counter()
    for one in compare(arguments.frames, arguments.seed, arguments.firmware):
        counted.update(["pictures", one.mode])
        counted["stars"] += one.stars
        counted["solved"] += one.solved
        counted["different"] += bool(one.differences)
        for name, ours, theirs in one.differences:
            print(name, {key: (ours[key], theirs[key]) for key in ours if ours[key] != theirs[key]})
    print(dict(counted))


if __name__ == "__main__":
    main()
