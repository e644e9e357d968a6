"""Input of the flow: a sensor's table of tops with their clocks, and of blocks, by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from amaranth.lib.wiring import Component

from cubestack.hdl.blocks.pinned import PinnedComponent


class Clock(NamedTuple):
    """An input that clocks flip-flops; shortest period in ns."""

    port: str
    period_ns: float
    source: str


@dataclass(frozen=True)
class Top:
    """A design of whole FPGAs."""

    make: Callable[[], PinnedComponent]  #: creates its component, at full size
    summary: str  #: one line
    clocks: tuple[Clock, ...]  #: inputs that clock flip-flops, unrelated to each other
    parts: int = 1  #: number of AGLN030s; more than one for a model of several chips
    pulled_up: tuple[str, ...] = ()  #: pins that need a pull-up
    reset: str = "standby"  #: what puts the registers into a defined state
    fits: bool = True  #: whether the estimated tiles fit into the part


@dataclass(frozen=True)
class Block:
    """A part of a top, or an alternative to one, whose area is reported."""

    make: Callable[[], Component]  #: creates its component, at full size


#: Tops and blocks by their names on the command line.
TopTable = Mapping[str, Top | Block]


def tops_in(table: TopTable) -> dict[str, Top]:
    return {name: top for name, top in table.items() if isinstance(top, Top)}


def designs_with_area(table: TopTable) -> dict[str, Top | Block]:
    """The designs whose tiles are counted: each top that is one FPGA, then each block."""
    tops = {name: top for name, top in tops_in(table).items() if top.parts == 1}
    return {**tops, **{name: top for name, top in table.items() if isinstance(top, Block)}}
