"""How long the compiled engine's first builds take."""

import tempfile
import time
from pathlib import Path

from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.wiring import Wiring

ROUNDS = 5
"""Times that a figure is measured; the best one counts: the others were disturbed."""


def cold_build_s(wiring: Wiring) -> float:
    """Wall time from a design to its shared library, with nothing in the cache."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        library_for(wiring, Path(folder))
        return time.perf_counter() - start
