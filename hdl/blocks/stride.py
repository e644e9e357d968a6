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
    """

    name: str  #: unique in the design; lower-case letters and dashes
    clock: str  #: the clock pin
    levels: tuple[tuple[str, int], ...]  #: required levels of input pins
    #: required values of registers, by their paths in the design
    state: tuple[tuple[str, int], ...]
    counter: str  #: register; the stride lasts while it is below ``last``
    last: int  #: highest value of the counter
    data: str  #: register of 8 bits
    source: str  #: input pin of 8 bits
    memory: str  #: prefix of the memory's pin names
    stores: bool  #: True if the stride stores bytes, False if it reads them
