"""Oracle: OpenC3's own parser, packets and interfaces, as COSMOS runs them."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.conformance.contract import values_to_try
from cubestack.host.devices.registry import device, device_names
from cubestack.host.emulation.process import emulating
from cubestack.host.export.answers import ACKNOWLEDGE_ID, answers, requested
from tests.examples.conftest import ROOT, installed
from tests.host.export.cosmos.oracle import NEEDS_OPENC3, ask, write_plugin
from tests.host.export.frames import COUNTS, frames, parameters, same

pytestmark = NEEDS_OPENC3

EXAMPLE = "sunslit"


class Plugin(NamedTuple):
    interface: Interface
    folder: Path
    environment: dict[str, str]

    def ask(self, work: str, questions: Any = None) -> Any:
        return ask(work, self.interface, self.folder, questions)


@pytest.fixture(scope="module", params=[*device_names(), EXAMPLE])
def plugin(request: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plugin]:
    """The plug-in of a device, also of one of another distribution."""
    folder = tmp_path_factory.mktemp(request.param)
    project, site = ROOT / "examples" / "linear_sun_sensor", tmp_path_factory.mktemp("site")
    with installed(project, site) as distribution:
        interface = device(request.param).interface
        write_plugin(interface, folder, serial_device=str(folder / "tty"))
        yield Plugin(interface, folder, distribution.environment)


def test_parser_has_no_warnings(plugin: Plugin) -> None:
    found = plugin.ask("parse")
    assert found["warnings"] == []
    assert found["unique"] == [{}, {}]  # one look-up identifies a packet
    telemetry = {message.name.upper() for message in requested(plugin.interface)}
    commands = {message.name.upper() for message in plugin.interface.telecommands}
    assert set(found["telemetry"]) == {"ACKNOWLEDGE", *telemetry}
    assert set(found["commands"]) == commands | {f"REQUEST_{name}" for name in telemetry}


@COUNTS
def test_commands_equal_our_codec(plugin: Plugin, count: int) -> None:
    telecommands = plugin.interface.telecommands
    sets = [(one, values) for one in telecommands for values in parameters(one, count)]
    asked = [(one.name.upper(), _json(values)) for one, values in sets]
    theirs = plugin.ask("pack", asked)
    for (message, values), data in zip(sets, theirs, strict=True):
        assert data == (bytes([message.id]) + message.pack(**values)).hex(), (message.name, values)


def test_defaults_are_the_reset_values(plugin: Plugin) -> None:
    telecommands = plugin.interface.telecommands
    theirs = plugin.ask("pack", [(one.name.upper(), {}) for one in telecommands])
    for message, data in zip(telecommands, theirs, strict=True):
        assert data == (bytes([message.id]) + message.pack(**message.reset_values())).hex()


@COUNTS
def test_packets_are_told_apart_and_decode_as_ours(plugin: Plugin, count: int) -> None:
    told = [(one, *frame) for one in answers(plugin.interface) for frame in frames(one, count)]
    theirs = plugin.ask("unpack", [(bytes([one.id]) + data).hex() for one, data, _ in told])
    for (message, _, values), found in zip(told, theirs, strict=True):
        _check(message, found, values)


@pytest.mark.slow
def test_interface_reads_all_telemetry_and_sends_all_telecommands(plugin: Plugin) -> None:
    interface = plugin.interface
    # A stream last: its frames come as they are ready.
    telecommands = sorted(interface.telecommands, key=lambda one: one.name.startswith("Stream"))
    requests = [(f"REQUEST_{one.name.upper()}", [{}]) for one in requested(interface)]
    commands = [
        (one.name.upper(), [_json(values) for values in (*parameters(one, 1), *values_to_try(one))])
        for one in telecommands
    ]
    words = [interface.name.lower(), "--pty", str(plugin.folder / "tty"), "--pace", "fast"]
    with emulating(words, {**os.environ, **plugin.environment}) as said:
        assert any(" serves on " in line for line in said)
        found = plugin.ask("talk", requests + commands)
    for message, answer in zip(requested(interface), found["answers"], strict=False):
        assert answer is not None, message.name
        _check(message, answer, message.unpack(bytes.fromhex(answer["data"])[1:]))
    for message, answer in zip(telecommands, found["answers"][len(requests) :], strict=True):
        assert answer is not None, message.name
        assert bytes.fromhex(answer["data"]) == bytes([ACKNOWLEDGE_ID, message.id, 0])
    assert all(one["name"] == "IMAGEBLOCK" for one in found["stream"])
    assert len(found["stream"]) == 20 * telecommands[-1].name.startswith("Stream")


@pytest.mark.slow
def test_tcp_interface_reads_from_a_port(tmp_path: Path) -> None:
    interface = device("cubesense").interface
    with emulating(["cubesense", "--tcp", "0", "--pace", "fast"]) as said:
        port = next(
            found[1]
            for line in said
            if (found := re.search(r"serves on tcp://127.0.0.1:(\d+)", line))
        )
        write_plugin(interface, tmp_path, host="127.0.0.1", port=port)
        asked = [["REQUEST_IDENTIFICATION", [{}]], ["AUTOADJUST1", [{"ENABLED": 1}]]]
        read, sent = ask("talk", interface, tmp_path, asked)["answers"]
    assert (read["name"], read["values"]["NODETYPE"]) == ("IDENTIFICATION", interface.node_type)
    assert sent["values"] == {"PACKET_ID": 0, "TELECOMMAND": "AUTOADJUST1", "ERROR": "OK"}


def _json(values: dict[str, Any]) -> dict[str, Any]:
    """Parameters with COSMOS's names, bytes as digits."""
    return {
        name.upper(): value.hex() if isinstance(value, bytes) else value
        for name, value in values.items()
    }


def _check(message: Message, found: Any, values: dict[str, Any]) -> None:
    assert found["name"] == message.name.upper()
    for field in message.fields:
        name, ours = field.name.upper(), values[field.name]
        theirs, raw = found["values"][name], found["raw"][name]
        if isinstance(ours, bytes):
            theirs = bytes.fromhex(theirs)
        elif field.choices is not None:
            named = {int(one): one.name for one in field.choices}
            assert theirs == named.get(int(ours), ours)
            theirs = raw
        elif field.flag:
            assert theirs == ("TRUE" if ours else "FALSE")
            theirs = raw
        assert same(field, theirs, ours), (message.name, field.name)
        if (state := found["limits"].get(name)) is not None:
            assert (state == "GREEN") == _allowed(field, ours), (message.name, field.name, ours)


def _allowed(field: Field, value: Any) -> bool:
    if field.flag:
        return not value
    if field.choices is not None:
        return value == 0
    return field.allows(value, {})
