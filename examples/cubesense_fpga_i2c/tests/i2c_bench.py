"""Bench of the pair on its bus: two cameras, two SRAMs, the master, and the scoreboard."""

import random
from functools import partial
from types import SimpleNamespace
from typing import Any

import cocotb
from cocotb.triggers import Timer
from i2c_bus import SPEEDS, I2cMcu
from i2c_model import FpgaModel

from cubesense_fpga_i2c.register_table import RESET_COMMAND, Register, StatusBits, command_of
from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS, Action, Actions
from cubestack.hdl.contract.bench.camera import Camera
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.sram import UNKNOWN, Sram
from cubestack.hdl.contract.bench.timing import ODD, now, wait
from cubestack.hdl.contract.bench.watching import Levels, levels, never_high, watch
from tests.hdl.cubesense.pair import OTHER, PREFIXES, frame
from tests.hdl.cubesense.reference import READ_OUT, SIDES, Controls, Half, behaviour

STANDBY = Actions(Action.STANDBY, Action.STANDBY)

#: Levels of all outputs but SDA in standby.
LEVELS = {
    "CONTENTION": 0,
    **{
        f"{prefix}_SRAM_{name}": level
        for prefix in PREFIXES.values()
        for name, level in {"A": 0, "D_O": 0, "D_OE": 0, "CE_N": 1, "OE_N": 1, "WE_N": 1}.items()
    },
}


def store(camera: str, memory: str) -> Actions:
    """What stores a camera's picture in a memory."""
    if camera == memory:
        pair = {camera: Action.STORE, OTHER[camera]: Action.STANDBY}
    else:
        pair = {camera: Action.SEND_PICTURE, memory: Action.STORE_OTHER}
    return Actions(**pair)


def read(*sides: str) -> Actions:
    """What lets memories be read."""
    return Actions(*(Action.READ if side in sides else Action.STANDBY for side in SIDES))


