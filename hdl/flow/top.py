"""What the flow is given: a sensor's table of tops with their clocks, and of blocks, by name."""

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
    """A design of whole FPGAs.

    Attributes:
        make: its component, at full size.
        summary: what it is, in one line.
        clocks: inputs that clock flip-flops, unrelated to each other.
        parts: AGLN030s that it fills; more than one for a model of several chips.
        pulled_up: pins that need a pull-up.
        reset: what makes the registers' state.
        fits: whether the part has room for it, by the estimate of tiles.
    """

    make: Callable[[], PinnedComponent]
    summary: str
    clocks: tuple[Clock, ...]
    parts: int = 1
    pulled_up: tuple[str, ...] = ()
    reset: str = "standby"
    fits: bool = True


@dataclass(frozen=True)
class Block:
    """A part of a top, or an alternative to one, whose area is worth knowing.

    Attributes:
        make: its component, at full size.
    """

    make: Callable[[], Component]


#: Tops and blocks by the names that the command line uses.
TopTable = Mapping[str, Top | Block]


def tops_in(table: TopTable) -> dict[str, Top]:
    """Those that are whole FPGAs."""
    return {name: top for name, top in table.items() if isinstance(top, Top)}


def counted(table: TopTable) -> dict[str, Top | Block]:
    """Those whose tiles are counted: each top that is one FPGA, then each block."""
    tops = {name: top for name, top in tops_in(table).items() if top.parts == 1}
    return {**tops, **{name: top for name, top in table.items() if isinstance(top, Block)}}
