import json
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.host.errors import CameraFileError
from cubestack.host.studies.star_log import load_sights

SIRIUS, VEGA = 32349, 91262


def test_each_line_is_an_image_with_the_directions_of_its_stars(tmp_path: Path) -> None:
    path = tmp_path / "stars.jsonl"
    lines = [json.dumps([[VEGA, 1.5, 2.0], [SIRIUS, 3.0, 4.25]]), "", "[]"]
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
