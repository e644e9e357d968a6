"""Two shared-memory boards on one bus and one camera: one stores while the other is worked on."""

import random
from typing import Any

from bench import picture, timed_test
from bench_next import BoardsBench
from ebi import stored
from geometry import GEOMETRY


@timed_test
async def one_stores_while_the_other_is_worked_on(dut: Any) -> None:
    """In turn; the picture of the last turn is read while the next one is stored."""
    bench = await BoardsBench.start(dut)
    content = b""
    for turn in range(5):
        storing, working = turn % 2, 1 - turn % 2
        new = picture()
        await bench.begin(storing, new)
        await bench.open(working)
        select = f"BOARD{working + 1}_CS_N"
        for _ in range(40 if content else 0):
            x, y = random.randrange(GEOMETRY.columns), random.randrange(GEOMETRY.rows)
            byte = await bench.bus.read(GEOMETRY.address(x, y), select)
            assert byte == content[y * GEOMETRY.columns + x]
        await bench.bus.write(GEOMETRY.bank_size, turn, select)
        assert bench.srams[working].memory[GEOMETRY.bank_size] == turn
        await bench.mcus[working].standby()
        assert await bench.acknowledged(storing)
        await bench.mcus[storing].standby()
        assert stored(bench.srams[storing]) == new
        content = new
    await bench.check()


@timed_test
async def address_of_one_board_is_not_taken_by_the_other(dut: Any) -> None:
    """Both have the bus; each access reaches the board that is selected, and no other."""
    bench = await BoardsBench.start(dut)
    expected = [bytearray(sram.memory) for sram in bench.srams]
    for board in bench.PLACES:
        await bench.open(board)
    for _ in range(200):
        board, address = random.getrandbits(1), random.randrange(2 * GEOMETRY.bank_size)
        select = f"BOARD{board + 1}_CS_N"
        if random.getrandbits(1):
            expected[board][address] = random.getrandbits(8)
            await bench.bus.write(address, expected[board][address], select)
        else:
            assert await bench.bus.read(address, select) == expected[board][address]
    assert [sram.memory for sram in bench.srams] == expected
    await bench.check()


@timed_test
async def board_that_has_no_bus_answers_nothing(dut: Any) -> None:
    """It stores, or is in standby."""
    bench = await BoardsBench.start(dut)
    for board in bench.PLACES:
        for stores in (False, True):
            content = picture()
            if stores:
                await bench.begin(board, content)
            before = bytes(bench.srams[board].memory[GEOMETRY.bank_size :])
            for _ in range(15):
                address = random.randrange(2 * GEOMETRY.bank_size)
                select = f"BOARD{board + 1}_CS_N"
                if random.getrandbits(1):
                    await bench.bus.write(address, random.getrandbits(8), select)
                else:
                    assert await bench.bus.read(address, select) is None
            if stores:
                assert await bench.acknowledged(board)
                assert stored(bench.srams[board]) == content
            assert bench.srams[board].memory[GEOMETRY.bank_size :] == before
            await bench.standby()
    await bench.check()


@timed_test
async def strobes_together_read(dut: Any) -> None:
    bench = await BoardsBench.start(dut)
    before = [bytes(sram.memory) for sram in bench.srams]
    for board in bench.PLACES:
        await bench.open(board)
        address = random.randrange(2 * GEOMETRY.bank_size)
        byte = await bench.bus.read_and_write(address, f"BOARD{board + 1}_CS_N")
        assert byte == before[board][address]
    assert [sram.memory for sram in bench.srams] == before
    assert not any(sram.edges for sram in bench.srams)
    await bench.check()
