"""Semihosting: console, clock and exit, by BKPT 0xAB."""

import struct

import pytest

from .bench import RAM, STOP, Bench

BLOCK = RAM + 0x100
TEXT = RAM + 0x200


def call(operation: int, parameter: int = BLOCK, words: tuple[int, ...] = (), text: bytes = b""):
    """One call; the bench after it."""
    program = f"ldr r0, ={operation}; ldr r1, ={parameter}; bkpt #0xAB; b ."
    bench = Bench(program, semihosting=True)
    block = struct.pack(f"<{len(words)}I", *words)
    bench.ram[0x100 : 0x100 + len(block)] = list(block)
    bench.ram[0x200 : 0x200 + len(text)] = list(text)
    bench.reason = bench.run(100)
    return bench


@pytest.mark.parametrize(
    ("operation", "parameter", "words", "text", "printed", "result"),
    [
        (0x03, TEXT, (), b"xy", "x", 0),
        (0x04, TEXT, (), b"hello\0there", "hello", 0),
        (0x05, BLOCK, (2, TEXT, 3), b"hello", "hel", 0),
        (0x05, BLOCK, (3, TEXT, 3), b"hello", "!hel", 0),
        (0x05, BLOCK, (2, 0x3000_0000, 3), b"", "", 3),
        (0x01, BLOCK, (TEXT, 0, 3), b":tt\0", "", 1),
        (0x01, BLOCK, (TEXT, 4, 3), b":tt\0", "", 2),
        (0x01, BLOCK, (TEXT, 8, 3), b":tt\0", "", 3),
        (0x01, BLOCK, (TEXT, 0, 5), b"a.txt\0", "", 0xFFFF_FFFF),
        (0x02, BLOCK, (1,), b"", "", 0),
        (0x07, 0, (), b"", "", ord("?")),
        (0x09, BLOCK, (1,), b"", "", 1),
        (0x08, BLOCK, (0xFFFF_FFFF,), b"", "", 1),
        (0x31, 0, (), b"", "", 1_000_000),
        (0x99, 0, (), b"", "", 0xFFFF_FFFF),
    ],
)
def test_semihosting_call_prints_and_returns_its_result(
    operation, parameter, words, text, printed, result
):
    bench = call(operation, parameter, words, text)
    assert (bench.text, bench["r0"], bench.ipsr) == (printed, result, 0)


def test_semihosting_read_fills_memory():
    bench = call(0x06, BLOCK, (1, TEXT, 4))
    assert (bytes(bench.ram[0x200:0x205]), bench["r0"]) == (b"????\0", 0)


@pytest.mark.parametrize(
    ("operation", "parameter", "words", "code"),
    [(0x18, 0x20026, (), 0), (0x18, 0x20023, (), 1), (0x20, BLOCK, (0x20026, 42), 42)],
)
def test_exit_stops_the_run(operation, parameter, words, code):
    bench = call(operation, parameter, words)
    assert bench.reason & STOP
    assert bench["exit_code"] == code


def test_semihosting_breakpoint_faults_when_disabled():
    bench = Bench("bkpt #0xAB; @3: b .")
    bench.run(50)
    assert bench.ipsr == 3
