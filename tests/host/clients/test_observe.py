import math
import re

import numpy as np
import pytest

from cubestack.host.devices.registry import device_names
from cubestack.host.emulation.emulated import open_device

BEFORE, KNOWN = "no image since power-up", r"attitude known to ([0-9.e-]+) arcsec"


@pytest.mark.parametrize("name", device_names())
def test_observe_then_summary_describes_the_image(name: str) -> None:
    with open_device(name, seed=3, profile="extended") as device:
        client = device.client
        assert BEFORE in client.summary(client.latest())
        client.observe()
        latest = client.latest()
        told = client.summary(latest)
        assert BEFORE not in told
        known = re.search(KNOWN, told)
        if known is None:
            assert re.fullmatch(r"Sun .* deg (left|right), .*; Nadir .* deg (up|down)", told)
            return
        (truth,) = device.board.truths().values()
        found = np.array([latest[f"q{part}"] for part in range(4)], np.float64)
        # About the boresight, the error is many times that of the boresight.
        error_rad = 2 * math.acos(min(abs(float(truth @ found)), 1))
        assert error_rad < math.radians(60 * float(known[1]) / 3600)
        assert re.match(r"[1-9][0-9]* of [0-9]+ stars identified, ", told)


def test_summary_says_why_there_is_no_attitude() -> None:
    with open_device("cubestar", profile="published") as device:
        device.client.perform("setDetectionThresholds", DetectionThreshold=255, StarThreshold=255)
        device.client.observe()
        told = device.client.summary(device.client.latest())
        assert re.fullmatch(r"[0-9]+ stars detected, no attitude: .*", told)
