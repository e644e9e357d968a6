"""The tutorial's files, taken out of the text, are a device; so the document is enough."""

import ast
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import cubestack as library

from .conftest import ROOT, Installed, installed

DOCUMENT = ROOT / "docs" / "adding-a-sensor.md"
Command = Callable[..., str]

#: A file's name in bold, and its text in the block below.
FILE = re.compile(r"^\*\*`([\w./]+)`\*\*\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module", autouse=True)
def glow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installed]:
    project = tmp_path_factory.mktemp("glow_sensor")
    for name, text in FILE.findall(DOCUMENT.read_text(encoding="utf-8")):
        path = project / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    with installed(project, tmp_path_factory.mktemp("site")) as distribution:
        yield distribution


def test_its_files_are_those_that_the_text_lists(glow: Installed) -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    (listed,) = re.findall(r"^  glow/(.*)$", text, re.MULTILINE)
    assert {path.name for path in (glow.paths[-1] / "glow").glob("*.py")} == set(listed.split())


def test_firmware_and_tables_see_no_emulator(glow: Installed) -> None:
    for name, allowed in (("interface", "firmware_model.interface"), ("program", "firmware_model")):
        tree = ast.parse((glow.paths[-1] / "glow" / f"{name}.py").read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("cubestack"):
                assert str(node.module).startswith(f"cubestack.{allowed}.")


def test_registers_and_conformance(cubestack: Command) -> None:
    assert "## Telemetry 140: Light" in cubestack("registers", "glow", "--format", "markdown")
    said = cubestack("conformance", "emulated:glow", "--allow-write")
    assert re.search(r"emulated:glow: \d\d passed, 0 failed, 0 skipped", said)


def test_measure(cubestack: Command, tmp_path: Path) -> None:
    assert "largest error" in cubestack("measure", "glow", "--frames", "3")
    (tmp_path / "dim.toml").write_text('kind = "light"\nlux = 800\n')
    results = list(library.measure("glow", scene=tmp_path / "dim.toml", seed=2))
    assert results[0].as_dict() == {"measured_lux": pytest.approx(800, abs=80), "truth_lux": 800.0}


def test_shell(cubestack: Command) -> None:
    script = "write Measure; time 0.1; read Light; power photodiode off; fault uart-drop rate=0.1"
    said = cubestack("shell", "emulated:glow", "-c", script)
    assert re.search(r"Count +1", said)


def test_what_it_can_not_have_is_told() -> None:
    with pytest.raises(ValueError, match="Glow has no FPGA; omit engine 'python'"):
        library.open_device("glow", engine="python")
    with (
        library.open_device("glow") as opened,
        pytest.raises(TypeError, match="a scene of Glow is a LightScene, not 3"),
    ):
        opened.scene = 3


def test_it_shares_a_bus_with_another_device() -> None:
    with (
        library.open_device("aramis") as aramis,
        library.open_device("glow", beside=aramis) as opened,
    ):
        bus = aramis.smbus()
        assert bus.read_byte_data(0x29, 128) == 41
        assert bus.read_byte_data(0x1D, 128) == 6
        assert opened.client.illuminance() == pytest.approx(20_000, abs=80)


def test_a_new_interpreter_finds_it(glow: Installed) -> None:
    script = (
        "import sys; from cubestack.host.devices.registry import device;"
        "print(device('glow').title);"
        "print([m for m in sys.modules if m.startswith('cubestack.emulator')])"
    )
    done = glow.run(sys.executable, "-c", script)
    assert done.stdout.split() == ["Glow", "[]"], done.stderr
