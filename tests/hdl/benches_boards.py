"""Two shared-memory boards on one bus and one camera: one stores while the other is worked on."""

import random
from types import SimpleNamespace
from typing import Any

import cocotb
from bench import Camera, Mcu, frame, picture, timed_test
from cocotb.triggers import ReadOnly, Timer
from ebi import Ebi, sram_at, stored
from geometry import GEOMETRY

BOARDS = (1, 2)


class BoardsBench:
    """Camera, processor and both boards' SRAMs."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        for name in ("PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        self.camera = Camera(dut)
        self.bus = Ebi(dut, "BOARD1_CS_N", "BOARD2_CS_N")
        self.mcus, self.srams = [], []
        for n in BOARDS:
            pins = {name: getattr(dut, f"BOARD{n}_{name}") for name in ("ENABLE", "RNW", "BANK")}
            for pin in pins.values():
                pin.value = 0
            self.mcus.append(Mcu(SimpleNamespace(**pins, ACK=getattr(dut, f"BOARD{n}_ACK"))))
            rnw = pins["RNW"]
            self.srams.append(sram_at(dut, f"BOARD{n}_SRAM_", lambda rnw=rnw: not int(rnw.value)))

    @classmethod
    async def start(cls, dut: Any) -> "BoardsBench":
        bench = cls(dut)
        await Timer(1, unit="ns")
        for sram in bench.srams:
            sram.start()
        bench.bus.start()
        cocotb.start_soon(bench.camera.run())
        cocotb.start_soon(bench._watch_contention())
        return bench

    async def _watch_contention(self) -> None:
        while True:
            await self.dut.CONTENTION.value_change
            await ReadOnly()
            assert not int(self.dut.CONTENTION.value), "both boards drive the bus"


@timed_test
async def one_stores_while_the_other_is_worked_on(dut: Any) -> None:
    """In turn; the picture of the last turn is read while the next one is stored."""
    bench = await BoardsBench.start(dut)
    content = b""
    for turn in range(5):
        storing, working = turn % 2, 1 - turn % 2
        await bench.mcus[storing].store(0)
        await bench.camera.reach(len(bench.camera.clocks) + 3)
        new = picture()
        bench.camera.send(frame(new))
        await bench.mcus[working].set(RNW=1)
        await bench.mcus[working].set(ENABLE=1)
        select = f"BOARD{working + 1}_CS_N"
        for _ in range(40 if content else 0):
            x, y = random.randrange(GEOMETRY.columns), random.randrange(GEOMETRY.rows)
            byte = await bench.bus.read(GEOMETRY.address(x, y), select)
            assert byte == content[y * GEOMETRY.columns + x]
        await bench.bus.write(GEOMETRY.bank_size, turn, select)
        assert bench.srams[working].memory[GEOMETRY.bank_size] == turn
        await bench.mcus[working].standby()
        assert await bench.mcus[storing].acknowledged()
        await bench.mcus[storing].standby()
        assert stored(bench.srams[storing]) == new
        content = new


@timed_test
async def address_of_one_board_is_not_taken_by_the_other(dut: Any) -> None:
    """Both have the bus; each access reaches the board that is selected, and no other."""
    bench = await BoardsBench.start(dut)
    expected = [bytearray(sram.memory) for sram in bench.srams]
    for mcu in bench.mcus:
        await mcu.set(RNW=1)
        await mcu.set(ENABLE=1)
    for _ in range(200):
        board, address = random.getrandbits(1), random.randrange(2 * GEOMETRY.bank_size)
        select = f"BOARD{board + 1}_CS_N"
        if random.getrandbits(1):
            expected[board][address] = random.getrandbits(8)
            await bench.bus.write(address, expected[board][address], select)
        else:
            assert await bench.bus.read(address, select) == expected[board][address]
    assert [sram.memory for sram in bench.srams] == expected
