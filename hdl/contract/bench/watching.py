"""Checks that run in the background of a test, whenever a point in time has settled."""

import random
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import cocotb
from cocotb.triggers import ReadOnly

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import ODD, now, wait

Levels = list[tuple[int, int]]  #: (time in ps, level) whenever a pin has changed


async def watch(signal: Any, seen: Levels) -> None:
    """Note the time and level whenever a signal has settled at another one."""
    while True:
        await signal.value_change
        await ReadOnly()
        if int(signal.value) != seen[-1][1]:
            seen.append((now(), int(signal.value)))


async def never_high(signal: Any, error: str, unless: Callable[[], bool] = lambda: False) -> None:
    """AssertionError with ``error`` when a signal has settled high, unless that is all right."""
    while True:
        await signal.value_change
        await ReadOnly()
        assert not int(signal.value) or unless(), error


async def stays_in_the_picture(address: Any) -> None:
    """No address of an SRAM outside of the picture, whether something is stored or not."""
    columns = 1 << (GEOMETRY.columns - 1).bit_length()
    while True:
        await address.value_change
        await ReadOnly()
        row, column = divmod(int(address.value) % GEOMETRY.bank_size, columns)
        assert column < GEOMETRY.columns, f"column {column} is addressed"
        assert row < GEOMETRY.rows, f"row {row} is addressed"


async def _stands_still(name: str, signal: Any) -> None:
    await signal.value_change
    raise AssertionError(f"{name} moved in standby")


async def disturb_in_standby(
    dut: Any, outputs: Iterable[str], inputs: Sequence[str], moments: Sequence[int], times: int
) -> None:
    """Drive random levels on the ``inputs`` repeatedly: no output may move, not even for a glitch.

    Each comes at most one of the ``moments`` (ps) after the one before.
    """
    watches = [cocotb.start_soon(_stands_still(name, pin(dut, name))) for name in outputs]
    for _ in range(times):
        await wait(random.randint(1, random.choice(moments)), ODD)
        port = pin(dut, random.choice(inputs))
        port.value = random.getrandbits(len(port))
    for task in watches:
        task.cancel()


def pin(dut: Any, path: str) -> Any:
    for name in path.split("."):
        dut = getattr(dut, name)
    return dut


def levels(dut: Any, names: Iterable[str]) -> dict[str, int]:
    return {name: int(pin(dut, name).value) for name in names}
