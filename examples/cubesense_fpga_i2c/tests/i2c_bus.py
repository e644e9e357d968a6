"""The microcontroller's end of the bus: cocotbext-i2c's master, and what it is to see.

The library drives every bit and reads every level. Two things of it are worked around: its bit
takes two periods of its ``speed``, and it sets its pins in a way that cocotb has deprecated.
"""

import random
from collections.abc import Iterable
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, ReadOnly, Timer
from cocotbext.i2c import I2cMaster
from i2c_model import FpgaModel

from cubesense_fpga_i2c.register_table import (
    ADDRESSES,
    GROUP_ADDRESS,
    Register,
    command_byte,
    pointer_bytes,
)
from cubestack.firmware_model.interface.cubesense.fpga import Actions
from cubestack.hdl.contract.bench.timing import ODD, now, wait

SPEEDS = (100_000, 400_000, 1_000_000)


class _Pin:
    """A pin that the library drives."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle

    def setimmediatevalue(self, level: bool) -> None:
        self._handle.value = int(level)

    value = property(fset=setimmediatevalue)


class I2cMcu:
    """Sends transfers and compares each acknowledge and each byte with both models.

    A transfer that is left open goes on with the next START.
    """

    def __init__(self, dut: Any, models: dict[str, FpgaModel], speed: int) -> None:
        self._dut = dut
        self._models = models
        self.set_speed(speed)
        self.free_ps = 0  # how long the bus was free between transfers
        self.falls: list[int] = []  # of SCL, in ps
        self.commands: list[tuple[int, int]] = []  # time in ps, COMMAND from then on

    def set_speed(self, speed: int) -> None:
        """Clocks a second; only while the bus is free."""
        dut = self._dut
        self.speed = speed
        self.master = I2cMaster(
            sda=dut.SDA, sda_o=_Pin(dut.SDA_I), scl=dut.SCL, scl_o=_Pin(dut.SCL), speed=2 * speed
        )
        self.master.log.setLevel("WARNING")

    def run(self) -> None:
        cocotb.start_soon(self._watch_scl())
        cocotb.start_soon(self._watch_sda())

    async def _watch_scl(self) -> None:
        while True:
            await FallingEdge(self._dut.SCL)
            self.falls.append(now())

    async def _watch_sda(self) -> None:
        """No FPGA moves SDA while SCL is high, so none makes a START or a STOP."""
        pulls = [self._dut.sun.SDA_OE, self._dut.nadir.SDA_OE]
        for pull in pulls:
            cocotb.start_soon(self._stands_while_high(pull))

    async def _stands_while_high(self, pull: Any) -> None:
        while True:
            await pull.value_change
            await ReadOnly()
            reset = not int(self._dut.RESET_N.value)
            assert reset or not int(self._dut.SCL.value), "an FPGA moved SDA while SCL was high"

    @property
    def bit_ps(self) -> int:
        return 10**12 // self.speed

    # --- transfers ------------------------------------------------------------------------------

    async def start(self, address: int, read: int = 0) -> bool:
        """START, or a repeated one, and the address byte; whether it was acknowledged."""
        if not self.master.bus_active:
            before = now()
            await wait(random.randrange(2 * self.bit_ps), ODD)
            self.free_ps += now() - before
        await self.master.send_start()
        refused = await self.master.send_byte(address << 1 | read)
        accepted = [model.start(address << 1 | read) for model in self._models.values()]
        assert refused == (not any(accepted)), f"address {address:#x}"
        return not refused

    async def send(self, byte: int) -> bool:
        """A further byte; whether it was acknowledged."""
        before = [model.command for model in self._models.values()]
        refused = await self.master.send_byte(byte)
        accepted = [model.write(byte) for model in self._models.values()]
        assert refused == (not any(accepted)), f"byte {byte:#x}"
        after = [model.command for model in self._models.values()]
        if after != before:
            self.commands.append((self.falls[-2], after[0]))
        return not refused

    async def receive(self, more: bool = True) -> int:
        """A byte, acknowledged if ``more`` are wanted."""
        wanted = 0xFF
        for model in self._models.values():
            wanted &= model.read(more)
        byte = await self.master.recv_byte(not more)
        assert byte == wanted, f"read {byte:#x}, not {wanted:#x}"
        return byte

    async def stop(self) -> None:
        await self.master.send_stop()
        for model in self._models.values():
            model.stop()

    # --- registers ------------------------------------------------------------------------------

    async def write(self, address: int, number: int, data: Iterable[int]) -> None:
        assert await self.start(address)
        for byte in (number, *data):
            assert await self.send(byte)
        await self.stop()

    async def read(self, side: str, number: int | None, count: int) -> bytes:
        """``count`` bytes from a register on, or from where the last transfer stopped."""
        if number is not None:
            assert await self.start(ADDRESSES[side])
            assert await self.send(number)
        assert await self.start(ADDRESSES[side], read=1)
        data = bytes([await self.receive(more=left > 0) for left in reversed(range(count))])
        await self.stop()
        return data

    async def command(self, actions: Actions) -> None:
        """To both FPGAs."""
        await self.write(GROUP_ADDRESS, Register.COMMAND, [command_byte(actions)])

    async def point(self, side: str, x: int, y: int, down: bool, size: Any) -> None:
        data = pointer_bytes(x, y, down=down, size=size)
        await self.write(ADDRESSES[side], Register.POINTER_HIGH, data)

    async def status(self, side: str) -> int:
        """STATUS, of which ACK is not judged here: it comes with another clock."""
        model = self._models[side]
        assert await self.start(ADDRESSES[side])
        assert await self.send(Register.STATUS)
        assert await self.start(ADDRESSES[side], read=1)
        model.ack = 0
        wanted = model.read(more=False)
        status = int(await self.master.recv_byte(1))
        assert status & ~1 == wanted
        await self.stop()
        return status

    async def clock(self, count: int) -> None:
        """SCL alone, SDA released: what frees a bus that a target holds."""
        self._dut.SDA_I.value = 1
        for _ in range(count):
            self._dut.SCL.value = 0
            await Timer(self.bit_ps // 2, unit="step")
            self._dut.SCL.value = 1
            await Timer(self.bit_ps // 2, unit="step")
