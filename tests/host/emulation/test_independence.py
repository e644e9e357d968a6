"""Devices of one process share nothing that one of them can change."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.host.devices.registry import BUILT_IN
from cubestack.host.emulation.emulated import open_device


def memories(emulated: Any) -> dict[str, NDArray[np.uint8]]:
    board = emulated.board
    fpga = {} if board.engine is None else board.engine.memories
    return {**board.sites().memories, **fpga}


def messages(emulated: Any) -> list[dict[str, Any]]:
    """Answers to the first requests after power-up."""
    client = emulated.client.client
    return [client.telemetry(one.name) for one in client.interface.telemetries[:4]]


@pytest.mark.parametrize("name", BUILT_IN)
def test_change_of_one_device_reaches_no_other(name: str) -> None:
    with open_device(name) as first, open_device(name) as second:
        wanted = {place: memory.copy() for place, memory in memories(first).items()}
        assert sum(memory.size for memory in wanted.values()) > 100_000
        for memory in memories(first).values():
            memory ^= 0xFF
        first.wait(0.2)
        answers = []
        for other in (second, open_device(name)):
            with other:
                for place, memory in memories(other).items():
                    np.testing.assert_array_equal(memory, wanted[place])
                answers.append(messages(other))
        assert answers[0] == answers[1]


def test_shared_light_can_not_be_written() -> None:
    with open_device("cubesense") as first, open_device("cubesense") as second:
        light, other = (
            next(iter(one.board.cameras.values()))._light_at(0) for one in (first, second)
        )
        assert light is other
        assert not light.flags.writeable
