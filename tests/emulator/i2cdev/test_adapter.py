"""The adapter: ends of transfers, told at once or when wall time gets there."""

import errno
from functools import partial
from itertools import chain, repeat

import pytest

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.device_file import DeviceFile
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.formats.i2c_socket import Call, pack_ioctl, reply
from cubestack.firmware_model.formats.linux_i2c import Ioctl

from .conftest import Registers

BIT_PS = 2_500_000
AGAIN = -errno.EAGAIN


def test_adapter_reports_completions_in_virtual_time(kernel, adapter):
    told: list[tuple[int, int]] = []
    for _ in range(2):
        adapter.submit([I2cMessage(0x1A, read=1)], lambda result: told.append((result, kernel.now)))
    assert adapter.busy
    kernel.run()
    transfer = (1 + 2 * 9 + 1) * BIT_PS
    assert told == [(0, transfer), (0, 2 * transfer)]
    assert (adapter.busy, adapter.answered) == (False, 2)


def test_held_completions_are_released_at_their_wire_time(kernel, adapter):
    told: list[int] = []
    adapter.holding = True
    for _ in range(2):
        adapter.submit([I2cMessage(0x1A, read=1)], told.append)
    kernel.run()
    transfer = (1 + 2 * 9 + 1) * BIT_PS
    assert not adapter.busy
    for time_ps, count, due_ps in (
        (transfer - 1, 0, transfer),
        (transfer, 1, 2 * transfer),
        (10 * transfer, 2, None),
    ):
        adapter.release(time_ps)
        assert (told, adapter.release_ps()) == ([0] * count, due_ps)


@pytest.mark.parametrize(
    ("retries", "timeout", "tries", "result"),
    [(0, 100, 1, AGAIN), (2, 100, 3, AGAIN), (9, 100, 4, 0), (9, 0, 1, AGAIN)],
)
def test_lost_arbitration_is_retried_within_retries_and_timeout(
    kernel, bus, adapter, retries, timeout, tries, result
):
    """As Linux's core does for drivers that report EAGAIN; both settings by ioctl."""
    plain, tried = bus.transfer, []

    def transfer(messages):
        tried.append(kernel.now)
        yield kernel.timeout(1)
        if len(tried) < 4:
            raise I2cError(errno.EAGAIN, "another master was quicker")
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


def outcome(kernel, adapter, registers, run):
    told: list[tuple[int, int]] = []
    for messages in (
        [I2cMessage(0x1A, bytearray(40)), I2cMessage(0x1A, read=30)],
        [I2cMessage(0x30)],
        [I2cMessage(0x1A, bytearray([0xF0, 1, 2])), I2cMessage(0x1A, read=1)],
    ):
        adapter.submit(messages, lambda result: told.append((result, kernel.now)))
    run()
    assert not adapter.busy
    return told, registers.log


@pytest.mark.parametrize(("patience", "steps"), [(0, 1), (0, 5), (1, 0), (1, 1), (3, 7), (100, 0)])
def test_driven_transfers_equal_scheduled_transfers(patience, steps):
    """Also when the kernel is run by others between two drives."""

    def make():
        kernel, registers = Kernel(), Registers()
        bus = I2cBus(kernel)
        bus.attach(0x1A, registers)
        return kernel, I2cAdapter(kernel, bus), registers

    kernel, adapter, registers = make()
    expected = outcome(kernel, adapter, registers, kernel.run)
    kernel, adapter, registers = make()
    adapter.driven = True

    def run():
        while adapter.busy:
            answers = chain(repeat(True, patience), repeat(False))
            adapter.drive(partial(next, answers))
            for _ in range(steps):
                if kernel.horizon() is not None:
                    kernel.step()

    assert outcome(kernel, adapter, registers, run) == expected


def test_driven_adapter_begins_one_transfer_per_drive(kernel, adapter):
    adapter.driven = True
    assert not adapter.begins_transfer
    adapter.drive(lambda: True)
    adapter.submit([I2cMessage(0x1A)], lambda _result: None)
    assert adapter.begins_transfer
    adapter.drive(lambda: True)
    assert not adapter.begins_transfer
    assert not adapter.busy
