"""The PIC18's compiled costs: the model's charges and the documentation agree with the file."""

import os
from pathlib import Path

import pytest

from cubestack.firmware_model.mcu.compiled import compiled_costs
from cubestack.firmware_model.mcu.pic18 import pic18f45k20
from tests.compiled_costs import pages, pic18
from tests.compiled_costs.pic18_charges import charged_cycles

#: Folder of build_pic18.sh, if its compiler is to be run.
FOLDER = os.environ.get("PIC18_COMPILER", "")


@pytest.mark.parametrize("routine", charged_cycles(pic18f45k20()))
def test_charges_of_a_printed_routine_equal_the_compiled_code_within_25_percent(
    routine: str,
) -> None:
    charged = charged_cycles(pic18f45k20(library="compiled"))[routine]
    assert charged == pytest.approx(compiled_costs("pic18").routines[routine], rel=0.25)


@pytest.mark.parametrize("table", pic18.tables().items(), ids=lambda table: table[0])
def test_page_has_the_table_of_the_data_file(table: tuple[str, str]) -> None:
    assert pages.has(pic18.PAGE, table[1])


@pytest.mark.skipif(not FOLDER, reason="PIC18_COMPILER does not name the folder of build_pic18.sh")
def test_compiler_and_simulator_repeat_the_data_file() -> None:
    assert pic18.measure(Path(FOLDER)) == compiled_costs("pic18")
