"""Files and messages of others are read by the functions of ``formats.untrusted`` only."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("hdl", "firmware_model", "emulator", "host")

GATE = "firmware_model/formats/untrusted.py"

#: Functions that read a file or parse a message, by the last parts of their names.
READERS = (
    *("json.load", "json.loads", "tomllib.load", "tomllib.loads", "Image.open", "literal_eval"),
    *("loadtxt", "genfromtxt", "fromfile", "memmap", "mmap.mmap", "np.load", "pickle.load"),
    *("pickle.loads", "receive_json", "safe_load", "tarfile.open", "ZipFile", "ElementTree.parse"),
)

#: One of these is in every module with such a call.
MARKS = (*(one.rpartition(".")[2] for one in READERS), "open", "read_text", "read_bytes")

#: Modules that read what is not from outside, and what that is.
OWN = {
    GATE: "this is the gate",
    "emulator/boards/aramis/catalogue.py": "our sources, and our database in the cache folder",
    "emulator/boards/aramis/memories.py": "a file without a name that it has written",
    "emulator/boards/cubestar/compiled/build.py": "our sources",
    "emulator/boards/gateware.py": "our result in the cache folder",
    "emulator/i2cdev/preload/shim.py": "our sources, and the head of a program that the user runs",
    "emulator/i2cdev/seccomp/supervisor.py": "/proc, and a file in memory",
    "emulator/iss/benchmark.py": "a program that it has compiled",
    "emulator/native/cache.py": "our sources, and libraries whose hash it checks",
    "emulator/ports/pseudo_terminal.py": "a terminal that it has made",
    "emulator/rtl/capture/read_csv.py": "lines of a file that the gate has opened",
    "emulator/rtl/cxxrtl/build.py": "headers of a package",
    "emulator/scene/hipparcos.py": "a package's file whose hash it checks",
    "emulator/scene/picture.py": "bytes that the gate has read; any error of Pillow is caught",
    "firmware_model/mcu/compiled.py": "our package",
    "firmware_model/mcu/cortex_m3.py": "our package",
    "firmware_model/reference/image.py": "our package",
    "host/api/sensor.py": "our sources",
    "host/cli/new_sensor.py": "our package",
    "host/clients/diagnosis.py": "/proc",
    "host/ground/control_api.py": "our recording",
    "host/ground/relays.py": "a recording that was read when it was opened",
    "host/ground/traces.py": "our recording, and the waveform of our process",
    "host/native/wheels.py": "what it has built",
    "host/output.py": "files that it writes; it reads none",
    "host/studies/copies.py": "a copy of this process, through a pipe",
    "host/studies/compare/page.py": "our documents",
    "host/studies/costs.py": "our documents",
    "host/studies/cubestar/demo.py": "our package",
    "host/studies/fidelity/command.py": "our documents",
    "host/studies/fidelity/recorded.py": "our documents",
    "host/studies/fidelity/text.py": "our documents",
    "host/studies/fidelity/table.py": "our package",
    "host/studies/hazards/command.py": "our documents",
    "host/studies/lens_errors.py": "our documents",
    "host/studies/rows/record.py": "our documents",
    "host/studies/rows/sources.py": "our sources",
}

#: Tools of designs read the user's own sources, and what Yosys and simulators have written.
OWN_FOLDERS = ("hdl/",)


def calls(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of each call that may read a file or parse a message."""
    text = path.read_text(encoding="utf-8")
    if not any(one in text for one in MARKS):
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and _reads(node):
            yield node.lineno, ast.unparse(node.func)


def _reads(call: ast.Call) -> bool:
    """Methods of ours such as ``line.open(baud)`` do not; those of a path take constants."""
    name = ast.unparse(call.func)
    owner, _, short = name.rpartition(".")
    if any(name == one or name.endswith(f".{one}") for one in READERS):
        return True
    given = [*call.args, *(key.value for key in call.keywords)]
    texts = [one.value for one in given if isinstance(one, ast.Constant)]
    if short in ("read_text", "read_bytes"):
        return bool(owner) and len(texts) == len(given)
    if short != "open" or any(text in ("w", "wb", "a", "x") for text in texts):
        return False
    return (
        owner in ("", "os") or owner.endswith("path") or any(text in ("r", "rb") for text in texts)
    )


def test_no_reader_goes_past_the_gate() -> None:
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if name not in OWN and not name.startswith(OWN_FOLDERS):
                found |= {f"{name}:{line}": call for line, call in calls(path)}
    assert not found


def test_exceptions_are_needed() -> None:
    for name in set(OWN) - {GATE}:
        path = ROOT / name
        if path.exists():
            assert list(calls(path)), f"{name} reads nothing"


@pytest.mark.parametrize(
    "text",
    [
        "open('data')",
        "open('data', 'rb')",
        "path.open(encoding='utf-8')",
        "json.loads(t)",
        "Path(p).read_bytes()",
        "tomllib.load(f)",
        "Image.open(f)",
        "np.loadtxt(f)",
    ],
)
def test_readers_are_found(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.py").write_text(f"value = {text}\n")
    assert list(calls(tmp_path / "x.py"))


@pytest.mark.parametrize("text", ["path.open('w')", "device.open(3)", "read_json(path)"])
def test_other_calls_are_not(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.py").write_text(f"value = {text}\n")
    assert not list(calls(tmp_path / "x.py"))


def test_python_processes_import_nothing_from_the_current_folder() -> None:
    """A call of the interpreter goes on with -P, or with -I, which includes it."""
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            if "sys.executable" not in text:
                continue
            for node in ast.walk(ast.parse(text)):
                if not isinstance(node, ast.List | ast.Tuple):
                    continue
                texts = [ast.unparse(one) for one in node.elts]
                if "sys.executable" in texts:
                    after = texts[texts.index("sys.executable") + 1 :][:1]
                    assert after in (["'-P'"], ["'-I'"]), f"{path}:{node.lineno}"
