"""What a device requires of a design for its FPGA: tests, properties, clocks of its inputs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

from amaranth.hdl import Module

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.contract.points import Group

QUICK, FULL = "quick", "full"
TIERS = (QUICK, FULL)  #: The second one has all tests of the first one


class Size(NamedTuple):
    """Of an image, in pixels."""

    columns: int
    rows: int

    def __str__(self) -> str:
        return f"{self.columns} x {self.rows}"


@dataclass(frozen=True)
class Check:
    """A cocotb test; its function has the same name in ``module``."""

    requirement: str  #: one sentence
    module: str
    tier: str = QUICK
    whole_frames: bool = True  #: too slow in Python for an image of full size
    #: Verilog around the design, whose top module has the file's name; for the full size only
    harness: Path | None = None


@dataclass(frozen=True)
class Property:
    """A requirement that a proof decides; ``harness`` as in ``hdl.proofs.prover.Proof``."""

    requirement: str  #: one sentence
    harness: Callable[[Module, SimpleNamespace], None]
    steps: int = 40  #: most steps of the proof; a clock takes two


@dataclass(frozen=True)
class Contract:
    """Of one design; a device whose FPGAs have several designs has a contract for each."""

    title: str  #: of the design
    pins: Callable[[Size], tuple[Pin, ...]]  #: the pin table for an image of this size
    shipped: Callable[[Size], PinnedComponent]  #: our design
    full: Size
    small: Mapping[str, tuple[Size, ...]]  #: sizes by tier of designs that have parameters for it
    proof: Size  #: of proofs, for such a design
    parameters: Callable[[Size], Mapping[str, int]]  #: those parameters
    checks: Mapping[str, Check] = field(default_factory=dict)  #: by name
    points: Mapping[str, Group] = field(default_factory=dict)  #: functional coverage by group
    properties: Mapping[str, Property] = field(default_factory=dict)  #: by name
    #: clocks that an input may be used with directly, and why; other inputs need a synchroniser.
    #: Empty for a model of several FPGAs, whose crossings mean nothing
    inputs: Mapping[str, tuple[tuple[str, ...], str]] = field(default_factory=dict)
    #: clocks whose registers any other clock may sample, and why
    stable: Mapping[str, str] = field(default_factory=dict)
    #: crossings of the shipped design: names of a register's source and of the register, and why
    allowed: Mapping[tuple[str, str], str] = field(default_factory=dict)
