import logging

import pytest

from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.firmware_model.interface.cameras import mt9m001
from cubestack.firmware_model.interface.cameras import registers as table

MODE = table.CameraRegister(0x10, "MODE", 1, "").of(
    table.BitField("ON", 0, 1, ""), table.BitField("ODD", 1, 1, "", False)
)
RATE = table.CameraRegister(0x11, "RATE", 0x0203, "", width=2, needs_sync=True)
FANCY = table.CameraRegister(0x13, "FANCY", 0, "", modelled=False)
CHIP = table.CameraRegister(0x14, "CHIP", 0x42, "", access=table.RegisterAccess.READ_ONLY)


@pytest.fixture
def registers() -> RegisterFile:
    return RegisterFile(table.CameraRegisterMap("TEST1", 0x21, 1, (MODE, RATE, FANCY, CHIP)))


def test_reset_values_can_be_read_in_order_and_the_pointer_wraps(registers: RegisterFile) -> None:
    registers.select(0x10)
    assert [registers.read() for _ in range(5)] == [1, 2, 3, 0, 0x42]
    assert registers.active("RATE") == 0x0203
    registers.select(0xFF)
    registers.read()
    assert registers.read() == 0  # address 0x00


def test_register_takes_effect_at_once_or_at_sync(registers: RegisterFile) -> None:
    registers.select(0x10)
    assert [registers.write(b) for b in (0, 0xAB, 0xCD)] == [MODE, RATE, RATE]
    assert (registers.active("MODE"), registers.active("RATE")) == (0, 0x0203)
    registers.select(0x11)
    assert [registers.read(), registers.read()] == [0xAB, 0xCD]  # reads what was written
    registers.sync()
    assert registers.active("RATE") == 0xABCD
    registers.reset()
    assert (registers.active("MODE"), registers.active("RATE")) == (1, 0x0203)
    registers.store("RATE", 0x1234)  # by the camera: at once
    registers.select(0x11)
    assert (registers.active("RATE"), registers.read()) == (0x1234, 0x12)


@pytest.mark.parametrize(
    ("address", "byte", "level", "text"),
    [
        (0x13, 1, logging.INFO, "wrote FANCY, which is not modelled"),
        (0x10, 0x03, logging.INFO, "set ODD of MODE, which is not modelled"),
        (0x10, 0x81, logging.WARNING, "set bits 0x80 of MODE, which are not known"),
        (0x14, 0x00, logging.WARNING, "wrote to CHIP, which is read-only"),
        (0x30, 0x05, logging.WARNING, "wrote 0x05 to 0x0030, where no register is known"),
    ],
)
def test_logs_unmodelled_writes(
    registers: RegisterFile,
    caplog: pytest.LogCaptureFixture,
    address: int,
    byte: int,
    level: int,
    text: str,
) -> None:
    with caplog.at_level(logging.INFO):
        registers.select(address)
        registers.write(byte)
    assert [(r.levelno, r.message) for r in caplog.records] == [(level, f"TEST1: {text}")]


def test_logs_unmodelled_reads(registers: RegisterFile, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        registers.select(0x10)
        registers.write(1)  # which is modelled
        registers.select(0x13)
        assert [registers.read(), registers.read(), registers.read()] == [0, 0x42, 0]
    assert caplog.messages == [
        "TEST1: read FANCY, which is not modelled",
        "TEST1: read 0x0015, where no register is known",
    ]


def test_sixteen_bit_registers_use_one_address() -> None:
    registers = RegisterFile(mt9m001.REGISTERS)
    registers.select(0x09)
    assert registers.read() == 0x0419
    registers.select(0x09)
    assert registers.write(0xBEEF) is mt9m001.REGISTERS["SHUTTER_WIDTH"]
    assert registers.active("SHUTTER_WIDTH") == 0xBEEF
    registers.store("CHIP_VERSION", 0x1234)
    assert registers.active("CHIP_VERSION") == 0x1234
    assert mt9m001.REGISTERS["SHUTTER_WIDTH"].units(0xBEEF) == [0xBEEF]
