from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from tests.tiers import quick

NAMES = ("cubestar", "cubesense", "aramis")

#: Telecommands that measure once.
MEASURE: dict[str, list[tuple[str, dict[str, Any]]]] = {
    "cubestar": [("CaptureAndProcess", {})],
    "cubesense": [("CaptureAndDetect", {"Camera": c, "Sram": c}) for c in (0, 1)],
    "aramis": [("Activate", {}), ("GetAttitude", {})],
}

#: Values of which some are of neither profile.
OTHERS = {
    "cubestar": "pair_limit=60,voting=algorithm-2,reduction=30.3",
    "cubesense": "distortion=equidistant,edges=listing,sun=all-pixels",
    "aramis": "identities=appendix-e,weights=grey-level",
}


@pytest.fixture(scope="module")
def extended() -> Iterator[dict[str, AnyEmulated]]:
    with ExitStack() as stack:
        yield {n: stack.enter_context(open_device(n, profile="extended")) for n in NAMES}


@pytest.fixture(params=NAMES)
def unit(request: pytest.FixtureRequest, extended: dict[str, AnyEmulated]) -> AnyEmulated:
    opened = extended[request.param]
    opened.client.set_profile("extended")
    return opened


def perform(unit: AnyEmulated, name: str, parameters: dict[str, Any]) -> None:
    unit.client.client.command(name, **parameters)
    unit.client.client.wait_processed(10.0)


def everything(unit: AnyEmulated) -> dict[str, Any]:
    shown = [m for m in unit.device.interface.telemetries if m.supported]
    return {m.name: unit.client.client.telemetry(m.name) for m in shown if not m.starts_measurement}


def test_each_value_of_each_switch_is_set_and_read_back(unit: AnyEmulated) -> None:
    client, wanted = unit.client, unit.device.switches.of("extended")
    assert client.profile() == wanted
    firmware = {name: one for name, one in wanted.declared().items() if not one.hardware}
    for name, one in firmware.items():
        for value in (*one.choices[::-1], *one.choices):
            client.set_switch(name, value)
            wanted = replace(wanted, **{name: value})
            assert client.profile() == wanted
    for profile in PROFILES:
        client.set_profile(profile)
        found, full = client.profile(), unit.device.switches.of(profile)
        assert all(getattr(found, name) == getattr(full, name) for name in firmware)


@pytest.mark.parametrize("mixed", quick([True, False], 1), ids=["switches", "profile"])
@pytest.mark.parametrize("name", NAMES)
def test_changed_profile_measures_like_a_fresh_device(name: str, mixed: bool) -> None:
    profile, other = PROFILES if mixed else PROFILES[::-1]
    changes = OTHERS[name] if mixed else ""
    declared = device(name).switches.declared()
    board = (f"{key}={getattr(one, profile)}" for key, one in declared.items() if one.hardware)
    with (
        open_device(name, profile=profile, set=changes) as same,
        open_device(name, profile=other, set=",".join(board)) as changed,
    ):
        for unit in (same, changed):
            unit.client.set_profile(profile)
            for change in filter(None, changes.split(",")):
                unit.client.set_switch(*change.split("="))
            for telecommand, parameters in MEASURE[name]:
                perform(unit, telecommand, parameters)
        assert everything(changed) == everything(same)
        chosen_at_once = same.device.switches.of(profile, changes)
        assert [unit.client.profile() for unit in (same, changed)] == 2 * [chosen_at_once]
        for expected in (True, False):  # the one under way ends as it began
            telecommand, parameters = MEASURE[name][-1]
            for unit, chosen in ((same, profile), (changed, other)):
                unit.client.client.command(telecommand, **parameters)
                unit.client.set_profile(chosen)
            found, wanted = everything(changed), everything(same)
            assert found.pop("Profile") != wanted.pop("Profile")
            assert (found == wanted) is expected


def test_loop_resets_keep_the_switches(extended: dict[str, AnyEmulated]) -> None:
    unit = extended["cubestar"]
    unit.client.set_switch("transitions", "automatic")
    perform(unit, "Trigger", {})
    unit.wait(3.5)
    assert unit.client.client.telemetry("LoopStatus")["Iterations"] >= 2
    perform(unit, "StopLoop", {})
    assert unit.client.profile().profile == "mixed"


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15)
@given(st.data())
def test_any_profile_and_switch_command_sequence_matches_a_model(
    extended: dict[str, AnyEmulated], name: str, data: st.DataObject
) -> None:
    """Compared with a model that has only the numbers of the tables."""
    node, interface = extended[name].client.client, extended[name].device.interface
    assert isinstance(node, NodeClient)
    ids = [interface.telecommand(f"Set{what}").id for what in ("Profile", "Switch")]
    fields = interface.telemetry("Profile").fields[1:]
    numbers = [[int(choice) for choice in field.choices or ()] for field in fields]
    rows = list(zip(interface.switches.declared().values(), numbers, strict=True))
    profiles = [[v[one.choices.index(getattr(one, name))] for one, v in rows] for name in PROFILES]

    def shown() -> tuple[int, list[int]]:
        profile, *values = map(int, node.telemetry("Profile").values())
        return profile, values

    _, present = shown()
    for _ in range(8):
        at = data.draw(st.integers(0, len(rows) + 1))
        value = data.draw(st.integers(0, 1 + max(max(values) for _, values in rows)))
        whole = data.draw(st.booleans())
        answer = node.request(bytes([ids[0], at] if whole else [ids[1], at, value]))
        node.wait_processed(1.0)
        if whole and at < len(PROFILES):
            wanted = profiles[at]
        elif not whole and at < len(rows) and not rows[at][0].hardware and value in rows[at][1]:
            wanted = [*present[:at], value, *present[at + 1 :]]
        else:
            wanted = None
        assert answer == bytes([3 if wanted is None else 0])
        if wanted is not None:
            pairs = zip(rows, present, wanted, strict=True)
            present = [old if one.hardware else new for (one, _), old, new in pairs]
        together = profiles.index(present) if present in profiles else len(PROFILES)
        assert shown() == (together, present)