class I2cBench:
    """The pair with all that surrounds it. ``start`` it, use it, ``check`` it."""

    def __init__(self, dut: Any, speed: int) -> None:
        self.dut = dut
        self.cameras: dict[str, Camera] = {}
        self.srams: dict[str, Sram] = {}
        dut.RESET_N.value = 0
        dut.SCL.value = 1
        dut.SDA_I.value = 1
        for side, prefix in PREFIXES.items():
            for name in ("Y", "HREF", "PCLK"):
                getattr(dut, f"{prefix}_{name}").value = 0
            pins = SimpleNamespace(
                PIXCLK=getattr(dut, f"{prefix}_PCLK"),
                PIXDATA=getattr(dut, f"{prefix}_Y"),
                HSYNC=getattr(dut, f"{prefix}_HREF"),
                VSYNC=SimpleNamespace(),  # not wired
            )
            self.cameras[side] = Camera(pins)
            # Bytes take microseconds, and every pixel clock costs the simulation.
            self.cameras[side].period = random.randrange(74_000, 600_000, 2)
            clock = partial(self._storing_clock, side)
            self.srams[side] = Sram(dut, f"{prefix}_SRAM_", clock)
        self.models = {side: FpgaModel(side, self.srams[side].memory) for side in SIDES}
        self.mcu = I2cMcu(dut, self.models, speed)
        self._before = [bytes(self.srams[side].memory) for side in SIDES]
        self._ack: dict[str, Levels] = {side: [(0, 0)] for side in SIDES}

    def _storing_clock(self, side: str) -> int:
        """What writes an FPGA's memory: its own camera's, or the other one's."""
        linked = int(getattr(self.dut, side).registers.store_other.value)
        storing = OTHER[side] if linked else side
        return int(getattr(self.dut, f"{PREFIXES[storing]}_PCLK").value)

    @classmethod
    async def start(
        cls, dut: Any, *, cameras: tuple[str, ...] = SIDES, speed: int = 0, failed_sram: str = ""
    ) -> "I2cBench":
        """Out of reset, in standby; the other cameras' clocks stand still at some level.

        A failed SRAM keeps nothing and offers unknown bytes.
        """
        bench = cls(dut, speed or random.choice(SPEEDS))
        await wait(1_000, ODD)
        bench.idle()
        dut.RESET_N.value = 1
        await wait(1_000, ODD)
        bench.idle()
        bench.mcu.run()
        for side in SIDES:
            if side == failed_sram:
                getattr(dut, f"{PREFIXES[side]}_SRAM_D_I").value = UNKNOWN
            else:
                bench.srams[side].start()
            cocotb.start_soon(watch(getattr(dut, side).registers.ack, bench._ack[side]))
            if side in cameras:
                cocotb.start_soon(bench.cameras[side].run())
            else:
                getattr(dut, f"{PREFIXES[side]}_PCLK").value = random.getrandbits(1)
                getattr(dut, f"{PREFIXES[side]}_HREF").value = random.getrandbits(1)
        cocotb.start_soon(never_high(dut.CONTENTION, "two drivers on the link"))
        return bench

    def idle(self) -> None:
        """All outputs are as in standby, SDA is released."""
        assert levels(self.dut, LEVELS) == LEVELS
        assert int(self.dut.SDA.value) == int(self.dut.SDA_I.value)
        for side in SIDES:
            fpga = getattr(self.dut, side)
            for name in ("LINK_D_O", "LINK_D_OE", "LINK_C_O", "LINK_C_OE", "SDA_OE"):
                assert not int(getattr(fpga, name).value), (side, name)

    async def acknowledged(self, side: str, polls: int = 1000) -> bool:
        """Poll STATUS; what it says is what was so two SCL periods before."""
        for _ in range(polls):
            status = await self.mcu.status(side)
            shown = bool(status & StatusBits.ACK)
            # The byte is taken with the falling SCL that ends the address' acknowledge.
            taken = self.mcu.falls[-10]
            third = self.mcu.falls[-12]
            shows = [level for time, level in self._ack[side] if time < third][-1:]
            shows += [level for time, level in self._ack[side] if third <= time <= taken]
            assert int(shown) in shows, "STATUS does not show ACK"
            if shown:
                return True
        return False

    async def shoot(self, camera: str, memory: str, content: bytes) -> None:
        """From standby: one picture from a camera to a memory, to ACK, and to standby."""
        await self.mcu.command(store(camera, memory))
        await self.cameras[camera].started()
        self.cameras[camera].send(frame(content))
        assert await self.acknowledged(memory)
        await self.mcu.command(STANDBY)
        assert self.stored(memory) == content

    def stored(self, side: str) -> bytes:
        """A memory's picture, row by row."""
        return self.srams[side].picture()

    async def read_picture(self, side: str) -> bytes:
        """Over the bus, in pieces of any length, without a pixel clock; from reading."""
        for camera in self.cameras.values():
            camera.stop()
        await self.mcu.point(side, 0, 0, False, READ_OUT)
        data = b""
        while (left := GEOMETRY.pixels - len(data)) > 0:
            number = random.choice([None, Register.DATA]) if data else Register.DATA
            data += await self.mcu.read(side, number, random.randint(1, left))
        for camera in self.cameras.values():
            camera.go()
        return data

    def pointer_byte(self) -> int:
        """For any byte of the pointer: of small pictures the lowest one has all of the address."""
        assert GEOMETRY.bank_size <= 0x80
        x, y = random.randrange(READ_OUT.columns), random.randrange(READ_OUT.rows)
        return GEOMETRY.address(x, y) | random.choice([0, 0x80])

    async def resynchronise(self) -> None:
        """Make both models' pointers and numbers those of the FPGAs, by writing them."""
        for each in SIDES:
            x, y = random.randrange(READ_OUT.columns), random.randrange(READ_OUT.rows)
            await self.mcu.point(each, x, y, bool(random.getrandbits(1)), READ_OUT)
            await self.mcu.read(each, Register.POINTER_HIGH, 3)

    def reset_models(self) -> None:
        """As RESET_N does; the first Sun pixel is kept."""
        for model in self.models.values():
            model.number = model.pointer = 0
            model.down, model.command = False, int(RESET_COMMAND)
            model.stop()
        self.mcu.commands.append((now(), int(RESET_COMMAND)))

    def controls(self) -> list[Controls]:
        """COMMAND over the time, as levels of the parallel board's lines."""
        found = []
        for time, command in [(0, int(RESET_COMMAND)), *self.mcu.commands]:
            rows = [row for row in COMMANDS if row.actions == command_of(command)]
            row = rows[0] if rows else COMMANDS[0]  # reading both is standby there
            found.append(Controls(time, row.shift or 0, 0, row.rnw or 0, row.sunen, row.naden))
        return found

    async def check(self, *, by_standby: bool = True) -> dict[str, Half]:
        """Go to standby; compare memories, write pulses, ACKs and Sun with the reference.

        Unless every command came ``by_standby``, pulses of no length between two are allowed.
        """
        await self.mcu.command(STANDBY)
        await Timer(1, unit="ns")
        self.idle()
        halves, _ = behaviour(
            self._before, [self.cameras[side].clocks for side in SIDES], self.controls(), [], {}
        )
        for side, half in halves.items():
            assert self.srams[side].pulses == half.pulses, side
            if by_standby:
                assert self.srams[side].edges == len(half.pulses), side
            assert self.srams[side].memory == half.memory, side
            assert self._ack[side] == half.ack, side
            if half.sun is not None:
                x, y = half.sun
                self.models[side].sun = GEOMETRY.address(x, y)
                await self.mcu.read(side, Register.SUN_HIGH, 3)
        return halves
