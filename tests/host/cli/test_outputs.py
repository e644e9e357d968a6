"""Every option that names a file to write: nothing is replaced unasked, or by a failing start."""

import argparse
import ast
import hashlib
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

import cubestack.host
from cubestack.host.cli.main import make_parser
from cubestack.host.output import Outputs

from ...conftest import Run
from ...tiers import quick

LEFT = {
    "hdl prove --out": "a folder of generated names",
    "hdl test --waves": "a folder of generated names",
    "hdl board icebreaker --out": "a folder of a build",
    "hdl board ulx3s --out": "a folder of a build",
    "hdl board ulx3s-12f --out": "a folder of a build",
    "demo --out": "a folder that each run fills again",
    "hazards --out": "rewrites tables of a page",
    "campaign --out": "refuses a folder with a campaign itself",
    "new-sensor --out": "refuses a folder that exists",
    "fidelity --write": "rewrites tables of pages",
    "costs --write": "rewrites a page and its data",
    "conformance --allow-write": "writes to the device",
    "replay --trace-from": "a time",
    "replay --trace-to": "a time",
}
"""Options whose names are those of outputs, but which name no file to write."""

WRITING = {"out", "output", "record", "trace", "junit", "waves", "write"}

DEVICE = ("cubestar",)
NEEDED = {
    "emulate": DEVICE,
    "shell": ("emulated:cubestar",),
    "conformance": ("emulated:cubestar",),
    "log": ("emulated:cubestar",),
    "ground": ("/dev/ttyNONE", "--device", "cubestar"),
    "export": (*DEVICE, "--format", "c"),
    "picture": (*DEVICE, "--ra", "1", "--dec", "2"),
    "replay": ("{folder}/none.rec",),
    "decode": ("{folder}/none.rec",),
    "hdl verilog": DEVICE,
    "hdl test": ("{folder}/none.v", "--device", *DEVICE),
    "hdl compare": ("{folder}/none.vcd", "--device", *DEVICE),
    "hdl board check": ("/dev/ttyNONE", "--device", *DEVICE),
    "powerfail": ("reference", "--scenario", "{folder}/none.toml"),
    "catalogue": ("cubestar", "--pair-limit", "42.1"),
}
"""Arguments that a command needs."""

BAD_OPTIONS = (
    ("--frobnicate",),
    ("--seed", "-1"),
    ("--scene", "{folder}/none.toml"),
    ("--scene", "{folder}"),
    ("--scene", "{folder}/noise"),
    ("--firmware", "{folder}/none.elf"),
    ("--firmware", "{folder}/noise"),
    ("--gateware", "{folder}/none.v"),
    ("--profile", "none"),
    ("--set", "none=1"),
    ("--engine", "none"),
    ("--engine", "board:/dev/ttyNONE"),
)
AT_START = (
    *BAD_OPTIONS,
    ("--faults", "{folder}/none.toml"),
    ("--faults", "{folder}/noise"),
    ("--orbit", "{folder}/noise"),
    ("--pty", "{folder}/noise"),
    ("--pty", "{folder}/none/tty"),
    ("--tcp", "{port}"),
    ("--rfc2217", "{port}"),
    ("--control", "{port}"),
    ("--gdb", "0"),
    ("--tcp", "0", "--listen", "192.0.2.1", "--allow-remote"),
    ("--trace", "{folder}/none/x.vcd"),
    ("--record", "{folder}/none/x.rec"),
)
FAILING = {
    "emulate": AT_START,
    "shell": (*BAD_OPTIONS, ("--script", "{folder}/none")),
    "conformance": BAD_OPTIONS,
    "log": BAD_OPTIONS,
    "measure cubestar": BAD_OPTIONS,
}
"""Beside --force, by command; each fails."""


