"""The command table on the pins of the pair, changes at any moment, and standby."""

import random
from itertools import product
from typing import Any

from cocotb.triggers import Timer

from cubestack.firmware_model.interface.cubesense.fpga import Action, actions, link_shows_enables
from cubestack.hdl.contract.bench.camera import picture
from cubestack.hdl.contract.bench.testbench import checked_test, timed_test
from cubestack.hdl.contract.bench.timing import ODD, wait
from cubestack.hdl.contract.bench.watching import disturb_in_standby, levels
from tests.hdl.cubesense.pair import PREFIXES, STANDBY, PairTestbench, frame
from tests.hdl.cubesense.reference import MCU_ADDRESSING

#: Idle times in ps, from a glitch to a few clocks.
MOMENTS = (1, 100, 3_000, 20_000, 100_000, 1_000_000)

#: What an action drives, and when: SRAM strobes, MCU bus, link data, link control other than the
#: own enable.
DRIVES = {
    Action.STANDBY: (0, 0, 0, 0, 0),
    **dict.fromkeys((Action.STORE, Action.STORE_OTHER), (1, 0, 0, 0, 0)),
    **dict.fromkeys((Action.READ, Action.EDGE), (1, 1, 1, 0, 0)),
    Action.SEND_PICTURE: (0, 0, 0, 1, 1),
    Action.SEND_EDGE: (1, 1, 0, 1, 0),
    Action.PASS_EDGE: (0, 0, 1, 0, 0),
}
if MCU_ADDRESSING:
    DRIVES |= {Action.TAKE_ADDRESS: (0, 0, 0, 0, 0), Action.READ_FROM: (1, 1, 1, 0, 0)}


async def works(bench: PairTestbench) -> None:
    """Pictures are stored right, and come back right. From any state, to standby."""
    await bench.standby()
    await bench.cameras_are_done()
    for place in (("sun", "sun"), ("nadir", "nadir"), random.choice(bench.PLACES)):
        content = await bench.shoot(place)
        assert await bench.read(place[1], 7) == content[:7]


@checked_test(PairTestbench)
async def every_row_and_every_unlisted_row(bench: PairTestbench) -> None:
    """Which drivers are on, settled, with both cameras' clocks running."""
    done = set()
    rows = list(product((0, 1), repeat=5))
    for shift, edge, rnw, sunen, naden in random.sample(rows, len(rows)):
        await bench.mcu.command(shift, edge, rnw, sunen, naden)
        for camera in bench.cameras.values():
            await camera.reach(len(camera.clocks) + 4)
        wanted = actions(shift, edge, rnw, sunen, naden, mcu_addressing=MCU_ADDRESSING)
        if sunen != naden and not link_shows_enables(shift, edge):
            # Unlisted, and the link is taken: a sender can not know that nobody listens. A
            # receiver gets no clock and stays in reset.
            enabled = "sun" if not sunen else "nadir"
            sends = getattr(actions(shift, edge, rnw, 0, 0), enabled) is Action.SEND_PICTURE
            wanted = wanted._replace(**{enabled: Action.SEND_PICTURE if sends else Action.STANDBY})
        for index, (side, prefix) in enumerate(PREFIXES.items()):
            action = getattr(wanted, side)
            chip, output, bus, link, copies = DRIVES[action]
            shows = link_shows_enables(shift, edge) and not (sunen, naden)[index]
            expected = {
                f"{prefix}_SRAM_CE_N": 1 - chip,
                f"{prefix}_SRAM_OE_N": 1 - output,
                f"{side}.DATA_OE": bus,
                f"{side}.LINK_D_OE": link,
                f"{side}.LINK_C_OE": 3 if copies else shows << index,
            }
            assert levels(bench.dut, expected) == expected
            done.add(action)
        assert not int(bench.dut.CONTENTION.value)
        if wanted == (Action.STANDBY, Action.STANDBY):
            quiet = {n: level for n, level in STANDBY.items() if not n.endswith("LINK_C_OE")}
            assert levels(bench.dut, quiet) == quiet
        await bench.mcu.standby()
        await Timer(1, unit="step")
        assert levels(bench.dut, STANDBY) == STANDBY
    assert done == set(DRIVES)


@checked_test(PairTestbench)
async def rows_one_after_the_other(bench: PairTestbench) -> None:
    """Random rows, each left at any moment for standby, with cameras and data clock running."""
    await bench.shoot(("sun", "nadir"), picture())
    await bench.shoot(("sun", "sun"), picture())
    for _ in range(60):
        for camera in bench.cameras.values():
            if not camera.busy:
                camera.send(frame(picture()))
        await bench.mcu.command(*(random.getrandbits(1) for _ in range(5)))
        if random.getrandbits(1):
            await bench.mcu.read(random.randrange(1, 30))
        else:
            await wait(random.randrange(20) * bench.cameras["sun"].period, ODD)
        await bench.mcu.standby()
    await works(bench)


@timed_test
async def controls_change_at_any_moment(dut: Any) -> None:
    """Even in orders that the firmware keeps away from; afterwards all works."""
    bench = await PairTestbench.start(dut)
    for _ in range(4):
        for camera in bench.cameras.values():
            for _ in range(4):
                camera.send(frame(picture()))
        for _ in range(80):
            lines = random.sample(bench.mcu.LINES, random.choice([1, 1, 1, 2]))
            after = random.randrange(1, 2 * random.choice(MOMENTS))
            await bench.mcu.set(after, **{name: random.getrandbits(1) for name in lines})
            if random.random() < 0.2:
                dut.CLK.value = 1
                await wait(random.randrange(1, 50_000), ODD)
                dut.CLK.value = 0
        await works(bench)


@timed_test
async def idle_is_reset(dut: Any) -> None:
    """With both enables high nothing on any other pin moves any output, not even for a glitch."""
    bench = await PairTestbench.start(dut, dead_camera="sun")
    await bench.mcu.standby()
    pins = ["RNW", "EDGE", "SHIFT", "CLK", *(f"SUN_{n}" for n in ("PCLK", "HREF", "Y", "SRAM_D_I"))]
    await disturb_in_standby(dut, STANDBY, pins, MOMENTS[:5], 600)
