import tomllib
from typing import Any

import pytest

from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.toml_text import toml_text


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"kind": "sky", "ra_deg": 83.8, "count": -3, "noise": False, "list": [1, 2.5]},
        {"small": 1e-7, "large": 1e300, "pairs": [[40.0, 0.1], [70.0, 0.4]], "none": []},
        {"atmosphere": {"latitude_deg": -33.9}, "after": 1},
        {"poses": [{"at_s": 1.0, "rate_deg_s": [0.0, 1.0, 0.0]}, {"at_s": 2.0}]},
        {"hazards": {"sun-glare": [{"direction": [1.0, 2.0]}], "moon": {"scatter": 0.1}}},
        {"empty": {}, "key with blanks": {'"quoted"': 1}, "line\nend": 2},
        {"text": 'quotes " and \\ and \x00 \x7f \n é 😀 ]\n[hazards]'},
    ],
)
def test_it_reads_as_the_same_table(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_a_moment_becomes_one() -> None:
    (moment,) = tomllib.loads(toml_text({"utc": "2013-02-01T20:00:00Z"})).values()
    assert moment.isoformat() == "2013-02-01T20:00:00+00:00"


@pytest.mark.parametrize("value", [None, float("inf"), float("nan"), object(), [None], [{}, 1]])
def test_rejects_values_that_toml_cannot_store(value: Any) -> None:
    with pytest.raises(SceneError, match="a scene file can not contain the value"):
        toml_text({"key": value})
