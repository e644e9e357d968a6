"""A message as a stream of bits, most significant first, as other formats need it."""

from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message


def slots(message: Message) -> Iterator[tuple[Field | None, int]]:
    """Fields and their bits, in the stream's order; None for unused bits.

    Flags, which are numbered from a byte's lowest bit, come highest first.
    """
    whole = {one.bit_offset // 8: one for one in message.fields if one.type != "bool1"}
    flags = {one.bit_offset: one for one in message.fields if one.type == "bool1"}
    at, unused = 0, 0
    while at < message.length:
        if at in whole:
            found: list[Field | None] = [whole[at]]
        else:
            found = [flags.get(8 * at + bit) for bit in range(7, -1, -1)]
        for one in found:
            if one is None:
                unused += 1
                continue
            if unused:
                yield None, unused
            unused = 0
            yield one, one.bits
        at += whole[at].bits // 8 if at in whole else 1
    if unused:
        yield None, unused
