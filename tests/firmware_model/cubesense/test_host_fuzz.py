"""Recorded sessions; nonsense on every bus at any time, after which good messages get answers."""

from collections.abc import Callable

import numpy as np
import pytest

from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import Camera, DetectResult, ImageSize, Sram
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from tests.tiers import quick

from ..sessions import Step, as_recorded
from .harness import Harness
from .scenery import earth, thumbnail
from .test_commands import lit

EARTH = earth(5.0, 3.0)
IMAGE = REGISTERS["IMAGE"].address

Turn = Callable[[Harness, np.random.Generator], None]


def some_bytes(rng: np.random.Generator, most: int) -> bytes:
    """Every third byte is one that frames or letters are made of."""
    count = int(rng.integers(1, most))
    special = rng.choice(np.frombuffer(b"\x1f\x7f\xff\x14\x40\x41\x96aqsw", np.uint8), count)
    plain = rng.integers(0, 256, count, dtype=np.uint8)
    return np.where(rng.random(count) < 0.33, special, plain).astype(np.uint8).tobytes()


def uart(unit: Harness, rng: np.random.Generator) -> None:
    unit.uart(some_bytes(rng, 40))
    if rng.random() < 0.2:
        unit.program.node.uart_silence()


def framed(unit: Harness, rng: np.random.Generator) -> None:
    unit.program.node.uart_silence()
    identifier = int(rng.integers(0, 256))
    message = INTERFACE.find(identifier)
    right = message.length if message is not None and identifier < 128 else 0
    length = right if rng.random() < 0.8 else int(rng.integers(0, 40))
    data = rng.integers(0, 256 if rng.random() < 0.5 else 3, length, np.uint8).tobytes()
    answers = unit.frames(bytes([identifier]) + data)
    if identifier < 128:
        (answer,) = answers
        assert AckError(answer[0]) in AckError
    else:
        assert [len(answer) for answer in answers] == ([message.length] if message else [])


def letters(unit: Harness, rng: np.random.Generator) -> None:
    unit.letters(some_bytes(rng, 6))
    unit.program.bench.uart_silence()
    unit.bench_sent.clear()
    unit.bench_backlog = int(rng.integers(0, 100))


def i2c(unit: Harness, rng: np.random.Generator) -> None:
    registers = bool(rng.integers(0, 2))
    pointer = [None, int(rng.integers(0, 256)), IMAGE, int(rng.integers(0, 20))][rng.integers(0, 4)]
    if rng.random() < 0.5:
        data = some_bytes(rng, 30)
        unit.write_register(*data) if registers else unit.i2c_write(data)
    else:
        read = unit.read_register if registers else unit.i2c_read
        read(int(rng.integers(0, 300)), pointer)


def transitions(unit: Harness, rng: np.random.Generator) -> None:
    """Starts, bytes and stops in any order, as a disturbed bus may bring them."""
    for _ in range(20):
        link = (unit.program.node, unit.program.registers)[rng.integers(0, 2)]
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


def latch_up(unit: Harness, rng: np.random.Generator) -> None:
    if rng.random() < 0.1:
        unit.latched.add(Sram(rng.integers(0, 2)))


def stays_sane(unit: Harness) -> None:
    link, registers = unit.program.node, unit.program.registers
    link.uart_silence()
    link.i2c_stop()
    registers.i2c_stop()
    unit.backlog = unit.bench_backlog = 0
    unit.run()
    unit.received()
    unit.bench_sent.clear()
    unit.command("ClearOverCurrent", Selection=2)
    unit.command("Reset", Target=3)
    assert unit.telemetry("Identification")["InterfaceVersion"] == INTERFACE.version
    unit.scenes[Camera.NADIR] = EARTH
    unit.command("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM2)
    assert unit.telemetry("Result2")["Detect"] == DetectResult.SUCCESS
    unit.command("StartImageDownload", Sram=Sram.SRAM2, Size=ImageSize.SIDE_64)
    unit.command("NextImageFrame", Frame=15)
    data = unit.telemetry("ImageFrame")["Frame"]
    assert data == thumbnail(EARTH, ImageSize.SIDE_64).reshape(-1, 128)[15].tobytes()
    assert unit.i2c_write(b"\x28\x09") == 2
    unit.run()
    assert unit.i2c_read(3, 0x83) == bytes([40, 1, 0])
    assert unit.read_register(1, 0x00) == b"\x09"
    unit.letters(b"s")
    unit.run()
    assert unit.bench_sent == EARTH.tobytes()


@pytest.mark.parametrize(("seed", "mcu_addressing"), quick([(1, True), (0, False)], 1))
def test_random_bytes_on_every_bus_do_not_harm_the_node(seed: int, mcu_addressing: bool) -> None:
    unit = Harness(mcu_addressing=mcu_addressing)
    rng = np.random.default_rng(seed)
    turns: tuple[Turn, ...] = (uart, framed, framed, letters, i2c, i2c, transitions, latch_up)
    for _ in range(600):
        turns[rng.integers(0, len(turns))](unit, rng)
        unit.run(until_us=unit.now_us + int(rng.integers(0, 30_000)))
    stays_sane(unit)


@pytest.mark.parametrize(("seed", "seconds"), quick([(0, 3), (1, 10)], 1))
def test_random_bytes_during_any_operation_do_not_harm_the_node(seed: int, seconds: int) -> None:
    """Interrupts come at every request of the program, not only where it sleeps."""
    unit = Harness()
    rng = np.random.default_rng(100 + seed)
    turns: tuple[Turn, ...] = (framed, i2c, transitions, letters)
    busy = False

    def interrupt(_request: object) -> None:
        nonlocal busy
        if not busy and rng.random() < 0.02:
            busy = True
            turns[rng.integers(0, len(turns))](unit, rng)
            busy = False

    unit.on_request = interrupt
    unit.run(until_us=unit.now_us + seconds * 1_000_000)
    unit.on_request = lambda _request: None
    stays_sane(unit)


STEPS: list[Step] = [
    *(("CaptureAndDetect", {"Camera": c, "Sram": s}) for s, c in ((0, 0), (1, 1), (1, 0), (0, 1))),
    ("SetNadirSearch", {"Search": 1}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
    ("CaptureOnly", {"Camera": 0, "Sram": 0, "Location": 0}),
    ("StartImageDownload", {"Sram": 0, "Location": 0, "Size": 3}),
    ("NextImageFrame", {"Frame": 1}),
    ("DetectionThreshold1", {"Threshold": 240}),
    ("DetectionThreshold2", {"Threshold": 90}),
    ("CameraSettings1", {"Exposure": 20, "Gain": 4}),
    ("CameraSettings2", {}),
    ("AutoAdjust1", {"Enabled": 1}),
    ("Boresight1", {"X": 370, "Y": 255}),
    ("Mask1", {"Area": 1, "XMin": 10, "XMax": 20, "YMin": 30, "YMax": 40}),
    ("Distortion1", {}),
    ("CaptureAndDetect", {"Camera": 0, "Sram": 0}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
    ("ClearOverCurrent", {}),
    ("Reset", {}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
]


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_cubesense_session_matches_its_recording(unit: Harness, profile: str) -> None:
    lit(unit)
    as_recorded(unit, f"CubeSense session, {profile}", STEPS)


def test_cubesense_session_with_addressing_matches_its_recording() -> None:
    unit = Harness(CubeSenseSwitches.of("extended"), mcu_addressing=True)
    lit(unit)
    as_recorded(unit, "CubeSense session, addressed", STEPS[4:8])
