"""Numbers that device files get in a program, and arguments of type int."""

import resource

import pytest

from cubestack.emulator.i2cdev.seccomp import supervisor


@pytest.mark.parametrize(
    ("soft", "first", "end"),
    [
        (resource.RLIM_INFINITY, 960, 1024),
        (1 << 20, 960, 1024),
        (1025, 960, 1024),
        (1024, 960, 1024),
        (1023, 959, 1023),
        (256, 192, 256),
        (68, 4, 68),
        (67, 3, 67),
        (20, 3, 20),
    ],
)
def test_device_files_get_the_last_numbers_that_a_process_and_select_may_use(
    monkeypatch: pytest.MonkeyPatch, soft: int, first: int, end: int
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _which: (soft, soft))
    assert supervisor.descriptor_range() == range(first, end)


@pytest.mark.parametrize("value", [0, 1, 3, 100, 2**31 - 1, -1, -100, -(2**31)])
def test_an_int_comes_in_the_low_half_of_an_argument(value: int) -> None:
    for rest in (0, 0xFFFF_FFFF, 0x1234_5678):
        assert supervisor._signed(rest << 32 | value & 0xFFFF_FFFF) == value
