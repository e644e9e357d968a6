"""The Blackfin's compiled costs: the documentation agrees with the data file, stalls with rules."""

import os
from pathlib import Path

import pytest

from cubestack.firmware_model.mcu.compiled import compiled_costs
from tests.compiled_costs import blackfin, pages

#: Folder of build_blackfin.sh, if its compiler is to be run.
FOLDER = os.environ.get("BLACKFIN_COMPILER", "")


@pytest.mark.parametrize("table", blackfin.tables().items(), ids=lambda table: table[0])
def test_page_has_the_table_of_the_data_file(table: tuple[str, str]) -> None:
    assert pages.has(blackfin.PAGE, table[1])


@pytest.mark.parametrize(
    ("instructions", "stalls"),
    [
        (["P0 = [P1];", "R0 = [P0];"], 3),
        (["P0 = [P1];", "R1 = R2;", "R0 = W[P0] (Z);"], 2),
        (["P0 = [P1];", *["R1 = R2;"] * 3, "[P0] = R0;"], 0),
        (["P0 = R1;", "JUMP (P0);"], 4),
        (["P0 = R1;", "P0 += 4;", "R0 = [P0];"], 3),
        (["P0 = P2 + P1;", "R0 = [P0];"], 0),
        (["R0 = [P1];", "R1 = R0 + R0;"], 0),
    ],
)
def test_address_registers_stall_as_the_manufacturers_note_says(
    instructions: list[str], stalls: int
) -> None:
    trace = [f"insn:     0x000010                       -{one}" for one in instructions]
    ((found, _),) = blackfin.between_readings([*trace, "R0 = CYCLES;"], {})
    assert found == stalls


def test_calls_of_the_library_are_counted_by_their_entries() -> None:
    entries = blackfin.library_entries("000024f8 T ___addsf3\n00002538 T ___subsf3\n0000 T _main")
    trace = ["insn:     0x0024f8   -A", "insn:     0x002538   -B", "insn:     0x002540   -C"]
    ((_, calls),) = blackfin.between_readings([*trace, "R0 = CYCLES;"], entries)
    assert calls == {"f32_add": 2}


@pytest.mark.skipif(not FOLDER, reason="BLACKFIN_COMPILER is not the folder of build_blackfin.sh")
def test_compiler_and_simulator_repeat_the_data_file() -> None:
    assert blackfin.measure(Path(FOLDER)) == compiled_costs("blackfin")
