"""Waveforms of failed tests and refuted proofs: finding one, showing it in a viewer or as text.

A VCD file has a JSON file about it beside it; the failure is where the waveform ends.
"""

import os
import shutil
import subprocess
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from vcd.reader import TokenKind, VCDParseError, tokenize

from cubestack.firmware_model.formats.untrusted import LARGEST_FILE, opened, read_json

#: Programs that show a waveform, the first one installed is taken.
VIEWERS = ("gtkwave", "surfer")

#: Seconds in a VCD file's units of time.
_PS = {"s": 10**12, "ms": 10**9, "us": 10**6, "ns": 10**3, "ps": 1}

CHANGES = (TokenKind.CHANGE_SCALAR, TokenKind.CHANGE_VECTOR, TokenKind.CHANGE_STRING)


class Trace(NamedTuple):
    """The end of a waveform."""

    signals: list[str]  #: all names
    levels: dict[str, str]  #: of each in the end
    #: time in ps and changes, of the last times at which something changed
    moments: list[tuple[int, dict[str, str]]]


def find(folders: Sequence[Path], name: str) -> Path:
    """The waveform of a test: a file, or the one in a folder whose name or test has ``name``.

    FileNotFoundError when there is none, ValueError when there are several.
    """
    if name.endswith(".vcd"):
        if not Path(name).is_file():
            raise FileNotFoundError(f"there is no waveform {name}")
        return Path(name)
    kept = [path for folder in folders for path in sorted(folder.glob("*.vcd"))]
    found = [path for path in kept if name in path.name or name in _about(path).get("test", "")]
    if not found:
        there = ", ".join(path.stem for path in kept) or "none: no test failed there"
        where = " and ".join(map(str, folders))
        raise FileNotFoundError(f"{where} has no waveform of {name!r}; there are {there}")
    exact = found if len(found) == 1 else [path for path in found if path.stem == name]
    if len(exact) != 1:
        raise ValueError(f"{name!r} fits {', '.join(path.stem for path in found)}; say which")
    return exact[0]


def show(path: Path, count: int, internal: bool, text: bool) -> Iterator[str]:
    """Open ``path`` in a viewer if there is a screen and one is installed; else lines of text."""
    about = _about(path)
    if about:
        yield about["title"]
        yield f"failed: {about['error'].strip() or 'without a word'}"
    viewer = next(filter(None, map(shutil.which, VIEWERS)), None)
    screen = "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    if viewer and screen and not text:
        yield f"{path}: opened in {Path(viewer).name}"
        subprocess.run([viewer, str(path)], check=True)
        return
    trace = read(path, count, internal)
    yield f"{path}; {' and '.join(VIEWERS)} open it"
    yield from _lines(trace)


def read(path: Path, count: int = 20, internal: bool = False) -> Trace:
    """The last ``count`` moments of a VCD file; signals inside of the design if ``internal``.

    Else pins only, which have the names in capitals. ValueError when it is none.
    """
    names: dict[str, list[str]] = {}
    scopes: list[str] = []
    levels: dict[str, str] = {}
    moments: deque[tuple[int, dict[str, str]]] = deque(maxlen=count)
    changes: dict[str, str] = {}
    unit, time = 1, 0
    try:
        with opened(path, LARGEST_FILE) as stream:
            for token in tokenize(stream):
                if token.kind is TokenKind.SCOPE:
                    scopes.append(token.scope.ident)
                elif token.kind is TokenKind.UPSCOPE:
                    scopes.pop()
                elif token.kind is TokenKind.TIMESCALE:
                    unit = token.timescale.magnitude.value * _PS.get(token.timescale.unit.value, 1)
                elif token.kind is TokenKind.VAR:
                    name = ".".join([*scopes[1:], token.var.reference])
                    pin = len(scopes) == 1 and name == name.upper() and "$" not in name
                    if (internal or pin) and token.var.type_.value != "parameter":
                        names.setdefault(token.var.id_code, []).append(name)
                elif token.kind is TokenKind.CHANGE_TIME:
                    time, changes = token.time_change * unit, {}
                elif token.kind in CHANGES:
                    change: Any = token.data
                    if not changes and change.id_code in names:
                        moments.append((time, changes))
                    value = change.value  # a number, a text, or binary with unknown bits
                    for name in names.get(change.id_code, ()):
                        levels[name] = f"{value:x}" if isinstance(value, int) else value
                        changes[name] = levels[name]
    except (VCDParseError, UnicodeDecodeError, IndexError) as error:
        raise ValueError(f"{path} is no VCD file: {error}") from None
    signals = [name for group in names.values() for name in group]
    return Trace(signals, levels, list(moments))


def _lines(trace: Trace) -> Iterator[str]:
    yield f"last {len(trace.moments)} times at which a pin changed, in ns:"
    for time, changes in trace.moments:
        yield f"{time / 1000:14.3f}  {'  '.join(f'{n}={v}' for n, v in sorted(changes.items()))}"
    yield "levels in the end (hexadecimal):"
    width = max(map(len, trace.signals), default=0)
    for name in sorted(trace.signals):
        yield f"  {name:<{width}}  {trace.levels.get(name, 'x')}"


def _about(path: Path) -> dict[str, str]:
    """What the test wrote about it; nothing for a file from elsewhere."""
    try:
        about = read_json(path.with_suffix(".json"))
    except (OSError, ValueError):
        return {}
    return {str(key): str(value) for key, value in about.items()}
