"""What the tests of a whole CubeSense share."""

import io
import json
from collections.abc import Callable
from contextlib import AbstractContextManager, redirect_stdout
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, IMAGE_BYTES, ROWS, Camera
from cubestack.host.cli.main import main
from cubestack.host.cli.session import CubeSenseSession, open_cubesense

Frames = list[dict[str, Any]]

SUN_DEG = (20.0, 10.0)
NADIR_DEG = (-8.0, 12.0)


@pytest.fixture
def scene() -> EarthSunScene:
    """Sun and Earth in view of their cameras."""
    return EarthSunScene.facing(sun_deg=SUN_DEG, nadir_deg=NADIR_DEG)


@pytest.fixture
def opened() -> Callable[..., AbstractContextManager[CubeSenseSession]]:
    """Opens a board that looks at a scene, with clients on its serial lines."""
    return open_cubesense


@pytest.fixture
def measure(capsys: pytest.CaptureFixture[str]) -> Callable[..., Frames]:
    """`cubestack measure cubesense --json` with more arguments; the results that it prints."""

    def run(*arguments: object) -> Frames:
        capsys.readouterr()
        code = main(["measure", "cubesense", "--json", *map(str, arguments)])
        output = capsys.readouterr()
        assert (code, output.err) == (0, "")
        return [json.loads(line) for line in output.out.splitlines()]

    return run


@pytest.fixture(scope="module")
def module_measure() -> Callable[..., Frames]:
    """The same for a fixture that several tests of a module share."""

    def run(*arguments: object) -> Frames:
        output = io.StringIO()
        with redirect_stdout(output):
            assert main(["measure", "cubesense", "--json", *map(str, arguments)]) == 0
        return [json.loads(line) for line in output.getvalue().splitlines()]

    return run


@pytest.fixture
def sent() -> Callable[[CubeSenseSession, Camera], np.ndarray]:
    """The picture (480, 640) that a camera sent while one was stored last, rendered anew."""

    def look(session: CubeSenseSession, camera: Camera) -> np.ndarray:
        shutter = session.board.stored_frame(camera)
        assert shutter is not None
        segment = session.board.cameras[camera].segment_at(shutter.readout_ps + 1)
        assert segment is not None
        assert segment.pixels is not None
        return segment.pixels()

    return look


@pytest.fixture
def memory() -> Callable[[CubeSenseSession, Camera], np.ndarray]:
    """The picture (480, 640) in the memory of a camera's half, looked at from outside."""

    def read(session: CubeSenseSession, half: Camera) -> np.ndarray:
        rows = session.board.engine.memories[HALVES[half]].reshape(-1, 1024)[:ROWS, :COLUMNS]
        assert rows.size == IMAGE_BYTES
        return rows

    return read
