"""A folder of what hazards look like and do: sample pictures, curves, points."""

import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.host.devices.emulated import AnyEmulated
from cubestack.host.devices.registry import device as registered
from cubestack.host.experiments.hazards.asked import Asked, known
from cubestack.host.experiments.hazards.curves import Point, wilson
from cubestack.host.experiments.measure import experiment_of
from cubestack.host.experiments.opener import Opener
from cubestack.host.pictures.hazards import save_curves, save_sample


def check(folder: Path) -> None:
    """Make the folder; ValueError when figures can not be made or it is a file."""
    if find_spec("matplotlib") is None:
        raise ValueError("--out: figures need matplotlib: pip install cubestack[plots]")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise ValueError(f"--out: {folder} is a file; a folder would be right") from None


def write(points: Sequence[Point], folder: Path, seed: int) -> int:
    """Write the pictures of each hazard, its curves, and all points; returns how many files."""
    lines = [json.dumps(point.as_dict()) for point in points]
    (folder / "points.jsonl").write_text("\n".join(lines) + "\n", "utf-8")
    files = 1
    for name in dict.fromkeys(point.hazard for point in points):
        own = [point for point in points if point.hazard == name]
        rows = {
            registered(device).title: [point for point in own if point.device == device]
            for device in dict.fromkeys(point.device for point in own)
        }
        kind = known()[name]
        unit = f", {kind.strength.unit}" if kind.strength.unit else ""
        save_curves(rows, f"{kind.strength.key}{unit}", kind.meaning, wilson,
                    folder / f"{name}-curve.png")  # fmt: skip
        files += 1
        for device in dict.fromkeys(point.device for point in own):
            save_sample(sample(device, name, seed), folder / f"{name}-{device}.png")
            files += 1
    return files


def sample(device: str, hazard: str, seed: int) -> NDArray[np.uint8]:
    """The picture (rows, columns) of a device's first frame with a hazard of its usual strength."""
    found, kept = registered(device), list[AnyEmulated]()
    experiment = experiment_of(found)
    options = experiment.options(hazard=(Asked(hazard),), seed=seed)
    results = experiment.run(Opener(found, opened=kept.append), options)
    next(results)  # while more could come, the device is there
    client = kept[0].client
    return client.picture(next(iter(client.picture_sources), None))
