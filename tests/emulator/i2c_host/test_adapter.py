"""The adapter: ends of transfers, told at once or when wall time gets there."""

import errno

import pytest

from cubestack.emulator.i2c import I2cMessage, I2cNackError
from cubestack.emulator.i2c_host.device_file import DeviceFile
from cubestack.firmware_model.interface.linux_i2c import Call, Ioctl, pack_ioctl, reply

BIT_PS = 2_500_000


def test_ends_are_told_in_virtual_time(kernel, adapter):
    told: list[tuple[int, int]] = []
    for _ in range(2):
        adapter.submit([I2cMessage(0x1A, read=1)], lambda result: told.append((result, kernel.now)))
    assert adapter.busy
    kernel.run()
    transfer = (1 + 2 * 9 + 1) * BIT_PS
    assert told == [(0, transfer), (0, 2 * transfer)]
    assert not adapter.busy
    assert adapter.told == 2


def test_ends_that_are_held(kernel, adapter):
    told: list[int] = []
    adapter.holding = True
    for _ in range(2):
        adapter.submit([I2cMessage(0x1A, read=1)], told.append)
    kernel.run()
    transfer = (1 + 2 * 9 + 1) * BIT_PS
    assert (told, adapter.busy, adapter.release_ps()) == ([], False, transfer)
    adapter.release(transfer - 1)
    assert told == []
    adapter.release(transfer)
    assert (told, adapter.release_ps()) == ([0], 2 * transfer)
    adapter.release(10 * transfer)
    assert (told, adapter.release_ps()) == ([0, 0], None)


def test_the_bus_is_free_after_a_refusal(kernel, adapter):
    told: list[int] = []
    adapter.submit([I2cMessage(0x30)], told.append)
    adapter.submit([I2cMessage(0x1A)], told.append)
    kernel.run()
    assert told == [-6, 0]


@pytest.mark.parametrize(
    ("retries", "timeout", "tries", "result"),
    [
        (0, 100, 1, -errno.EAGAIN),
        (2, 100, 3, -errno.EAGAIN),
        (9, 100, 4, 0),
        (9, 0, 1, -errno.EAGAIN),
    ],
)
def test_a_lost_bus_is_tried_again(kernel, bus, adapter, retries, timeout, tries, result):
    """As Linux's core does for drivers that report EAGAIN; both settings by ioctl."""
    plain, tried = bus.transfer, []

    def transfer(messages):
        tried.append(kernel.now)
        yield kernel.timeout(1)
        if len(tried) < 4:
            raise I2cNackError(errno.EAGAIN, "another master was quicker")
        yield from plain(messages)

    bus.transfer = transfer
    file, replies = DeviceFile(adapter), []
    file.perform(Call.IOCTL, pack_ioctl(Ioctl.RETRIES, retries), replies.append)
    file.perform(Call.IOCTL, pack_ioctl(Ioctl.TIMEOUT, timeout), replies.append)
    assert replies == [reply(0)] * 2
    told: list[int] = []
    adapter.submit([I2cMessage(0x1A)], told.append)
    kernel.run()
    assert (len(tried), told) == (tries, [result])
