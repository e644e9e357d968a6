import re
from pathlib import Path

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS

from ..harness import Harness

PAGE = Path(__file__).parents[4] / "docs" / "sensors" / "protocols-cubesense.md"
WRITE, READ = REGISTERS.i2c_address << 1, REGISTERS.i2c_address << 1 | 1
IMAGE = REGISTERS["IMAGE"].address
THRESHOLD = REGISTERS["SUN_THRESHOLD"].address


@pytest.fixture
def unit() -> Harness:
    return Harness()


def said(unit: Harness, *message: int) -> bytes:
    for byte in message:
        unit.program.backup.uart_byte(byte)
    answer = bytes(unit.sent)
    unit.sent.clear()
    return answer


def test_example_of_the_page(unit: Harness) -> None:
    (block,) = re.findall(r"```registers\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    lines = block.splitlines()
    for request, answer in zip(lines[::2], lines[1::2], strict=True):
        given = bytes.fromhex(request.removeprefix("-> "))
        assert said(unit, *given).hex(" ") == answer[2:].strip(), request
    unit.run()
    assert said(unit, READ, 0x28) == bytes([codes.CaptureResult.STORED_OWN_SRAM])


def test_every_number_is_that_of_i2c(unit: Harness) -> None:
    for register in REGISTERS:
        if register.readable and not register.streams:
            expected = unit.read_register(register.length, register.address)
            assert said(unit, READ, register.address) == expected
        elif not register.readable:
            assert said(unit, READ, register.address) == b""
    assert said(unit, READ, 0xEE) == b""


def test_what_can_not_be_written_is_ignored(unit: Harness) -> None:
    before = [said(unit, READ, r.address) for r in REGISTERS if r.readable and not r.streams]
    for address, value in ((0x20, 1), (0x05, 2), (0xEE, 1), (IMAGE, 1)):
        assert said(unit, WRITE, address, value) == b""
    after = [said(unit, READ, r.address) for r in REGISTERS if r.readable and not r.streams]
    assert after == before


def test_noise_and_half_messages(unit: Harness) -> None:
    assert said(unit, 0x00, 0x1F, WRITE - 2, READ, THRESHOLD) == b"\xe1"
    said(unit, WRITE, THRESHOLD)
    unit.program.backup.uart_silence()
    assert said(unit, READ, THRESHOLD) == b"\xe1"
    said(unit, WRITE, THRESHOLD, WRITE)  # data may look like an address
    assert said(unit, READ, THRESHOLD) == bytes([WRITE])


def test_a_picture_and_what_ends_it(unit: Harness) -> None:
    rng = np.random.default_rng(1)
    for sram in codes.Sram:
        unit.memories[sram] = rng.integers(0, 256, (480, 640), np.uint8)
    said(unit, READ, IMAGE)
    unit.run()
    assert bytes(unit.sent) == unit.memories[codes.Sram.SRAM1].tobytes()
    unit.sent.clear()
    said(unit, WRITE, REGISTERS["IMAGE_SRAM"].address, 1)
    said(unit, READ, IMAGE)
    unit.run(unit.now_us + 20_000)
    part = bytes(unit.sent)
    assert unit.memories[codes.Sram.SRAM2].tobytes().startswith(part)
    unit.sent.clear()
    assert said(unit, READ, THRESHOLD)[-1:] == b"\xe1"
    unit.run()
    assert len(part) < 307_200
    assert len(unit.sent) < 100
