"""Testbench that judges any design by what the board around it sees.

A design may react a few clocks late: :data:`LATENCY` periods of the pixel clock after ENABLE or RNW
has changed, it must be in its new state.
"""

import random
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge, Timer

from cubestack.hdl.contract.bench.camera import flat, line, picture, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.timing import Timing, now
from cubestack.hdl.contract.bench.watching import pin
from cubestack.hdl.contract.cubestar.board import CubeStarBench
from cubestack.hdl.contract.image import image_of_environment

LATENCY = 5

#: What the design keeps of a frame.
IMAGE = image_of_environment(*GEOMETRY)

#: Rates of the real board: no clock stalls, and the processor reads at 37 cycles a byte or slower.
REAL = Timing(
    pixel_periods=(50_000, 100_000),
    stall_rates=(0.0,),
    data_halves=(385_400, 500_000),
    idles=(500_000, 2_000_000),
)

#: Levels of the outputs that matter in standby.
INACTIVE = {"ACK": 0, "SRAM_D_OE": 0, "SRAM_CE_N": 1, "SRAM_OE_N": 1, "SRAM_WE_N": 1}

Rows = list[list[Tick]]


def rows_of(content: bytes) -> Rows:
    """The rows of an image, each with its pause."""
    size = GEOMETRY.columns
    return [
        list(line(content[start : start + size], random.randint(8, 16)))
        for start in range(0, len(content), size)
    ]


def pause() -> list[Tick]:
    """Between two images; VSYNC rises some clocks before the first row."""
    return [*vsync(random.randint(8, 20)), *line([], random.randint(2, 6))]


class ContractBench(CubeStarBench):
    """The published board around a design; its monitors fail a test at once.

    ``whole`` are the images that may be acknowledged at present.
    """

    LOW = ("ENABLE", "RNW", "BANK", "DCLK")

    def __init__(self, dut: Any, timing: Timing = REAL) -> None:
        super().__init__(dut, [dut], timing)
        (self.sram,) = self.srams
        self.whole: list[bytes] = []
        self._bank = 0  # of the store that has begun last
        self._seen = 0  # write pulses
        self._before: bytearray = bytearray()

    @classmethod
    async def start(cls, dut: Any, timing: Timing = REAL, camera: bool = True) -> "ContractBench":
        """In standby, after some pixel clocks unless there is no camera."""
        bench = cls(dut, timing)
        if camera:
            cocotb.start_soon(bench.camera.run())
            await bench.camera.reach(2 * LATENCY)
        await Timer(1, unit="ns")
        bench.in_standby()
        bench._before = bytearray(bench.sram.memory)
        bench.sram.start()
        cocotb.start_soon(bench._judge_ack())
        cocotb.start_soon(bench._judge_writes())
        return bench

    def pixel_clock(self, memory: int) -> int:
        """A design may write in either half of the clock."""
        return 0

    def in_standby(self) -> None:
        for name, level in INACTIVE.items():
            value = pin(self.dut, name).value
            assert value.is_resolvable, f"in standby {name} is {value}, neither 0 nor 1"
            assert int(value) == level, f"in standby {name} is {int(value)}"

    # --- monitors ---

    @property
    def mode(self) -> str:
        """What ENABLE and RNW request; "changing" within the latency of a change."""
        last = self.mcu.controls[-1]
        if now() - last.time < LATENCY * self.camera.period:
            return "changing"
        return "standby" if not last.enable else "reading" if last.rnw else "storing"

    async def _judge_ack(self) -> None:
        while True:
            await RisingEdge(self.dut.ACK)
            await Timer(1, unit="step")
            if not int(self.dut.ACK.value):
                continue  # a glitch
            assert self.mcu.storing or self.mode == "changing", f"ACK rises while {self.mode}"
            if not self.mcu.storing:
                continue
            stored = self.sram.picture(self._bank)
            right = any(IMAGE.holds(stored, content) for content in self.whole)
            assert right, f"ACK is early: {self._difference(stored)}"

    def _difference(self, stored: bytes) -> str:
        """The first pixel in which the memory differs from the image that is most like it."""
        if not self.whole:
            return "no whole frame has been sent"
        wrong = [
            [n for n, level in enumerate(IMAGE.stored(content)) if level not in (-1, stored[n])]
            for content in self.whole
        ]
        place = min(wrong, key=len)[0]
        row, column = divmod(place, GEOMETRY.columns)
        return f"the pixel at column {column} of row {row} is not in the memory"

    async def _judge_writes(self) -> None:
        addresses = [{*GEOMETRY.addresses(bank)} for bank in (0, 1)]
        while True:
            await RisingEdge(self.dut.SRAM_WE_N)
            await Timer(1, unit="step")
            for pulse in self.sram.pulses[self._seen :]:
                assert self.mode in ("storing", "changing"), f"a write while {self.mode}"
                at = f"a write at address {pulse.address:#x}"
                other = f"{at}, in bank {1 - self._bank}, while bank {self._bank} is stored in"
                assert pulse.address not in addresses[1 - self._bank], other
                assert pulse.address in addresses[self._bank], f"{at}, outside of the image"
            self._seen = len(self.sram.pulses)

    # --- actions ---

    async def command(self, place: int) -> None:
        self._bank, self.whole = place, []
        await super().command(place)

    async def store(self, place: int) -> None:
        """From standby to storing, and long enough for any design to be ready."""
        await self.command(place)
        await self.camera.reach(len(self.camera.clocks) + 2 * LATENCY)

    def frame(self, content: bytes) -> list[Tick]:
        """A whole frame, which may be acknowledged from now on."""
        self.whole.append(content)
        return [*pause(), *flat(rows_of(content))]

    async def standby(self) -> None:
        """Leave, and wait until the design has settled."""
        await super().standby()
        await Timer(LATENCY * self.camera.period + 1000, unit="step")
        self.in_standby()

    async def is_stored(self, place: int) -> None:
        """ACK comes a few clocks after the camera has sent all; then standby."""
        await self.camera.sent()
        assert await self.mcu.acknowledged(2 * LATENCY * self.camera.period), "no ACK"
        await self.standby()

    async def is_dropped(self) -> None:
        """All was sent, and ACK does not come."""
        await self.camera.sent()
        assert not await self.mcu.acknowledged(2 * LATENCY * self.camera.period), "ACK is early"

    async def shoot(self, place: int, content: bytes | None = None) -> bytes:
        content = picture() if content is None else content
        await self.begin(place, content)
        await self.is_stored(place)
        assert IMAGE.holds(self.stored(place), content), "the memory changed after ACK"
        return content

    async def fetch(self, place: int, count: int = GEOMETRY.pixels) -> bytes:
        await self.mcu.open(place)
        content = await self.mcu.read(count)
        await self.standby()
        return content

    async def read_back(self, place: int, count: int = GEOMETRY.pixels) -> None:
        expected = IMAGE.presented(self.stored(place))[:count]
        for number, (got, byte) in enumerate(
            zip(await self.fetch(place, count), expected, strict=True)
        ):
            text = f"data clock {number + 1} presents {got:#04x}, not {byte:#04x}"
            assert got == byte, text

    async def works(self, place: int | None = None) -> None:
        """A frame is stored and read back. From any state, to standby."""
        place = random.getrandbits(1) if place is None else place
        await self.standby()
        await self.camera.sent()
        await self.shoot(place)
        await self.read_back(place)

    async def check(self) -> None:
        await self.standby()
        assert self.sram.edges == len(self.sram.pulses), "a write pulse that was none"
