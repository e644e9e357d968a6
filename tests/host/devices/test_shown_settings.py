from collections import Counter

import pytest

from cubestack.host.devices.registry import device
from cubestack.host.devices.shown_settings import settings

CORNERS = ("XMin", "XMax", "YMin", "YMax")


@pytest.mark.parametrize(
    ("name", "telecommand", "places"),
    [
        ("cubestar", "setIDMargin", ["IDMargin.Margin"]),
        ("cubestar", "setPrincipalPoint", ["PrincipalPoint.Cx", "PrincipalPoint.Cy"]),
        ("cubestar", "setTrackingMode", []),  # telemetry has the measured direction
        ("cubesense", "DetectionThreshold2", ["Configuration.Threshold2"]),
        ("cubesense", "Mask2", [f"Masks2.{one}{area}" for area in range(1, 6) for one in CORNERS]),
        ("aramis", "SetGain", ["Gain.Gain"]),
    ],
)
def test_each_setting_is_shown_once_per_area(
    name: str, telecommand: str, places: list[str]
) -> None:
    sensor = device(name)
    shown = Counter(
        f"{one.frame.name}.{one.shown.name}"
        for one in settings(sensor.interface, sensor.conformance)
        if one.telecommand.name == telecommand
    )
    assert shown == Counter(places)
