"""Every block of code in README.md and docs/: it is parsed, and what can be run alone is run.

What is not run is named here, with the reason. `SLOW` are those that take more than some seconds.
"""

import argparse
import ast
import re
import shlex
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import cubestack
from cubestack.host.cli.main import make_parser
from cubestack.host.emulation.emulated import open_device
from tests.conftest import Run
from tests.system.conftest import ROOT, Served
from tests.together import together

from .blocks import BLOCKS, LEFT, LONG, SERVES, Code, lines_of, own_call, reader_files, words_of

LANGUAGES = {"c", "sh", "python", "toml", "yaml", "text", "csv"}
#: Dialogues and register accesses of the protocol pages, whose own tests run them.
LANGUAGES |= {"wire", "wire-sky", "registers", "py"}


def of(language: str) -> list[Any]:
    found = [one for one in BLOCKS if one.language == language]
    return [pytest.param(one, id=f"{one.document}-{n}") for n, one in enumerate(found)]


def commands() -> Iterator[tuple[str, list[str]]]:
    """Document and words of each shell command, without its environment."""
    for block in BLOCKS:
        if block.language == "sh":
            for line in lines_of(block.text):
                for part in re.split(r";(?=\s*printf|\s*head)", line):
                    if words := words_of(part):
                        yield block.document, words


def own() -> Iterator[tuple[str, str]]:
    """Document and line of each `cubestack` command."""
    for document, words in commands():
        if (call := own_call(words)) is not None:
            yield document, call


OWN = sorted(set(own()))

#: Programs that are not this project's, and what the documents do with them.
OTHERS = {"pip", "python", "python3", "pytest", "curl", "dask", "echo", "exec", "printf", "head"}
OTHERS |= {"", "cd", "cp", "gdb-multiarch", "openFPGALoader"}  # the first one is `.`
OTHERS |= {"cc", "arm-none-eabi-gcc", "sed", "build_blackfin.sh", "build_pic18.sh"}

#: Commands that are parsed and not run here, and why.
NOT_HERE = LEFT | {
    SERVES: "serves until Ctrl-C",
    LONG: "minutes to hours",
    "^run --attach": "the bus of the command above it: tests/system/documents/pasted.py",
    "^emulate efm32gg": "firmware that its page builds: test_bare_part.py",
    "--image out/": "a picture of make run: tests/system/documents/pasted.py",
}

#: Commands that take a moment; all others that are run are slow.
QUICK = r"^registers|^export|^catalogue|^picture|--list$|^shell|^decode|^replay|^log .*--each"

RECORDED = "run.rec"


def test_every_block_has_a_language() -> None:
    assert len(BLOCKS) > 100
    assert len(OWN) > 60
    assert {one.language for one in BLOCKS} <= LANGUAGES


@together("block", of("python"))
def test_python_blocks_compile(block: Code) -> None:
    text = block.text.replace("test_...(cubestar)", "test_any(cubestar)")
    compile(text, block.document, "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)


@together("block", of("toml"))
def test_toml_blocks_parse(block: Code) -> None:
    assert tomllib.loads(block.text)


@pytest.mark.parametrize("block", of("yaml"))
def test_yaml_blocks_parse(block: Code) -> None:
    assert yaml.safe_load(block.text)


@together("block", of("sh"))
def test_documented_shell_blocks_parse(block: Code) -> None:
    done = subprocess.run(["bash", "-n"], input=block.text, text=True, capture_output=True)
    assert done.stderr == ""


def test_other_programs_and_their_files_exist() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for document, words in commands():
        program = Path(words[0]).name
        if program == "make":
            named = {word for word in words[1:] if "=" not in word}
            assert named <= targets, f"{document}: {words}"
        elif program != "cubestack":
            assert program in OTHERS, f"{document}: {words}"
            for word in words[1:]:
                if word.startswith(("examples/", "tests/")):
                    assert (ROOT / word).exists(), f"{document}: {word}"


@pytest.fixture(scope="module")
def parser() -> argparse.ArgumentParser:
    return make_parser()


# Glow is a device of the text: tests/examples/test_adding_a_sensor.py.
@together(("document", "line"), [one for one in OWN if not re.search(r"\bglow\b", one[1])])
def test_documented_commands_parse(
    document: str, line: str, folder: Path, parser: argparse.ArgumentParser
) -> None:
    try:
        parser.parse_args(shlex.split(line))
    except SystemExit as end:
        pytest.fail(f"{document}: {line} ends with {end}")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the documents name."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for name, text in reader_files().items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def runnable() -> list[Any]:
    found = [one for one in OWN if not any(re.search(left, one[1]) for left in NOT_HERE)]
    return [
        pytest.param(*one, marks=() if re.search(QUICK, one[1]) else pytest.mark.slow)
        for one in found
    ]


def test_every_exclusion_matches_a_documented_command() -> None:
    for left in NOT_HERE:
        assert any(re.search(left, line) for _, line in OWN), left
    assert len(runnable()) > 30


@pytest.mark.filterwarnings("default::cubestack.emulator.boards.gateware.GatewareNotice")
@pytest.mark.parametrize(("document", "line"), runnable())
def test_documented_commands_run(document: str, line: str, folder: Path, run: Run) -> None:
    words = shlex.split(line)
    if words[:2] == ["run", "--"] and shutil.which(words[2]) is None:
        pytest.skip(f"no {words[2]}")
    if "--record" in words:
        words += ["-c", "read Power"]  # in place of the reader's typing
    elif RECORDED in words:
        (made,) = (
            shlex.split(one) for at, one in OWN if f"--record {RECORDED}" in one and at == document
        )
        assert run(*made, "-c", "read Power").code == 0
    outcome = run(*words)
    assert outcome.code == 0, f"{document}: {outcome.err}"


def python_of(document: str, first: str) -> str:
    (text,) = (
        one.text
        for one in BLOCKS
        if (one.document, one.language) == (document, "python") and one.text.startswith(first)
    )
    return text


def test_readme_script_prints_the_attitude_and_stars(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = "emulate cubestar --pty ./ttyCUBESTAR"
    assert ("README.md", line) in OWN
    with Served(shlex.split(line)[1:], folder):
        exec(python_of("README.md", "import cubestack"), {})
    first, *stars = capsys.readouterr().out.splitlines()
    assert "valid=True" in first
    identified = [star.split()[0] for star in stars if not star.startswith("None")]
    assert len(identified) >= 4
    assert all(number.isdigit() for number in identified)


def test_documented_scene_example_runs(folder: Path) -> None:
    names: dict[str, Any] = {}
    exec(python_of("scenes.md", "import cubestack"), names)
    assert names["camera"].condition.temperature_c != -10  # the file's, which does not say it


def test_documented_profile_examples_run() -> None:
    chosen = "cubestack.open_device("
    opened = eval(python_of("profiles.md", chosen), {"cubestack": cubestack})
    with opened:
        assert opened.client.profile().profile == "mixed"
        exec(python_of("profiles.md", "opened.client"), {"opened": opened})
        assert opened.client.profile().profile == "mixed"


def test_documented_fault_example_runs() -> None:
    with open_device("cubesense") as device:
        exec(python_of("faults.md", "fault = "), {"board": device.board})
        device.wait(6)
        device.client.client.command("CaptureOnly", Camera=1, Sram=1, Location=0)
        device.wait(1)
        assert any("pixel-hot" in str(event) for event in device.faults.log)


@pytest.mark.slow
def test_documented_hard_skies_example_runs() -> None:
    names: dict[str, Any] = {"cubestack": cubestack}
    exec(python_of("hard-skies.md", "frames = "), names)
    assert len(names["frames"]) == 20
