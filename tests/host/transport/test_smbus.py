import errno
import inspect
import os
import socket
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from smbus2 import SMBus, i2c_msg

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.i2cdev.direct import DirectI2c
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats.linux_i2c import MessageFlag
from cubestack.host.errors import PortClosedError, PortOpenError
from cubestack.host.transport.smbus import CubeSMBus, _find_socket

ADDRESS = 0x1A
GREETING = i2c_socket.packet(i2c_socket.reply(i2c_socket.VERSION))


class Echo:
    """Repeats the last written bytes."""

    def __init__(self) -> None:
        self.written = bytearray()
        self.log: list[bytes] = []
        self._position = 0

    def i2c_start(self, read: bool) -> None:
        self._position = 0
        if not read:
            self.written = bytearray()

    def i2c_write(self, byte: int) -> bool:
        self.written.append(byte)
        return byte != 0xEE

    def i2c_read(self) -> int:
        self._position += 1
        return self.written[(self._position - 1) % len(self.written)] if self.written else 0xFF

    def i2c_stop(self) -> None:
        self.log.append(bytes(self.written))


@pytest.fixture
def echo() -> Echo:
    return Echo()


@pytest.fixture
def bus(echo: Echo) -> CubeSMBus:
    kernel = Kernel()
    wire = I2cBus(kernel)
    wire.attach(ADDRESS, echo)
    return CubeSMBus(link=DirectI2c(kernel, wire))


def test_every_smbus2_method_is_overridden() -> None:
    for name, theirs in inspect.getmembers(SMBus, inspect.isfunction):
        if name.startswith("_") and name not in ("_set_address", "_get_funcs"):
            continue
        ours = getattr(CubeSMBus, name)
        assert ours is not theirs, name
        parameters = [list(inspect.signature(one).parameters) for one in (ours, theirs)]
        assert parameters[0] == parameters[1], name
    assert CubeSMBus.pec is not SMBus.pec


def test_smbus_transactions_return_device_data(bus: Any, echo: Echo) -> None:
    assert bus.read_byte_data(ADDRESS, 0x42) == 0x42
    assert bus.read_byte(ADDRESS) == 0x42
    assert bus.read_word_data(ADDRESS, 0x42) == 0x4242
    assert bus.read_i2c_block_data(ADDRESS, 7, 5) == [7] * 5
    assert bus.read_block_data(ADDRESS, 3) == [3] * 3
    assert bus.process_call(ADDRESS, 0x10, 0x3020) == 0x2010
    assert bus.block_process_call(ADDRESS, 2, [9, 8]) == [2, 9]
    echo.log.clear()
    bus.write_quick(ADDRESS)
    bus.write_byte(ADDRESS, 5)
    bus.write_byte_data(ADDRESS, 5, 0x1FF)
    bus.write_word_data(ADDRESS, 5, 0x1234)
    bus.write_block_data(ADDRESS, 5, [1, 2])
    bus.write_i2c_block_data(ADDRESS, 5, [1, 2])
    written = ["", "05", "05ff", "053412", "05020102", "050102"]
    assert [data.hex() for data in echo.log] == written


def test_i2c_rdwr_supports_combined_and_block_reads(bus: Any) -> None:
    write, read = i2c_msg.write(ADDRESS, [1, 2, 3]), i2c_msg.read(ADDRESS, 5)
    bus.i2c_rdwr(write, read)
    assert list(read) == [1, 2, 3, 1, 2]
    block = i2c_msg.read(ADDRESS, 33)
    block.flags |= MessageFlag.RECEIVE_LENGTH
    block.buf[0] = b"\1"
    bus.i2c_rdwr(i2c_msg.write(ADDRESS, [2, 7]), block)
    assert list(block) == [2, 7, 2]


def test_errors_match_the_linux_driver(bus: Any) -> None:
    for call, code in (
        (lambda: bus.read_byte(0x30), errno.ENXIO),
        (lambda: bus.write_byte(ADDRESS, 0xEE), errno.EIO),
        (lambda: bus.read_byte(0x80), errno.EINVAL),
        (lambda: bus.i2c_rdwr(i2c_msg.read(ADDRESS, 9000)), errno.EINVAL),
    ):
        with pytest.raises(OSError, match=rf"\[Errno {code}\]"):
            call()
    assert bus.read_byte_data(ADDRESS, 1) == 1


