"""Compiled engine against Icarus Verilog, whose Verilog of the design comes the other way."""

import shutil
import subprocess
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.factory import make_engine
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import verilog_text

pytestmark = pytest.mark.skipif(
    shutil.which("iverilog") is None, reason="Icarus Verilog (iverilog) is not installed"
)

STROBE_PERIOD = 1_000_000
TIMEOUT_S = 300
COMMANDS = ("ENABLE", "RNW", "BANK", "strobe")
Command = tuple[int, str, int]


class Outcome(NamedTuple):
    sram: bytes
    data: bytes
    acks: list[int]


class IcarusBoard:
    """bench.v around one design and one camera, compiled once."""

    def __init__(self, folder: Path, top: CubeStarTop, camera) -> None:
        self._folder = folder
        (folder / "top.v").write_text(verilog_text(top))
        pixels = np.concatenate([image.ravel() for image in camera.images])
        (folder / "pixels.hex").write_text(pixels.tobytes().hex("\n"))
        (folder / "segments.txt").write_text(
            "".join(f"{s.start_ps} {s.clocks} {s.rows} {s.vsync}\n" for s in camera.segments)
        )
        parameters = {
            "ADDRESS_WIDTH": len(top.SRAM_A),
            "LINE_CLOCKS": camera.line_clocks,
            "ACTIVE_COLUMNS": camera.active_columns,
            "PIXELS": len(pixels),
            "PIXEL_NUMERATOR": camera.period.numerator,
            "PIXEL_DENOMINATOR": camera.period.denominator,
            "STROBE_HALF": STROBE_PERIOD // 2,
        }
        command = ["iverilog", "-g2005", "-s", "bench", "-o", "bench.vvp"]
        command += [f"-Pbench.{name}={value}" for name, value in parameters.items()]
        command += [str(Path(__file__).with_name("bench.v")), "top.v"]
        subprocess.run(command, cwd=folder, check=True, timeout=TIMEOUT_S)

    def run(self, commands: Sequence[Command]) -> Outcome:
        (self._folder / "commands.txt").write_text(
            "".join(f"{time} {COMMANDS.index(name)} {value}\n" for time, name, value in commands)
        )
        subprocess.run(
            ["vvp", "-n", "bench.vvp"],
            cwd=self._folder,
            check=True,
            capture_output=True,
            timeout=TIMEOUT_S,
        )
        return Outcome(
            read_hex(self._folder / "sram.hex"),
            read_hex(self._folder / "data.hex"),
            [int(line) for line in (self._folder / "ack.txt").read_text().split()],
        )


def read_hex(path: Path) -> bytes:
    lines = (line.partition("//")[0] for line in path.read_text().splitlines())
    return bytes.fromhex("".join(lines))


def run_compiled(top: CubeStarTop, camera, commands: Sequence[Command]) -> Outcome:
    engine = make_engine(cubestar_wiring(top), "compiled")
    engine.attach(camera)
    data, acks = b"", []

    def advance(until_ps: int) -> None:
        if not engine.get_pin("ACK"):
            engine.run(until_ps, ("ACK", 1))
            if engine.get_pin("ACK"):
                acks.append(engine.now_ps)
        engine.run(until_ps)

    for time_ps, name, value in commands:
        advance(time_ps)
        if name != "strobe":
            engine.set_pin(name, value)
            continue
        out = np.zeros(value, np.uint8)
        made = engine.strobe_read(out, Fraction(STROBE_PERIOD), time_ps + value * STROBE_PERIOD)
        assert made == value
        data += out.tobytes()
    return Outcome(engine.sram.tobytes(), data, acks)


def random_commands(rng: np.random.Generator, camera, count: int) -> list[Command]:
    """Toggles at any moment, and bursts of reading in every mode that leaves the clock alone."""
    commands: list[Command] = []
    time_ps, levels = 0, {"ENABLE": 0, "RNW": 0, "BANK": 0}
    for _ in range(count):
        time_ps += int(rng.exponential(camera.end_ps / count))
        name = str(rng.choice(COMMANDS, p=[0.5, 0.2, 0.1, 0.2]))
        if name == "strobe":
            value = int(rng.integers(1, 50))
            # While storing, no frame may be completed inside the burst: its time would be lost.
            if levels["ENABLE"] and not levels["RNW"]:
                continue
        else:
            value = int(rng.random() < (0.75 if name == "ENABLE" else 0.3))
            levels[name] = value
        commands.append((time_ps, name, value))
        time_ps += value * STROBE_PERIOD if name == "strobe" else 0
    return [*commands, (max(time_ps, camera.end_ps) + STROBE_PERIOD, "ENABLE", levels["ENABLE"])]


@pytest.mark.parametrize("seed", range(12))
def test_random_commands(seed, tmp_path, make_random_camera):
    rng = np.random.default_rng(seed)
    top = CubeStarTop(*((8, 4), (5, 3))[seed % 2])
    camera = make_random_camera(rng, top.columns, top.rows)
    commands = random_commands(rng, camera, 25)
    assert run_compiled(top, camera, commands) == IcarusBoard(tmp_path, top, camera).run(commands)


@pytest.mark.parametrize("bank", [0, 1])
def test_small_frames_joined_anywhere(bank, tmp_path, make_camera):
    """ENABLE rises in one clock after the other of the first frame and its blanking."""
    top = CubeStarTop(5, 3)
    camera = make_camera(5, 3, period=Fraction(10**12, 11_000_000), frames=3, blank=5)
    capture_ps = camera.end_ps
    icarus = IcarusBoard(tmp_path, top, camera)
    for clock in range(0, 32, 3):
        enable_ps = int((clock + Fraction(1, 3)) * camera.period)
        commands = [
            (1, "BANK", bank),
            (enable_ps, "ENABLE", 1),
            (capture_ps, "RNW", 1),
            (capture_ps + 50_000, "strobe", 40),
            (capture_ps + 50_000 + 40 * STROBE_PERIOD, "ENABLE", 0),
        ]
        compiled = run_compiled(top, camera, commands)
        assert compiled == icarus.run(commands)
        assert len(compiled.acks) == 1


def test_one_full_frame(tmp_path, make_camera):
    """1024 x 512 pixels of 1322 clocks a line at 10 MHz, stored and read back to the last byte."""
    top = CubeStarTop()
    camera = make_camera(1024, 512, frames=1, line_clocks=1322, blank=40)
    size = top.columns * top.rows
    read_ps = camera.end_ps + 50_000
    commands = [
        (777, "ENABLE", 1),
        (camera.end_ps, "RNW", 1),
        (read_ps, "strobe", size),
        (read_ps + size * STROBE_PERIOD, "ENABLE", 0),
    ]
    compiled = run_compiled(top, camera, commands)
    assert compiled == IcarusBoard(tmp_path, top, camera).run(commands)
    assert compiled.data == camera.images[0].tobytes()
