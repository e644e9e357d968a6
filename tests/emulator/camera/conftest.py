from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.common.image_sensor import StreamSegment
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.sky import PictureScene


@pytest.fixture
def striped(tmp_path: Path) -> PictureScene:
    """A picture whose row r has the grey value 100 + r // 4, below 228."""
    rows = np.repeat(100 + np.arange(512, dtype=np.uint8) // 4, 1024).reshape(512, 1024)
    Image.fromarray(rows).save(tmp_path / "striped.png")
    return PictureScene(tmp_path / "striped.png")


def save(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def check_refused(load: Callable[[Path], Any], path: Path, complaint: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(path)
    message = str(caught.value)
    assert complaint in message
    assert message.startswith(str(path))
    assert "\n" not in message


def segments(camera: Any, start_ps: int, count: int) -> list[StreamSegment]:
    found = []
    for _ in range(count):
        segment = camera.segment_at(start_ps)
        found.append(segment)
        start_ps = segment.start_ps + int(segment.clocks * camera.period)
    return found


US = 10**6
Pin = Callable[[str, int, int], None]


def send(
    pin: Pin, sda: Callable[[], int], data: bytes, now_ps: int = 0, step_ps: int = 3 * US
) -> list[int]:
    """Control bus: start, bytes with a ninth bit each, stop; SDA as read in the ninth bits."""
    answers: list[int] = []

    def step(name: str, level: int) -> None:
        nonlocal now_ps
        now_ps += step_ps
        pin(name, level, now_ps)

    for name, level in (("SDA", 1), ("SCL", 1), ("SDA", 0), ("SCL", 0)):
        step(name, level)
    for byte in data:
        for n in range(8):
            step("SDA", byte >> (7 - n) & 1)
            step("SCL", 1)
            step("SCL", 0)
        step("SDA", 1)
        step("SCL", 1)
        answers.append(sda())
        step("SCL", 0)
    for name, level in (("SDA", 0), ("SCL", 1), ("SDA", 1)):
        step(name, level)
    return answers
