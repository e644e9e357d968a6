from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.host.errors import CameraFileError
from cubestack.host.studies.star_log import load_sights, star_line

SIRIUS, VEGA = 32349, 91262


def star(hipparcos: int | None, x_px: float, y_px: float) -> Any:
    return SimpleNamespace(hipparcos=hipparcos, x_px=x_px, y_px=y_px)


def test_stars_written_are_read_and_those_without_name_left_out(tmp_path: Path) -> None:
    path = tmp_path / "stars.jsonl"
    lines = [
        star_line([star(VEGA, 1.5, 2.0), star(None, 9.0, 9.0), star(SIRIUS, 3.0, 4.25)]),
        "",
        star_line([]),
    ]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    first, second = load_sights(path)
    sky = load_sky()
    assert first.pixels.tolist() == [[1.5, 2.0], [3.0, 4.25]]
    expected = [sky.vectors[np.flatnonzero(sky.hip == one)[0]] for one in (VEGA, SIRIUS)]
    assert np.array_equal(first.vectors, expected)
    assert second.pixels.shape == (0, 2)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("{}", "line 1 must be a list of"),
        ("[[32349, 1]]", "line 1 must be a list of"),
        ("[[32349, 1, 20000]]", "line 1 must be a list of"),
        ("[[32349.5, 1, 2]]", "line 1 must be a list of"),
        ("[[true, 1, 2]]", "line 1 must be a list of"),
        ("[[32349, NaN, 2]]", "line 1"),
        ("[[999999999, 1, 2]]", "the catalogue has no star 999999999"),
        ("[[0, 1, 2]]", "the catalogue has no star 0"),
        ("[[" + "9" * 60 + ", 1, 2]]", "line 1"),
        ("[" * 2000, "line 1"),
        ("stars", "line 1"),
    ],
)
def test_rejects_other_lines_with_their_number(tmp_path: Path, line: str, complaint: str) -> None:
    path = tmp_path / "stars.jsonl"
    path.write_text(line + "\n", "utf-8")
    with pytest.raises(CameraFileError, match=complaint):
        load_sights(path)
