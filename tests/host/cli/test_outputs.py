"""Every option that names a file to write: nothing is replaced unasked, or by a failing start."""

import ast
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

import cubestack.host
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.output import Outputs

from ...conftest import Run
from ...tiers import quick
from .failing_starts import digests, existing, outputs
from .wrong_inputs import all_arguments

LEFT = {
    "hdl prove --out": "a folder of generated names",
    "hdl test --waves": "a folder of generated names",
    "hdl board icebreaker --out": "a folder of a build",
    "hdl board ulx3s --out": "a folder of a build",
    "hdl board ulx3s-12f --out": "a folder of a build",
    "demo --out": "a folder that each run fills again",
    "hazards --out": "rewrites tables of a page",
    "compare --out": "rewrites tables of a page",
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


OPTIONS = {
    f"{' '.join(one.command)} {one.name}": getattr(one.action, "inside", None)
    for one in all_arguments()
    if one.action.option_strings
}
OUTPUTS = [(" ".join(one.command), one.name, inside) for one, inside in outputs()]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "noise").write_bytes(bytes(range(256)))
    return tmp_path


def test_every_option_that_writes_is_declared_as_one() -> None:
    plain = {option for option, inside in OPTIONS.items() if inside is None}
    named = {one for one in plain if WRITING & {*one.rsplit(" ", 1)[1].strip("-").split("-")}}
    assert named == set(LEFT)


def failing(count: int) -> str:
    call = [sys.executable, "-m", "tests.host.cli.failing_starts", str(count)]
    return subprocess.run(call, capture_output=True, text=True, timeout=1500).stdout


@pytest.mark.slow
def test_failing_starts_of_each_command_change_no_output() -> None:
    assert failing(5) == ""


@pytest.mark.parametrize(
    ("words", "option", "inside"),
    OUTPUTS,
    ids=[f"{words} {option}" for words, option, _ in OUTPUTS],
)
def test_existing_file_is_not_replaced_without_force(
    run: Run, folder: Path, words: str, option: str, inside: str
) -> None:
    named, place = existing(folder, inside)
    before = digests(folder)
    needed = [word.format(folder=folder) for word in NEEDED.get(words, ())]
    outcome = run(*words.split(), *needed, option, named)
    assert outcome.code == 2
    assert f"{option}: {place} exists; choose another, or replace it with --force" in outcome.line
    assert digests(folder) == before


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
    before = digests(folder)
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
    assert digests(folder) == before  # and no file more


FIRST = ("-c", "read Identification")


@pytest.mark.parametrize(
    ("words", "commands"),
    [
        ("shell", ("-c", "reed Identification")),
        ("shell", ("-c", "read None")),
        ("log", ("-c", "reed Identification")),
        ("log", ("--each", "write None")),
        ("log", (*FIRST, "--each", "write None")),
    ],
)
def test_recording_is_replaced_only_after_a_right_command(
    run: Run, folder: Path, words: str, commands: tuple[str, ...]
) -> None:
    named, _ = existing(folder, "")
    before = digests(folder)
    call = (words, *NEEDED[words], "--record", named, "--force")
    assert run(*call, *commands).code == 2
    assert digests(folder) == before
    more = ("--count", "1") if words == "log" else ()
    assert run(*call, *FIRST, *more).code in (0, 1)
    assert load_recording(named).events


def test_recording_of_a_session_that_fails_later_is_kept(run: Run, folder: Path) -> None:
    named, _ = existing(folder, "")
    call = ("shell", *NEEDED["shell"], "--record", named, "--force", *FIRST)
    assert run(*call, "-c", "reed None").code == 2
    assert load_recording(named).events


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
    "ground/emulators.py": "a temporary folder",
    "ground/traces.py": "a temporary folder",
    "ground/relays.py": "a temporary folder",
    "emulation/history.py": "a temporary folder",
    "recording/setups.py": "a temporary folder",
    "studies/copies.py": "a pipe",
    "studies/campaign/folder.py": "a campaign's folder, which locks and renames itself",
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


@pytest.mark.slow
def test_picture_renews_only_what_it_has_rendered(run: Run, tmp_path: Path) -> None:
    out, words = tmp_path / "p.png", ("--ra", "84", "--dec", "-1")
    assert run("picture", "aramis", *words, "--out", str(out)).code == 0
    first = out.read_bytes()
    assert run("picture", "aramis", *words, "--roll", "90", "--out", str(out)).code == 0
    assert out.read_bytes() != first
    Image.open(out).save(out, "png")  # by another program
    assert "exists; choose another" in run("picture", "aramis", *words, "--out", str(out)).err
