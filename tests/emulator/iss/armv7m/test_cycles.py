"""Cycle counts of sequences that public sources state: within 10 % of each."""

import shutil
import subprocess

import pytest

from .bench import LOG, RAM, Bench
from .cycle_sequences import SEQUENCES, Sequence
from .thumb import Program

DATA = RAM + 0x1000
TOLERANCE = 0.1

ASSEMBLER = shutil.which("arm-none-eabi-as")


def cycles(code: bytes) -> int:
    """Of some NOPs, the code and a few more, up to a store's data phase.

    r0, r1, r3 point to memory and r10 to a pointer there; r2 is a small offset; r4, r7 and r9 are
    small, r5 is large, r8 all ones, r12 zero; r11 and the word at r0 + 64 lead behind the code.
    """
    program = Program()
    program.nop(12)
    for at in range(0, len(code), 2):
        program.half(int.from_bytes(code[at : at + 2], "little"))
    behind = program.nop(8)
    program.str(6, 6)
    program.forever()
    bench = Bench(program.finish())
    registers = (DATA, DATA + 0x100, 4, DATA + 0x200, 5, 0x12345678, LOG, 3, 0xFFFFFFFF, 1)
    for number, value in enumerate((*registers, DATA + 0x50, behind | 1, 0)):
        bench[f"r{number}"] = value
    bench.ram[0x1040:0x1044] = list((behind | 1).to_bytes(4, "little"))
    bench.ram[0x1050:0x1054] = list((DATA + 0x80).to_bytes(4, "little"))
    bench.run(2000)
    return bench.log[0].cycle


@pytest.mark.parametrize("sequence", SEQUENCES, ids=lambda sequence: sequence.name)
def test_cycles(sequence: Sequence):
    taken = cycles(bytes.fromhex(sequence.code)) - cycles(b"")
    assert sequence.least * (1 - TOLERANCE) <= taken <= sequence.most * (1 + TOLERANCE), (
        f"{taken} cycles; {sequence.source} says {sequence.least} to {sequence.most}"
    )


def test_there_are_enough_of_them():
    assert len(SEQUENCES) >= 40


@pytest.mark.skipif(ASSEMBLER is None, reason="no arm-none-eabi-as")
def test_code_is_what_the_text_says(tmp_path):
    lines = [".syntax unified", ".cpu cortex-m3", ".thumb"]
    for number, sequence in enumerate(SEQUENCES):
        lines += [f'.section .text.s{number:02},"ax"', ".p2align 2", f"begin{number}:"]
        lines += [sequence.text.replace("; ", "\n"), f"end{number}:"]
    program = tmp_path / "sequences.o"
    source = "\n".join(lines) + "\n"
    subprocess.run([ASSEMBLER, "-o", program, "-"], input=source.encode(), check=True)
    for number, sequence in enumerate(SEQUENCES):
        section = tmp_path / "section"
        subprocess.run(
            [
                "arm-none-eabi-objcopy",
                "-O",
                "binary",
                "-j",
                f".text.s{number:02}",
                program,
                section,
            ],
            check=True,
        )
        code = bytes.fromhex(sequence.code)
        assert section.read_bytes()[: len(code)] == code, sequence.name
