"""Creates the engine of a wiring: the compiled one, or the reference without a compiler."""

import warnings
from typing import TypeAlias

from cubestack.emulator.native.compiler import NoCompilerError
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.devboard.address import FORM, PREFIX, parse_address

EngineKind: TypeAlias = str
"""See ``make_engine``."""

KINDS = ("auto", "compiled", "exact", "python")


def make_engine(
    wiring: Wiring,
    kind: EngineKind = "auto",
    sram_timing: SramTiming | None = None,
    *,
    skipping: bool = True,
) -> RtlEngine:
    """Create an engine.

    Args:
        wiring: the design with its surroundings.
        kind: "compiled", "exact" (compiled, runs every clock), "python" (the Amaranth simulator),
            "auto": compiled if there is a C++ compiler, else the simulator with a warning; or the
            address of a development board that runs the design, see
            ``firmware_model.interface.devboard.address``.
        sram_timing: limits that the SRAM model checks.
        skipping: skip pixel clocks that provably change nothing.

    Raises:
        CompilerError: "compiled" or "exact" without a C++ compiler, or the compiler failed.
        DevboardError: the board can not be used.
        ValueError: another kind.
    """
    if kind.startswith(PREFIX):
        from cubestack.emulator.rtl.devboard.board import open_board

        return open_board(wiring, parse_address(kind), sram_timing, skipping=skipping)
    if kind not in KINDS:
        raise ValueError(f"{kind!r} is no engine; choose from {', '.join(KINDS)}, {FORM}")
    if kind == "python":
        return SimulatedEngine(wiring, sram_timing, skipping=skipping)
    try:
        return CompiledEngine(wiring, sram_timing, skipping=skipping and kind != "exact")
    except NoCompilerError as error:
        if kind != "auto":
            raise
        warnings.warn(
            f"{error}; using the Amaranth simulator, about a thousand times slower", stacklevel=2
        )
        return SimulatedEngine(wiring, sram_timing, skipping=skipping)
