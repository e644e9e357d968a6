"""A workload's sample as a cocotb test; runs inside of the simulator.

Reads ``sample.npz`` in the folder of ``$CUBESTACK_SAMPLE`` and writes ``result.npz`` there:
the seconds of processor time that driving the pins took, and every memory.
"""

import json
import os
import time
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge, ReadOnly, Timer
from numpy.typing import NDArray


@cocotb.test()
async def sample(dut: Any) -> None:
    """Drives the pins of the cameras for a number of lines."""
    folder = Path(os.environ["CUBESTACK_SAMPLE"])
    given = np.load(folder / "sample.npz")
    setup = json.loads(str(given["setup"]))
    for name, level in setup["initial"].items():
        getattr(dut, name).value = level
    await Timer(1, "ns")
    for name, level in setup["levels"]:
        getattr(dut, name).value = level
        await Timer(1, "ns")
    memories = {
        name: np.zeros(1 << len(getattr(dut, pins["A"])), np.uint8)
        for name, pins in setup["memories"].items()
    }
    for name, pins in setup["memories"].items():
        cocotb.start_soon(_memory(dut, pins, memories[name]))
    start = time.process_time()
    tasks = [
        cocotb.start_soon(_camera(dut, camera, given[camera["name"]], setup))
        for camera in setup["cameras"]
    ]
    for task in tasks:
        await task
    seconds = time.process_time() - start
    arrays: dict[str, Any] = {"seconds": np.array(seconds), **memories}
    np.savez(folder / "result.npz", **arrays)


async def _memory(dut: Any, pins: dict[str, str], memory: NDArray[np.uint8]) -> None:
    """Writes at the start of the pulse; all its pins are stable until the end."""
    address, data, write_n = (getattr(dut, pins[pin]) for pin in ("A", "D_O", "WE_N"))
    while True:
        await FallingEdge(write_n)
        await ReadOnly()
        memory[address.value.to_unsigned()] = data.value.to_unsigned()


async def _camera(
    dut: Any, pins: dict[str, str | None], image: NDArray[np.uint8], setup: dict[str, Any]
) -> None:
    clock, data, line = (getattr(dut, str(pins[pin])) for pin in ("clock", "data", "line"))
    if pins["frame"] is not None:
        getattr(dut, pins["frame"]).value = 1
    half_ps = setup["half_ps"]
    columns = len(image[0])
    for count in range(setup["clocks"]):
        row, column = divmod(count - setup["blank_clocks"], setup["line_clocks"])
        inside = row >= 0 and column < columns
        line.value = int(inside)
        if inside:
            data.value = int(image[row, column])
        await Timer(half_ps, "ps")
        clock.value = 1
        await Timer(half_ps, "ps")
        clock.value = 0
    await Timer(half_ps, "ps")
