"""Every message of every device is used from the page, plug-in devices included."""

import os
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any, NamedTuple

import pytest

from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.conformance.contract import values_to_try
from cubestack.host.devices.registry import BUILT_IN, device
from tests.examples.conftest import ROOT, installed

from ..browser import shown, station

pytestmark = [pytest.mark.xdist_group("page messages"), pytest.mark.slow]

PLUGGED_IN = {"sunslit": ROOT / "examples" / "linear_sun_sensor"}

STREAMS = "StreamDownImage"  # answered by a picture, which the page downloads in another way
NONE = "\N{EN DASH}"  # shown for a missing value

ENDED = "#lines li.good, #lines li.bad"


class Opened(NamedTuple):
    page: Any
    interface: Interface


@pytest.fixture(scope="module", params=[*PLUGGED_IN, *BUILT_IN])
def opened(
    request: pytest.FixtureRequest, chromium: Any, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Opened]:
    name = request.param
    project = PLUGGED_IN.get(name)
    site = tmp_path_factory.mktemp("site")
    with nullcontext() if project is None else installed(project, site) as distribution:
        environment = dict(os.environ) if distribution is None else distribution.environment
        with (
            station(f"emulated:{name}", "--seed", "5", environment=environment) as address,
            shown(chromium, address) as page,
        ):
            page.select_option("#speed", "fast")
            page.wait_for_selector("#lines li.good >> text=pace")
            yield Opened(page, device(name).interface)


def fill(page: Any, message: Message, values: Any) -> None:
    for field in message.fields:
        control = page.locator(f"#commands form [name='{field.name}']")
        value = values[field.name]
        if field.choices is not None:
            control.select_option(field.choices(int(value)).name)
        elif field.type == "bool1":
            control.select_option(str(bool(value)).lower())
        else:
            control.fill(value.hex() if isinstance(value, bytes) else str(value))


def sent(page: Any, message: Message, values: Any) -> str:
    """Send a telecommand by its form; returns its entry in the log."""
    page.select_option("#command", message.name)
    fill(page, message, values)
    before = page.locator(ENDED).count()
    page.click("#send")
    if message.risk:
        page.click("#confirm")
    page.wait_for_function(
        f"(before) => document.querySelectorAll('{ENDED}').length > before", arg=before
    )
    return str(page.locator("#lines li").first.inner_text())


def test_every_telecommand_is_sent_from_its_form(opened: Opened) -> None:
    """With the last of the values that are allowed in the present state."""
    page, interface = opened
    offered = page.locator("#command option").all_inner_texts()
    known = [one for one in interface.telecommands if one.supported]
    risky = [one.name for one in known if one.risk]
    assert offered == [one.name for one in known if not one.risk] + risky
    for message in (one for one in known if one.name != STREAMS):
        for values in reversed([*values_to_try(message)]):
            told = sent(page, message, values)
            assert all(f"{name}='" in told for name in values)
            if f"{message.name}: done" in told:
                break
            assert f"telecommand {message.name} refused: " in told
        else:
            pytest.fail(told)
    if STREAMS in offered:
        told = sent(page, interface.telecommand(STREAMS), {})
        assert "has 128 bytes" in told  # of an image, which comes without a request
        page.wait_for_function(
            "() => document.querySelector('#state').textContent.startsWith('waiting for the host')"
        )


def test_every_telemetry_frame_is_shown(opened: Opened) -> None:
    page, interface = opened
    known = [one for one in interface.telemetries if one.supported]
    assert page.locator("#frame option").all_inner_texts() == [one.name for one in known]
    for message in known:
        page.select_option("#frame", message.name)
        assert page.locator("#telemetry td.value").count() == len(message.fields)
        page.wait_for_function(
            "(none) => [...document.querySelectorAll('#telemetry td.value')]"
            ".every((one) => one.textContent !== none)",
            arg=NONE,
        )
