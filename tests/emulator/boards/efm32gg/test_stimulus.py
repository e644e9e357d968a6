from pathlib import Path

import pytest

from cubestack.emulator.boards.efm32gg.stimulus import Stimulus

HEAD = "$timescale 10 us $end $var wire 1 ! PB9 $end $var wire 1 # PA0 $end $enddefinitions $end\n"


def load(folder: Path, text: str) -> Stimulus:
    path = folder / "press.vcd"
    path.write_text(text)
    return Stimulus.load(path)


def test_changes_have_times_in_ps(tmp_path: Path) -> None:
    stimulus = load(tmp_path, HEAD + "#0 1! z# #3 0! 1# #7 x!")
    assert stimulus.changes == (
        (0, "PB9", 1),
        (0, "PA0", -1),
        (30_000_000, "PB9", 0),
        (30_000_000, "PA0", 1),
        (70_000_000, "PB9", -1),
    )


WRONG = {
    HEAD.replace("PB9", "BUTTON") + "#0 1!": r"press.vcd has the variable BUTTON; it must be a pin",
    HEAD.replace("wire 1 !", "wire 2 !") + "#0 1!": r"PB9 of 2 bits; a pin has one$",
    HEAD.replace("PA0", "PB9") + "#0 1!": r"the variable PB9 twice; a pin has one$",
    "int main(void) {}": r"press.vcd is no VCD file",
    HEAD: r"press.vcd has no changes$",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_files_are_one_line(text: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=WRONG[text]):
        load(tmp_path, text)