def parsers(
    parser: argparse.ArgumentParser, words: str = ""
) -> Iterator[tuple[str, argparse.Action]]:
    """Each option of each command."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, one in action.choices.items():
                yield from parsers(one, f"{words} {name}".strip())
        elif action.option_strings:
            yield words, action


OPTIONS = dict.fromkeys(
    (f"{words} {action.option_strings[0]}", getattr(action, "inside", None))
    for words, action in parsers(make_parser())
)
OUTPUTS = [(*option.rsplit(" ", 1), inside) for option, inside in OPTIONS if inside is not None]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "noise").write_bytes(bytes(range(256)))
    return tmp_path


def existing(folder: Path, inside: str) -> tuple[Path, Path]:
    """What the option names, and the file that is there."""
    named = folder / ("kept" if inside else "kept.png")
    place = named / inside if inside else named
    place.parent.mkdir(exist_ok=True)
    place.write_bytes(b"precious\n" * 1000)
    return named, place


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_every_option_that_writes_is_declared_as_one() -> None:
    plain = {option for option, inside in OPTIONS if inside is None}
    named = {one for one in plain if WRITING & {*one.rsplit(" ", 1)[1].strip("-").split("-")}}
    assert named == set(LEFT)


@pytest.mark.parametrize(
    ("words", "option", "inside"),
    OUTPUTS,
    ids=[f"{words} {option}" for words, option, _ in OUTPUTS],
)
def test_existing_file_is_not_replaced_without_force(
    run: Run, folder: Path, words: str, option: str, inside: str
) -> None:
    named, place = existing(folder, inside)
    before = digest(place)
    needed = [word.format(folder=folder) for word in NEEDED.get(words, ())]
    outcome = run(*words.split(), *needed, option, named)
    assert outcome.code == 2
    assert f"{option}: {place} exists; choose another, or replace it with --force" in outcome.line
    assert digest(place) == before


@pytest.mark.parametrize(
    ("words", "wrong"),
    quick(((words, wrong) for words, each in FAILING.items() for wrong in each), 16),
)
def test_failing_start_changes_no_file(
    run: Run, folder: Path, words: str, wrong: tuple[str, ...]
) -> None:
    mine = [(option, inside) for command, option, inside in OUTPUTS if command == words]
    kept = {}
    for option, inside in mine:
        if option not in wrong:
            sub = folder / option.strip("-")
            sub.mkdir()
            kept[option] = existing(sub, inside)
    before = {place: digest(place) for _, place in kept.values()}
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        options = [word.format(folder=folder, port=port) for word in wrong]
        outcome = run(
            *words.split(),
            *NEEDED.get(words, ()),
            *(word for option, (named, _) in kept.items() for word in (option, named)),
            "--force",
            *options,
        )
    assert outcome.code != 0
    assert {place: digest(place) for place in before} == before
    for place in before:
        assert [one.name for one in place.parent.iterdir()] == [place.name]


@pytest.mark.parametrize("words", ["emulate", "shell", "log", "conformance"])
def test_second_writer_and_early_interrupt_change_no_file(
    run: Run, folder: Path, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    named, place = existing(folder, "")
    call = (*words.split(), *NEEDED[words], "--record", named, "--force")
    with Outputs() as outputs:
        outputs.create(named).write("theirs")
        outcome = run(*call)
        assert (outcome.code, f"can not write {named}: it is being" in outcome.err) == (2, True)
    assert place.read_text() == "theirs"

    def interrupt(*_args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cubestack.emulator.recording.recorder.Recorder.listen", interrupt)
    assert run(*call).code == 130
    assert place.read_text() == "theirs"


WRITERS = {
    "cli/new_sensor.py": "a new folder",
    "cli/export.py": "a new folder",
    "cli/hdl/board_check.py": "a file in a folder that the check declares",
    "ground/emulators.py": "a temporary folder",
    "ground/traces.py": "a temporary folder",
    "ground/relays.py": "a temporary folder",
    "emulation/history.py": "a temporary folder",
    "recording/setups.py": "a temporary folder",
    "studies/copies.py": "a pipe",
    "studies/demo.py": "the folder of a demonstration",
    "studies/campaign/folder.py": "a campaign's folder, which locks and renames itself",
    "studies/campaign/report.py": "a campaign's folder",
    "studies/powerfail/report.py": "a folder whose option is declared",
    "studies/costs.py": "rewrites a page and its data",
    "studies/hazards/command.py": "rewrites a page",
    "studies/fidelity/command.py": "rewrites a page",
    "studies/cubestar/reference_catalogue.py": "sources of the reference firmware",
    "native/wheels.py": "wheels of a release",
}
"""Modules that write otherwise, and what they write."""


def test_no_other_module_writes_files() -> None:
    root = Path(cubestack.host.__file__).parent
    found = {
        str(path.relative_to(root))
        for path in root.rglob("*.py")
        if any(map(_writes, ast.walk(ast.parse(path.read_text("utf-8")))))
    }
    assert found == set(WRITERS)


def _writes(node: ast.AST) -> bool:
    if not isinstance(node, ast.Call):
        return False
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    modes = [one.value for one in node.args if isinstance(one, ast.Constant)]
    opens = name == "open" and any(isinstance(one, str) and set(one) & set("wxa") for one in modes)
    return name in ("write_text", "write_bytes") or opens


def test_picture_renews_only_what_it_has_rendered(run: Run, tmp_path: Path) -> None:
    out, words = tmp_path / "p.png", ("--ra", "84", "--dec", "-1")
    assert run("picture", "aramis", *words, "--out", str(out)).code == 0
    first = out.read_bytes()
    assert run("picture", "aramis", *words, "--roll", "90", "--out", str(out)).code == 0
    assert out.read_bytes() != first
    Image.open(out).save(out, "png")  # by another program
    assert "exists; choose another" in run("picture", "aramis", *words, "--out", str(out)).err
