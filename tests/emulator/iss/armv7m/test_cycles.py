"""Cycles of instruction sequences, within 10 % of what public sources state."""

import pytest

from tests.emulator.iss.cross_compiler import binary_of, compile_for_m3, needs_compiler

from .bench import LOG, RAM, Bench
from .cycle_sequences import SEQUENCES, Sequence

DATA = RAM + 0x1000
TOLERANCE = 0.1


def cycles(code: bytes) -> int:
    """Cycles of NOPs, the code and more NOPs, up to the data phase of a store.

    r0, r1, r3 point to memory and r10 to a pointer; r2 is a small offset; r4, r7 and r9 are small,
    r5 is large, r8 all ones, r12 zero; r11 and the word at r0 + 64 are the address after the code.
    """
    halves = ", ".join(f"{half:#x}" for half in memoryview(code).cast("H"))
    written = f".short {halves}" if code else ""
    bench = Bench(f"nop #12; {written}; after: nop #8; str r6, [r6]; b .")
    after = bench.labels["after"]
    registers = (DATA, DATA + 0x100, 4, DATA + 0x200, 5, 0x12345678, LOG, 3, 0xFFFFFFFF, 1)
    for number, value in enumerate((*registers, DATA + 0x50, after | 1, 0)):
        bench[f"r{number}"] = value
    bench.ram[0x1040:0x1044] = list((after | 1).to_bytes(4, "little"))
    bench.ram[0x1050:0x1054] = list((DATA + 0x80).to_bytes(4, "little"))
    bench.run(2000)
    return bench.log[0].cycle


@pytest.mark.parametrize("sequence", SEQUENCES, ids=lambda sequence: sequence.name)
def test_sequence_takes_the_published_cycles(sequence: Sequence):
    taken = cycles(bytes.fromhex(sequence.code)) - cycles(b"")
    assert sequence.least * (1 - TOLERANCE) <= taken <= sequence.most * (1 + TOLERANCE), (
        f"{taken} cycles; {sequence.source}: {sequence.least} to {sequence.most}"
    )


def test_40_sequences_are_compared():
    assert len(SEQUENCES) >= 40


@needs_compiler
def test_code_is_the_assembled_text(tmp_path):
    text = [".syntax unified"]
    for number, sequence in enumerate(SEQUENCES):  # each from a multiple of 64
        text += [f".org {64 * number}", sequence.text.replace("; ", "\n")]
    source, built = tmp_path / "sequences.s", tmp_path / "sequences.o"
    source.write_text("\n".join(text) + "\n")
    compile_for_m3("-c", source, "-o", built)
    image = binary_of(built)
    for number, sequence in enumerate(SEQUENCES):
        code = bytes.fromhex(sequence.code)
        assert image[64 * number :][: len(code)] == code, sequence.name
