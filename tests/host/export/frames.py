"""Random frames of every interface, decoded by this project's codec."""

import math
import random
import struct
from collections.abc import Iterator
from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.host.devices.registry import devices
from tests.tiers import quick

INTERFACES = [device.interface for device in devices()]

EACH = pytest.mark.parametrize("interface", INTERFACES, ids=lambda interface: interface.name)

COUNTS = pytest.mark.parametrize("count", quick([10, 1000], 1))


def messages(interface: Interface, kind: MessageKind) -> list[Message]:
    return [message for message in interface.messages if message.kind is kind]


def frames(message: Message, count: int) -> Iterator[tuple[bytes, dict[str, Any]]]:
    """Random frames and their values; named numbers have valid names."""
    rng = random.Random(message.id)
    for _ in range(count):
        data = bytearray(rng.randbytes(message.length))
        for field in message.fields:
            at = field.bit_offset // 8
            if field.choices is not None:
                data[at] = int(rng.choice(list(field.choices)))
            if field.type == "f32":  # not-a-numbers are not equal to themselves
                data[at : at + 4] = struct.pack("<f", rng.uniform(-1e6, 1e6))
        yield bytes(data), message.unpack(bytes(data))


def same(field: Field, theirs: Any, ours: Any) -> bool:
    """Equal, for scaled counts within the rounding of one multiplication."""
    if field.scale != 1:
        return theirs == pytest.approx(ours, rel=1e-15)
    return bool(theirs == ours)


def parameters(message: Message, count: int) -> Iterator[dict[str, Any]]:
    """Random parameters that the node accepts, scaled ones not rounded to counts."""
    rng = random.Random(message.id)
    found = 0
    while found < count:
        values = {field.name: _parameter(field, rng) for field in message.fields}
        for field in message.fields:
            if field.choices_by is not None:
                other, choices = field.choices_by
                values[field.name] = int(rng.choice(list(choices[int(values[other])])))
        if not message.violations(message.unpack(message.pack(**values))):
            found += 1
            yield values


def _parameter(field: Field, rng: random.Random) -> Any:
    if field.type.startswith("bytes"):
        return rng.randbytes(field.bits // 8)
    if field.choices is not None:
        return int(rng.choice(list(field.choices)))
    if field.also is not None and rng.random() < 0.1:
        return field.also
    least, largest = (-1e6, 1e6) if field.type == "f32" else field.raw_range
    low, high = (
        other / field.scale if end is None else end
        for end, other in zip(field.ends, (least, largest), strict=True)
    )
    if field.type == "f32" or field.scale != 1:
        return rng.uniform(low, high)
    return rng.randint(math.ceil(low), math.floor(high))
