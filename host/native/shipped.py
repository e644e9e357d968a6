"""Libraries that the shipped devices need, with every choice that they have.

``python -m cubestack.host.native.shipped`` compiles those of each device with its defaults that the
cache folder lacks; with ``all``, those of every choice.
"""

import os
import sys
import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from typing import Any

from cubestack.emulator.native.cache import (
    Recipe,
    cache_folder,
    collected,
    library_of,
    ready_library,
)
from cubestack.emulator.native.compiler import NoCompilerError, find_compiler
from cubestack.host.devices.registry import BUILT_IN
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import open_device
from cubestack.host.terminal import progress, say

Choice = tuple[str, dict[str, Any]]
"""Name of a device, and options of ``open_device``."""


def choices() -> Iterator[Choice]:
    """Every device with its defaults, and with each of its options alone."""
    for device in map(registered, BUILT_IN):
        yield device.name, {}
        for option in device.all_options:
            values = option.choices or (() if option.metavar else (True,))
            yield from ((device.name, {option.name: value}) for value in values)
            if option.name == "firmware":
                yield device.name, {"firmware": "reference"}


def recipes(opened: Iterable[Choice]) -> list[Recipe]:
    """The libraries that these devices need, each once.

    Those that this process has loaded already may be missing.
    """
    found: dict[bytes, Recipe] = {}
    for name, options in opened:
        with collected() as wanted, suppress(NoCompilerError), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the slow simulator
            with suppress(ValueError), open_device(name, **options):  # some need another option
                pass
        found |= {one.inputs: one for one in wanted}
    return list(found.values())


def compile_missing(wanted: Iterable[Recipe]) -> None:
    """Compile what is neither shipped nor in the cache folder, on all cores, with progress.

    Nothing happens without a compiler. Errors as ``library_of``.
    """
    compiler = find_compiler()
    missing = [one for one in wanted if ready_library(one) is None]
    if compiler is None or not missing:
        return
    threads = min(len(missing), os.cpu_count() or 1)
    about_s = compiler.build_s(len(missing)) / threads
    say(
        f"compiling FPGA designs and simulators with {compiler.name}, once, into {cache_folder()}: "
        f"{len(missing)} in about {about_s:.0f} s"
    )
    with ThreadPoolExecutor(threads) as pool:
        jobs = [pool.submit(library_of, one) for one in missing]
        for job in progress(as_completed(jobs), len(jobs), "compiled"):
            job.result()


if __name__ == "__main__":
    compile_missing(recipes(choices() if "all" in sys.argv else ((n, {}) for n in BUILT_IN)))
