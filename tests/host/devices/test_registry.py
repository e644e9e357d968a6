from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.host.devices import registry
from cubestack.host.devices.registry import device, device_names, devices, get, merged_tables
from cubestack.host.emulation.emulated import open_device
from cubestack.host.errors import TargetError


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[EntryPoint]]:
    others: list[EntryPoint] = []
    monkeypatch.setattr(registry, "entry_points", lambda group: others)
    registry._entries.cache_clear()
    device.cache_clear()
    yield others
    registry._entries.cache_clear()
    device.cache_clear()


def test_declared_names_match_the_entry_points() -> None:
    assert [one.name for one in devices()] == list(device_names())
    assert [one.name for one in devices()] == [one.interface.name.lower() for one in devices()]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("sun-slit", "a device's name is an identifier of small letters, not sun-slit"),
        ("Sun", "a device's name is an identifier of small letters, not Sun"),
        ("other", "the interface of other is called CubeStar"),
    ],
)
def test_rejects_invalid_names(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(device("cubestar"), name=name)


def test_name_lookup_ignores_case() -> None:
    assert device("CubeStar") is device("cubestar")
    with pytest.raises(TargetError, match="no device 'cubestart'; known: cubestar, cubesense"):
        device("cubestart")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("cubestack.host.errors:TargetError", "TargetError is no Device of that name"),
        ("no_such_module:DEVICE", "device other: no_such_module:DEVICE does not load"),
    ],
)
def test_invalid_registration_is_reported_and_not_listed(
    registered: list[EntryPoint], value: str, message: str
) -> None:
    registered.append(EntryPoint("other", value, registry.GROUP))
    assert device_names()[-1] == "other"
    assert "other" not in [one.name for one in devices()]
    with pytest.raises(TargetError, match=message):
        device("other")


def test_merged_tables_skip_a_device_that_does_not_load() -> None:
    tables = {
        "cubestar": get("nowhere:TOPS"),
        "aramis": lambda: {"a": 1},
        "cubesense": lambda: {"b": 2},
    }
    assert merged_tables(lambda one: tables[one.name]()) == {"a": 1, "b": 2}


def test_built_in_device_can_not_be_replaced(registered: list[EntryPoint]) -> None:
    registered.append(EntryPoint("cubestar", "nowhere:NOTHING", registry.GROUP))
    assert device("cubestar").title == "CubeStar"


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("aramis", {"layout": "2"}, "layout is an option of cubestar, not of aramis"),
        ("cubestar", {"layuot": "2"}, "layuot is no option of cubestar"),
        ("cubestar", {"layout": "4"}, "layout of cubestar must be one of 1, 2, 3, two-boards"),
        ("cubesense", {"mcu_addressing": "yes"}, "must be true or false, not 'yes'"),
    ],
)
def test_rejects_invalid_options(name: str, options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        open_device(name, **options)


def test_second_device_on_a_bus_needs_another_address() -> None:
    with open_device("aramis", seed=1) as first, open_device("aramis", seed=1) as alone:
        with pytest.raises(ValueError, match="address"):
            open_device("aramis", beside=first)  # both would be at the same I2C address
        alone.wait(0.5)
        assert first.time_s == 0.0


ALNILAM_DEG = 84.05, -1.20
"""Right ascension and declination of the belt's middle star."""


@pytest.mark.parametrize("name", ["cubestar", "aramis"])
def test_star_trackers_point_at_orions_belt_with_north_up(name: str) -> None:
    axes = matrix_from_quaternion(device(name).default_scene().quaternion)
    ra, dec = np.radians(ALNILAM_DEG)
    star = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    assert np.degrees(np.arccos(axes[2] @ star)) < 0.25
    assert axes @ (0, 0, 1) == pytest.approx((0, -1, 0), abs=0.02)


def test_cubesense_default_scene_matches_the_tutorial() -> None:
    scene = device("cubesense").default_scene()
    for target, angles_deg in (
        (CameraTarget.SUN, (20.0, 10.0)),
        (CameraTarget.NADIR, (-8.0, 12.0)),
    ):
        truth = scene.truth(target, 0)
        assert (truth.alpha_deg, truth.beta_deg) == pytest.approx(angles_deg)
