"""Sequences of clocks in which only a counter and a data byte of a design change.

An engine runs such clocks in one operation (docs/engines.md). :mod:`cubestack.hdl.proofs.strides`
proves that the design behaves so from every state with these levels.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Stride:
    """Clocks that each store or read a byte: the n-th clock at the n-th of consecutive addresses.

    At each rising edge ``counter`` increments and ``data`` takes the value of ``source``. No other
    register changes. While no other input changes, the only outputs that change are those that show
    ``counter`` and ``data``. The low bits of the memory address are ``counter``; the high bits
    stay.

    - When storing, ``data`` is on the memory's data lines and is written while the clock is low.
    - When reading, the memory presents the byte at its address on ``source`` all the time.

    Attributes:
        name: unique in the design; lower-case letters and dashes.
        clock: the clock pin.
        levels: required levels of input pins.
        state: required values of registers, by their paths in the design.
        counter: register; the stride lasts while it is below ``last``.
        last: highest value of the counter.
        data: register of 8 bits.
        source: input pin of 8 bits.
        memory: prefix of the memory's pin names.
        stores: True if the stride stores bytes, False if it reads them.
    """

    name: str
    clock: str
    levels: tuple[tuple[str, int], ...]
    state: tuple[tuple[str, int], ...]
    counter: str
    last: int
    data: str
    source: str
    memory: str
    stores: bool
