"""Processes a whole image by the compiled algorithms: cycles of each phase, and the results.

``firmware_model/reference/costs/picture.c``: search to attitude, lost in space, profile published,
settings as after a reset.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.iss.calls import Calls
from cubestack.firmware_model.attitude.geometry import undistort, unit_vectors
from cubestack.firmware_model.attitude.quest import dcm, quest
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.configuration import camera_parameters, detection_config
from cubestack.firmware_model.cubestar.detection import detect_stars
from cubestack.firmware_model.cubestar.matching.voting import identify
from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.state import Settings

#: Phases in the order of ``enum phase`` in firmware_model/reference/costs/phases.h.
PHASES = (
    *("search", "centroid", "correction", "vectors", "reduction", "distances", "votes"),
    *("identities", "verification", "selection", "prediction", "attitude"),
)
#: Phases of the thesis' step "detection", figure 5.7.
DETECTION = ("search", "centroid", "correction", "vectors")

_CONFIG = (
    *("step", "x_start", "x_end", "y_start", "y_end", "detection_threshold", "star_threshold"),
    *("min_pixels", "max_pixels", "grid_size", "max_stars", "max_invalid", "max_noise"),
)
_CAMERA = ("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")


@dataclass(frozen=True)
class Solution:
    """Cycles and results of an image."""

    cycles: dict[str, int]  # cycles of each phase that ran
    quaternion: tuple[int, ...]  # bits of its four components, as integers
    stars: int  # number of centroids


def default_settings() -> str:
    """Text of ``defaults.h``: the settings after a reset, as C initialisers."""
    settings = Settings(INTERFACE, SETTING_COMMANDS)
    config, camera = detection_config(settings), camera_parameters(settings)
    fields = ", ".join(f".{name} = {getattr(config, name)}" for name in _CONFIG)
    lens = ", ".join(f".{name} = {np.float32(getattr(camera, name))!s}" for name in _CAMERA)
    margin = np.float32(settings.get("setIDMargin", "Margin"))
    return (
        f"#define DETECTION_DEFAULTS {{{fields}}}\n"
        f"#define CAMERA_DEFAULTS {{{lens}}}\n"
        f"#define MARGIN_DEFAULT {margin!s}f\n"
    )


def run(calls: Calls, picture: NDArray[np.uint8]) -> Solution:
    calls.machine.external[: picture.size] = picture.reshape(-1)
    cycles: dict[str, int] = {}
    stack: list[str] = []
    since = 0

    def begin(phase: int, now: int) -> None:
        nonlocal since
        if stack:
            cycles[stack[-1]] = cycles.get(stack[-1], 0) + now - since
        stack.append(PHASES[phase])
        since = now

    def end(_phase: int, now: int) -> None:
        nonlocal since
        phase = stack.pop()
        cycles[phase] = cycles.get(phase, 0) + now - since
        since = now

    calls.call("process_picture", marks={"phase_begin": begin, "phase_end": end})
    machine = calls.machine
    quaternion = np.frombuffer(machine.peek(calls.symbols["quaternion"], 16), np.uint32)
    (stars,) = np.frombuffer(machine.peek(calls.symbols["found"], 4), np.int32)
    return Solution(cycles, tuple(map(int, quaternion)), int(stars))


def run_model(picture: NDArray[np.uint8], catalogue: StarCatalogue, meter: Meter) -> Solution:
    """Process an image by the Python program; its cycles are those that it charges."""
    switches, settings = CubeStarSwitches(), Settings(INTERFACE, SETTING_COMMANDS)
    listed = catalogue.with_pair_limit(float(switches.pair_limit))
    config = detection_config(settings, plain_weights=switches.weights == "intensity")
    camera = camera_parameters(settings)
    detection = detect_stars(picture, config, meter)
    with meter.phase("correction"):
        points = undistort(detection.centroids, camera, meter)
    with meter.phase("vectors"):
        vectors = unit_vectors(points, camera, meter)
    found = identify(vectors, listed, meter)
    kept = found.matched
    with meter.phase("attitude"):
        weights = found.votes[kept].astype(np.float32)
        quaternion = quest(vectors[kept], listed.vectors[found.stars[kept]], weights, meter)
        dcm(quaternion, meter)
    bits = quaternion.view(np.uint32)
    return Solution(dict(meter.phases), tuple(map(int, bits)), len(detection.sizes))
