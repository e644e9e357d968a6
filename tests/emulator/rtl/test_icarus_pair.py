"""CubeSense's pair: compiled engine, Amaranth's simulator and Icarus Verilog do all the same."""

import shutil
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense.pair import CubeSensePair
from tests.tiers import quick

from .cameras import ListCamera
from .commanded import Command, CommandedIcarus, Outcome, run_engine
from .pair_board import SIDES, SIZES, STROBE_PERIOD, Script, pair_camera, readings, stores

pytestmark = [
    pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed"),
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
]

PINS = ("SUNACK", "NADACK")


WIRINGS = {size: cubesense_wiring(CubeSensePair(size)) for size in SIZES}


@pytest.fixture(scope="module", params=SIZES, ids=lambda size: f"{size.columns}x{size.rows}")
def board(request, tmp_path_factory) -> tuple[ReadOut, CommandedIcarus]:
    size = request.param
    folder = tmp_path_factory.mktemp("pair")
    return size, CommandedIcarus(folder, WIRINGS[size], STROBE_PERIOD)


def run(kind: str, wiring: Wiring, cameras, commands: list[Command], watched: str) -> Outcome:
    engine = make_engine(wiring, kind)
    outcome = run_engine(engine, cameras, commands, STROBE_PERIOD, watched)
    assert not engine.violations
    engine.close()
    return outcome


def random_life(
    rng: np.random.Generator, size: ReadOut
) -> tuple[dict[str, ListCamera], list[Command]]:
    """Both cameras or one; pictures to either memory or both; every read-out, with or without.

    Now and then a memory has no supply for a while, or a store is left before its end.
    """
    dead = str(rng.choice(SIDES)) if rng.random() < 0.2 else ""
    cameras = {side: pair_camera(rng, size) for side in SIDES if side != dead}
    frame_ps = max(camera.end_ps / 3 for camera in cameras.values())
    script = Script(rng)
    script.wait(rng.uniform(0, frame_ps))
    levels, memories = stores()[rng.integers(5)]
    without_supply = str(rng.choice(SIDES)) if rng.random() < 0.15 else ""
    if without_supply:
        script.do(f"power {without_supply}", 0)
    script.command(*levels)
    script.wait(2.2 * frame_ps if rng.random() < 0.9 else rng.uniform(0, 2 * frame_ps))
    if without_supply:
        script.standby()
        script.do(f"power {without_supply}", 1)
    for memory in memories:
        for levels, count in readings(memory, size):
            if rng.random() < 0.6:
                script.command(*levels)
                script.read(count + int(rng.integers(-3, 4)))
    script.standby()
    script.wait(1_000)
    script.do("SHIFT", 0)
    return cameras, script.commands


@pytest.mark.parametrize("seed", quick(range(25), 2))
def test_random_lives(board, seed):
    size, icarus = board
    rng = np.random.default_rng([seed, size.columns])
    cameras, commands = random_life(rng, size)
    expected = icarus.run(cameras, commands)
    for watched in PINS:
        assert run("compiled", WIRINGS[size], cameras, commands, watched) == expected[watched]
    watched = PINS[seed % 2]
    assert run("python", WIRINGS[size], cameras, commands, watched) == expected[watched]


def test_random_runs_cover_all_stores_and_memories():
    """Nearly all store a picture; every way to store and every memory occurs."""
    seen: Counter[str] = Counter()
    for size in SIZES:
        for seed in range(25):
            rng = np.random.default_rng([seed, size.columns])
            cameras, commands = random_life(rng, size)
            for watched in PINS:
                outcome = run("compiled", WIRINGS[size], cameras, commands, watched)
                seen[watched] += len(outcome.acks)
            seen["bytes"] += len(set(outcome.data))
            linked = ("SHIFT", 1) in {command[1:] for command in commands}
            seen["linked"] += linked
            seen["dead"] += len(cameras) < 2
    assert seen["SUNACK"] >= 15
    assert seen["NADACK"] >= 15
    assert seen["linked"] >= 20
    assert seen["dead"] >= 5
    assert seen["bytes"] > 1000


@pytest.mark.slow
def test_one_full_frame(tmp_path):
    """858 clocks a line at 13.5 MHz: the sun's picture across the link, then scan and window."""
    period, line_clocks = Fraction(10**12, 13_500_000), 858
    rng = np.random.default_rng(1)
    camera = ListCamera(period, line_clocks, FULL_SIZE.columns)
    image = rng.integers(0, 200, (FULL_SIZE.rows, FULL_SIZE.columns), dtype=np.uint8)
    image[400, 300:303] = 255
    camera.add_blank(FULL_SIZE.frame_gap + 20)
    camera.add_image(image)
    camera.add_blank(5)
    script = Script(rng)
    script.command(1, 0, 0, 0, 0)
    script.wait(camera.end_ps)
    for levels, count in readings("nadir", FULL_SIZE)[1:]:
        script.command(*levels)
        script.read(count)
    script.standby()
    wiring = cubesense_wiring(CubeSensePair())
    compiled = run("compiled", wiring, {"sun": camera}, script.commands, "NADACK")
    icarus = CommandedIcarus(tmp_path, wiring, STROBE_PERIOD)
    assert compiled == icarus.run({"sun": camera}, script.commands)["NADACK"]
    stored = np.frombuffer(compiled.memories["nadir"], np.uint8).reshape(512, 1024)
    assert (stored[: FULL_SIZE.rows, : FULL_SIZE.columns] == image).all()
    assert len(compiled.acks) == 1
    window = compiled.data[-4 - FULL_SIZE.window**2 :]
    assert window[:4] == bytes([300 % 256, 300 // 256, 400 % 256, 400 // 256])
