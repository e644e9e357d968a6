import json
from pathlib import Path

import pytest

from cubestack.host.cli.main import main

UNIT = """
kind = "sky"
ra_deg = 0
dec_deg = 0
[optics]
focal_length_mm = 14.1
cx = 645.0
cy = 505.0
"""


@pytest.mark.slow
def test_finds_the_lens_of_an_emulated_unit(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scene = tmp_path / "unit.toml"
    scene.write_text(UNIT, encoding="utf-8")
    arguments = ("--json", "--emulated", "5", "--scene", str(scene))
    assert main(["calibrate", "aramis", *arguments]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["camera"]["f_px"] == pytest.approx(14100 / 5.2, abs=0.5)
    for name, true in (("cx_px", 645), ("cy_px", 505)):
        assert abs(found["camera"][name] - true) < 4 * found["sigma"][name] < 8
    assert found["after_px"] < 0.15 < 1 < found["before_px"]
    assert found["lens_px"] < 0.1
