"""Settings of the simulation that imports this, from its environment."""

import json
import os
import random
from typing import Any

from cocotb.triggers import Timer

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut

READ_OUT = ReadOut(**json.loads(os.environ["READ_OUT"]))

#: Whether the design has address control from the microcontroller.
MCU_ADDRESSING = os.environ.get("MCU_ADDRESSING") == "1"


async def some_time() -> None:
    await Timer(random.randint(1, 50), unit="ns")


async def clock(dut: Any, domain: str, reset: int = 0, **pins: int) -> None:
    """Drive ``pins``, then one rising edge of the domain's clock; falls at the next call."""
    getattr(dut, f"{domain}_clk").value = 0
    getattr(dut, f"{domain}_rst").value = reset
    for name, level in pins.items():
        getattr(dut, name).value = level
    await some_time()
    getattr(dut, f"{domain}_clk").value = 1
    await some_time()
