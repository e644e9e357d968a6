"""The adapter: ends of transfers, told at once or when wall time gets there."""

from cubestack.emulator.i2c import I2cMessage

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
