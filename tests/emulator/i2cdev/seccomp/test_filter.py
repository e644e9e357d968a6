"""The seccomp filter, run by an interpreter of its own: which calls it sends to the supervisor."""

import re
import struct
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.seccomp.filter import ABIS, ON_DESCRIPTOR, ON_PATH, Abi, make_filter
from cubestack.firmware_model.formats.linux_i2c import Ioctl

NUMBERS = range(960, 1024)
ALLOW, NOTIFY = 0x7FFF0000, 0x7FC00000


def decide(abi: Abi, call: int, *arguments: int, arch: int | None = None) -> int:
    """The filter's return value, by the classic BPF instructions that it uses."""
    data = struct.pack("<iIQ", call, abi.audit_arch if arch is None else arch, 0)
    data += struct.pack("<6Q", *(n & (1 << 64) - 1 for n in (*arguments, *[0] * 6)[:6]))
    program = list(struct.iter_unpack("=HBBI", make_filter(abi, NUMBERS)))
    position = accumulator = 0
    while True:
        code, if_true, if_false, operand = program[position]
        position += 1
        match code:
            case 0x20:
                accumulator = struct.unpack_from("<I", data, operand)[0]
            case 0x15:
                position += if_true if accumulator == operand else if_false
            case 0x35:
                position += if_true if accumulator >= operand else if_false
            case 0x45:
                position += if_true if accumulator & operand else if_false
            case 0x06:
                return int(operand)
            case _:
                raise AssertionError(f"no such step: {code:#x}")


@pytest.fixture(params=ABIS.values(), ids=ABIS)
def abi(request: pytest.FixtureRequest) -> Abi:
    return request.param


def test_calls_with_a_path(abi: Abi):
    assert len(make_filter(abi, NUMBERS)) // 8 < 255  # jumps fit
    for name in abi.calls.keys() & set(ON_PATH):
        assert decide(abi, abi.calls[name], 3, 0x1000) == NOTIFY, name


def test_requests_of_ioctl(abi: Abi):
    ours = {int(number) for number in Ioctl}
    for number in [*range(0x06F0, 0x0740), 0x5401, 0x10703, 0xC0020703]:
        expected = NOTIFY if number in ours else ALLOW
        assert decide(abi, abi.calls["ioctl"], 5, number) == expected, hex(number)
    # Some programs sign-extend the request.
    assert decide(abi, abi.calls["ioctl"], 5, 0xFFFFFFFF_00000703) == NOTIFY


@pytest.mark.parametrize("number", [-1, 0, 1, 2, 959, 960, 1000, 1023, 1024, 2**31])
def test_calls_with_a_descriptor(abi: Abi, number: int):
    expected = NOTIFY if number in NUMBERS else ALLOW
    for name in abi.calls.keys() & set(ON_DESCRIPTOR):
        assert decide(abi, abi.calls[name], number) == expected, name


@pytest.mark.parametrize(("command", "sent"), [(0, True), (1030, True), (1, False), (3, False)])
def test_copies_by_fcntl(abi: Abi, command: int, sent: bool):
    assert decide(abi, abi.calls["fcntl"], 970, command) == (NOTIFY if sent else ALLOW)
    assert decide(abi, abi.calls["fcntl"], 7, command) == ALLOW


def test_fstat_by_an_empty_path(abi: Abi):
    call = abi.calls["newfstatat"]
    assert decide(abi, call, 970, 0x1000, 0x2000, 0x1000) == NOTIFY
    assert decide(abi, call, 7, 0x1000, 0x2000, 0x1000) == ALLOW
    assert decide(abi, call, 7, 0x1000, 0x2000, 0x100) == NOTIFY  # a path


def test_everything_else_passes(abi: Abi):
    for call in set(range(450)) - set(abi.calls.values()):
        assert decide(abi, call, 970, 0x0703) == ALLOW, call
    # Other processors, and their numbers.
    assert decide(abi, abi.calls["openat"], arch=0x40000003) == ALLOW  # i386
    assert decide(abi, abi.calls["openat"] | 0x40000000) == ALLOW  # x32


@pytest.mark.parametrize(
    ("machines", "header"),
    [
        (("x86_64",), "x86_64-linux-gnu/asm/unistd_64.h"),
        (("aarch64", "riscv64"), "asm-generic/unistd.h"),
    ],
)
def test_numbers_are_those_of_the_kernel_s_headers(machines: tuple[str, ...], header: str):
    path = Path("/usr/include", header)
    if not path.exists():
        pytest.skip(f"no {path}")
    text = path.read_text()
    numbers = re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", text)
    found = {name: int(number) for name, number in numbers}
    found.setdefault("newfstatat", found.get("fstatat", -1))  # by a macro
    for machine in machines:
        abi = ABIS[machine]
        calls = {**abi.calls, "seccomp": abi.seccomp}
        assert calls == {name: found[name] for name in calls}
