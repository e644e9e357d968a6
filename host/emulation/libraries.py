"""Makes the libraries that come along anew: of every shipped device, with every choice it has.

``python -m cubestack.host.emulation.libraries`` needs ``cubestack[compiler]``, which builds
for every machine, and writes below ``emulator/native``. A test says when that is due.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from cubestack.emulator.native.cache import Wanted, noted
from cubestack.emulator.native.compiler import Compiler
from cubestack.emulator.native.ready_made import FOLDER, TARGETS, keep
from cubestack.host.devices.registry import BUILT_IN
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import open_device


def choices() -> Iterator[tuple[str, dict[str, Any]]]:
    """Every device as it comes, and with each of its options alone."""
    for device in map(registered, BUILT_IN):
        yield device.name, {}
        for option in device.all_options:
            values = option.choices or (() if option.metavar else (True,))
            yield from ((device.name, {option.name: value}) for value in values)
            if option.name == "firmware":
                yield device.name, {"firmware": "reference"}


def needed() -> list[Wanted]:
    """The libraries that the devices ask for, each once."""
    with noted() as wanted:
        for name, options in choices():
            with suppress(ValueError), open_device(name, **options):  # some make no sense alone
                pass
    return list({one.inputs: one for one in wanted}.values())


def make(wanted: Iterable[Wanted], folder: Path, tell: Callable[[str], None]) -> None:
    """Build all for all machines into ``folder``, and remove what else is there."""
    folder.mkdir(exist_ok=True)
    with ThreadPoolExecutor() as threads:
        jobs = [(machine, one) for one in wanted for machine in TARGETS]
        made = set()
        for path in threads.map(partial(_make, folder), jobs):
            tell(f"{path.name}: {path.stat().st_size} bytes")
            made.add(path)
    for old in set(folder.iterdir()) - made:
        old.unlink()


def _make(folder: Path, job: tuple[str, Wanted]) -> Path:
    machine, wanted = job
    target = (sys.executable, "-m", "ziglang", "c++", "-target", TARGETS[machine], "-s")
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch) / "log"
        library = wanted.build(Compiler(target, machine), Path(scratch), log)
        return keep(machine, wanted.inputs, library.read_bytes(), folder)


def main() -> None:
    make(needed(), FOLDER, print)


if __name__ == "__main__":
    main()
