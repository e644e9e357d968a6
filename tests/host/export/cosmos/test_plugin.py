from pathlib import Path

import pytest

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.export.answers import answers
from cubestack.host.export.cosmos.plugin import cosmos_plugin
from tests.conftest import Run
from tests.host.export.cosmos.oracle import render
from tests.host.export.cosmos.test_packets import parse
from tests.host.export.frames import EACH

LAYOUTS = {"SCROLLWINDOW", "MATRIXBYCOLUMNS", "VERTICALBOX"}
"""Widgets of COSMOS's screens that END closes."""


@EACH
@pytest.mark.parametrize(
    ("variables", "connection"),
    [
        ({"host": "ground", "port": "7"}, "tcpip_client_interface.py ground 7 7 10.0 nil"),
        (
            {"serial_device": "/dev/tty"},
            "serial_interface.py /dev/tty /dev/tty {baud} NONE 1 10.0 nil",
        ),
    ],
)
def test_variables_choose_the_connection(
    interface: Interface, variables: dict[str, str], connection: str
) -> None:
    files = cosmos_plugin(interface)
    upper, lower = interface.name.upper(), interface.name.lower()
    text = render(files["plugin.txt"], interface, **variables, target_name="OTHER")
    lines = [line.strip() for line in text.splitlines() if line and line[0] not in "#V"]
    assert lines == [
        f"TARGET {upper} OTHER",
        f"INTERFACE OTHER_INT openc3/interfaces/{connection.format(baud=interface.baud)}",
        "MAP_TARGET OTHER",
        f"PROTOCOL READ_WRITE {lower}_protocol.py",
    ]
    assert f"targets/{upper}/lib/{lower}_protocol.py" in files


@EACH
def test_screen_names_items_and_commands_that_exist(interface: Interface) -> None:
    upper = interface.name.upper()
    files = {path.removeprefix(f"targets/{upper}/"): text for path, text in _files(interface)}
    packets = parse(files["cmd_tlm/cmd.txt"] + files["cmd_tlm/tlm.txt"])
    screen, title, *widgets = files[f"screens/{upper.lower()}.txt"].splitlines()
    assert (screen, title) == ("SCREEN AUTO AUTO 1.0", f'TITLE "{interface.name}"')
    depth, shown = 0, set()
    for widget, *words in map(str.split, widgets):
        depth += (widget in LAYOUTS) - (widget == "END")
        if widget == "BUTTON":
            assert ("COMMAND", words[-1].removesuffix("\")'")) in packets
        elif widget == "LABELVALUE":
            target, packet, item, *_ = words
            assert target == upper
            assert packets["TELEMETRY", packet][item].kind != "BLOCK"
            shown.add((packet, item))
        else:
            assert widget in {*LAYOUTS, "END"}
    assert depth == 0
    assert shown == {
        (message.name.upper(), field.name.upper())
        for message in answers(interface)
        for field in message.fields
        if not field.type.startswith("bytes")
    }


def _files(interface: Interface) -> list[tuple[str, str]]:
    found = cosmos_plugin(interface).items()
    return [(path, render(text, interface) if "<%" in text else text) for path, text in found]


def test_command_writes_the_folder(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "plugin"
    command = ("export", "cubesense", "--format", "cosmos-plugin")
    assert run(*command).line.endswith("cosmos-plugin is a folder; name one with --out")
    assert run(*command, "--out", folder) == (0, "", "")
    target = folder / "targets" / "CUBESENSE"
    assert {str(path.relative_to(target)) for path in target.rglob("*.*")} == {
        *("target.txt", "cmd_tlm/cmd.txt", "cmd_tlm/tlm.txt"),
        *("lib/cubesense_protocol.py", "screens/cubesense.txt"),
    }
    again = run(*command, "--out", folder)
    assert again.line.endswith(f"{folder} exists; remove it, or choose another folder with --out")
    assert (folder / "plugin.txt").exists()
