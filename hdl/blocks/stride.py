"""What a design does, clock after clock, while nothing but a counter and a byte change.

An engine makes many such clocks at once (docs/engines.md). That the design does just this, from
every state with these levels, is proved: :mod:`cubestack.hdl.proofs.strides`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Stride:
    """Clocks that store a byte each, or read one: the n-th at the n-th of consecutive addresses.

    At each rising edge ``counter`` counts up by one and ``data`` takes what stands on ``source``.
    No other register changes and, where no other input does, no other output but those that show
    the two. The lower bits of the memory's address are ``counter``; the upper ones stay.

    - Storing, ``data`` is on the memory's data lines and is written while the clock is low.
    - Reading, the memory offers the byte at its address, on ``source``, all the time.

    Attributes:
        name: unique in the design; small letters and dashes.
        clock: the pin.
        levels: of input pins.
        state: of registers, by their paths in the design.
        counter: register; the above is true while it is below ``last``.
        last: highest value of the counter.
        data: register of 8 bits.
        source: input pin of 8 bits.
        memory: what its pins' names begin with.
        stores: whether it stores, else it reads.
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
