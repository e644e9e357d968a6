"""Both thresholds on the same poses."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.devices.registry import device
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.cubesense import thresholds


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="needs the compiled FPGA")
def test_dynamic_threshold_takes_the_whole_image_and_loses_the_sun(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        thresholds, "POSES", {name: thresholds.POSES[name] for name in ("whole", "sun")}
    )
    opened: Any = Opener(device("cubesense"), board={"profile": "extended"})
    found = thresholds.thresholds(opened, 1)
    assert (found["sun_fixed_found"], found["sun_dynamic_found"]) == (100, 0)
    assert np.isnan(found["sun_dynamic"])
    assert found["whole_dynamic"] < 0.1
    # 307 200 pixels of 28 + 2 * 12 cycles, less what a Sun that is not found saves.
    assert found["more_s"] == pytest.approx(307_200 * 52 / 5e6, rel=0.05)
