"""Nonsense on every bus at any time: nothing breaks, and the next good message gets its answer."""

from collections.abc import Callable

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.thumbnail import thumbnail
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    DetectResult,
    ImageSize,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS

from .bench import Bench
from .scenery import earth

EARTH = earth(5.0, 3.0)
IMAGE = REGISTERS["IMAGE"].address

Turn = Callable[[Bench, np.random.Generator], None]


def some_bytes(rng: np.random.Generator, most: int) -> bytes:
    """Every third byte is one that frames or letters are made of."""
    count = int(rng.integers(1, most))
    special = rng.choice(np.frombuffer(b"\x1f\x7f\xff\x14\x40\x41\x96aqsw", np.uint8), count)
    plain = rng.integers(0, 256, count, dtype=np.uint8)
    return np.where(rng.random(count) < 0.33, special, plain).astype(np.uint8).tobytes()


def uart(bench: Bench, rng: np.random.Generator) -> None:
    bench.uart(some_bytes(rng, 40))
    bench.received()
    if rng.random() < 0.2:
        bench.program.node.uart_silence()


def framed(bench: Bench, rng: np.random.Generator) -> None:
    """A frame as it should be, with a random ID, length and parameters."""
    bench.program.node.uart_silence()
    identifier = int(rng.integers(0, 256))
    message = INTERFACE.find(identifier)
    right = message.length if message is not None and identifier < 128 else 0
    length = right if rng.random() < 0.8 else int(rng.integers(0, 40))
    data = rng.integers(0, 256 if rng.random() < 0.5 else 3, length, np.uint8).tobytes()
    bench.uart(encode_frame(bytes([identifier]) + data))
    answers = bench.received()
    if identifier < 128:
        (answer,) = answers
        assert AckError(answer[0]) in AckError
    else:
        assert [len(answer) for answer in answers] == ([message.length] if message else [])


def letters(bench: Bench, rng: np.random.Generator) -> None:
    bench.uart(some_bytes(rng, 6), Port.BENCH)
    bench.program.bench.uart_silence()
    bench.sent[Port.BENCH].clear()
    bench.backlog[Port.BENCH] = int(rng.integers(0, 100))


def i2c(bench: Bench, rng: np.random.Generator) -> None:
    """A transfer to either address."""
    registers = bool(rng.integers(0, 2))
    pointer = [None, int(rng.integers(0, 256)), IMAGE, int(rng.integers(0, 20))][rng.integers(0, 4)]
    if rng.random() < 0.5:
        bench.i2c_write(some_bytes(rng, 30), registers=registers)
    else:
        bench.i2c_read(int(rng.integers(0, 300)), pointer, registers=registers)


def transitions(bench: Bench, rng: np.random.Generator) -> None:
    """Starts, bytes and stops in any order, as a disturbed bus may bring them."""
    for _ in range(20):
        link = (bench.program.node, bench.program.registers)[rng.integers(0, 2)]
        match rng.integers(0, 5):
            case 0:
                link.i2c_start(bool(rng.integers(0, 2)))
            case 1 | 2:
                link.i2c_write(int(rng.integers(0, 256)))
            case 3:
                byte = link.i2c_read()
                assert byte is None or 0 <= byte <= 255
            case _:
                link.i2c_stop()


def latch_up(bench: Bench, rng: np.random.Generator) -> None:
    if rng.random() < 0.1:
        bench.latched.add(Sram(rng.integers(0, 2)))


def stays_sane(bench: Bench) -> None:
    """All three protocols still do what they should."""
    link, registers = bench.program.node, bench.program.registers
    link.uart_silence()
    link.i2c_stop()
    registers.i2c_stop()
    bench.backlog = dict.fromkeys(Port, 0)
    bench.run()
    bench.received()
    bench.sent[Port.BENCH].clear()
    bench.command("ClearOverCurrent", Selection=2)
    assert bench.send("Reset", Target=3) == 0
    bench.run()
    assert bench.telemetry("Identification")["InterfaceVersion"] == INTERFACE.version
    bench.scenes[Camera.NADIR] = EARTH
    bench.command("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM2)
    assert bench.telemetry("Result2")["Detect"] == DetectResult.SUCCESS
    bench.command("StartImageDownload", Sram=Sram.SRAM2, Size=ImageSize.SIDE_64)
    bench.command("NextImageFrame", Frame=15)
    data = bench.telemetry("ImageFrame")["Frame"]
    assert data == thumbnail(EARTH, ImageSize.SIDE_64).reshape(-1, 128)[15].tobytes()
    assert bench.i2c_write(b"\x28\x09") == 2
    bench.run()
    assert bench.i2c_read(3, 0x83) == bytes([40, 1, 0])
    assert bench.i2c_read(1, 0x00, registers=True) == b"\x09"
    bench.uart(b"s", Port.BENCH)
    bench.run()
    assert bench.sent[Port.BENCH] == EARTH.tobytes()


@pytest.mark.parametrize(("seed", "mcu_addressing"), [(0, False), (1, True)])
def test_nonsense_on_every_bus_at_any_time(seed: int, mcu_addressing: bool) -> None:
    bench = Bench(mcu_addressing=mcu_addressing)
    rng = np.random.default_rng(seed)
    turns: tuple[Turn, ...] = (uart, framed, framed, letters, i2c, i2c, transitions, latch_up)
    for _ in range(1500):
        turns[rng.integers(0, len(turns))](bench, rng)
        bench.run(until_us=bench.now_us + int(rng.integers(0, 30_000)))
    stays_sane(bench)


@pytest.mark.parametrize("seed", range(2))
def test_nonsense_in_the_middle_of_anything(seed: int) -> None:
    """Interrupts come at every request of the program, not only where it sleeps."""
    bench = Bench()
    rng = np.random.default_rng(100 + seed)
    turns: tuple[Turn, ...] = (framed, i2c, transitions, letters)
    busy = False

    def interrupt(_request: object) -> None:
        nonlocal busy
        if not busy and rng.random() < 0.02:
            busy = True
            turns[rng.integers(0, len(turns))](bench, rng)
            busy = False

    bench.on_request = interrupt
    bench.run(until_us=bench.now_us + 15_000_000)
    bench.on_request = lambda _request: None
    stays_sane(bench)