def test_rejects_blocks_longer_than_32_bytes(bus: Any) -> None:
    for write in (bus.write_block_data, bus.write_i2c_block_data, bus.block_process_call):
        with pytest.raises(ValueError, match="at most 32 bytes, not 33"):
            write(ADDRESS, 0, [0] * 33)
    with pytest.raises(ValueError, match="at most 32 bytes, not 33"):
        bus.read_i2c_block_data(ADDRESS, 0, 33)


def test_smbus_checks_packet_error_codes(bus: Any, echo: Echo) -> None:
    bus.pec = 1
    assert bus.pec == 1
    bus.write_byte(ADDRESS, 5)
    assert len(echo.log[-1]) == 2
    with pytest.raises(OSError, match="Bad message"):
        bus.read_byte_data(ADDRESS, 5)
    bus.enable_pec(False)
    assert bus.read_byte_data(ADDRESS, 5) == 5


def test_closed_bus_is_rejected(bus: Any) -> None:
    with bus:
        bus.read_byte(ADDRESS)
    with pytest.raises(PortClosedError, match=r"call open\(\) first"):
        bus.read_byte(ADDRESS)
    bus.close()
    assert CubeSMBus().fd is None
    with pytest.raises(TypeError, match="a number or a path"):
        bus.open(1.5)


@pytest.mark.parametrize("bus", [199, "/dev/i2c-199", "/no/such/socket"])
def test_missing_emulation_is_reported(bus: int | str) -> None:
    with pytest.raises(PortOpenError, match=r"no emulation serves .*(199|socket)"):
        CubeSMBus(bus)


@contextmanager
def answering(path: Path, *replies: bytes) -> Iterator[str]:
    """A socket that answers the requests of one client."""

    def answer() -> None:
        with listening.accept()[0] as connection:
            for data in replies:
                connection.recv(1 << 12)
                connection.sendall(data)

    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        listening.bind(str(path))
        listening.listen()
        serving = threading.Thread(target=answer)
        serving.start()
        yield str(path)
        serving.join()


@pytest.mark.parametrize("reply", [b"", b"\x01", b"\x10\x00\x00\x00abc"])
def test_emulation_that_ends_during_an_answer(tmp_path: Path, reply: bytes) -> None:
    with (
        answering(tmp_path / "bus", GREETING, reply) as path,
        pytest.raises(PortClosedError, match="the emulation has ended"),
    ):
        CubeSMBus(path)


def test_emulation_of_another_version_is_reported(tmp_path: Path) -> None:
    refusal = i2c_socket.packet(i2c_socket.reply(-errno.EPROTO, b"this is version 2"))
    with (
        answering(tmp_path / "bus", refusal) as path,
        pytest.raises(PortOpenError, match="bus refuses: this is version 2"),
    ):
        CubeSMBus(path)


def test_open_bus_has_a_file_descriptor(tmp_path: Path) -> None:
    reply = i2c_socket.packet(i2c_socket.reply(0, bytes(8)))
    with answering(tmp_path / "bus", GREETING, reply) as path:
        bus = CubeSMBus(path)
    assert stat.S_ISSOCK(os.fstat(bus.fd).st_mode)
    bus.close()
    assert bus.fd is None


@pytest.mark.parametrize(
    ("around", "number", "own"),
    [("7", "7", True), ("7", "8", False), (None, "7", False), ("7", None, False)],
)
def test_program_under_run_uses_its_bus(
    monkeypatch: pytest.MonkeyPatch, around: str | None, number: str | None, own: bool
) -> None:
    for name, value in (("BUS", around), ("SOCKET", "/the/socket" if number else None)):
        if value is None:
            monkeypatch.delenv(f"CUBESTACK_I2C_{name}", raising=False)
        else:
            monkeypatch.setenv(f"CUBESTACK_I2C_{name}", value)
    wanted = int(number or 7)
    served = Path("/the/socket") if own else i2c_socket.socket_path(wanted)
    assert _find_socket(wanted) == _find_socket(f"/dev/i2c-{wanted}") == served
    assert _find_socket("/some/where") == Path("/some/where")
