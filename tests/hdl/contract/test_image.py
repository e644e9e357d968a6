"""What a design keeps of a frame, as a user's module says it."""

from pathlib import Path

import pytest

from cubestack.hdl.contract.cubestar.declared import CONTRACT
from cubestack.hdl.contract.design import Design
from cubestack.hdl.contract.image import load_image
from cubestack.hdl.user import GatewareError

UPSIDE_DOWN = """
def stored(frame):
    return [[int(pixel) for pixel in row] for row in frame[::-1]]
def presented(memory):
    return memory[::-1]
"""


def image(tmp_path, name, text):
    (tmp_path / f"{name}.py").write_text(text)
    return load_image(name, 4, 2, tmp_path)


def test_image_of_a_module_is_what_its_functions_return(tmp_path):
    kept = image(tmp_path, "upside_down", UPSIDE_DOWN)
    frame = bytes(range(8))
    assert kept.stored(frame) == [4, 5, 6, 7, 0, 1, 2, 3]
    assert kept.presented(bytes(kept.stored(frame))) == frame
    assert kept.holds(bytes([4, 5]), frame)
    assert not kept.holds(frame, frame)


def test_shipped_image_is_the_frame():
    kept = load_image("", 4, 2)
    assert kept.stored(b"\0\1") == [0, 1]
    assert kept.presented(b"\0\1") == b"\0\1"


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("no_stored", "", "--image no_stored: the module has no function stored"),
        ("raises", "import nothing_here", "--image raises: ModuleNotFoundError: No module named"),
        ("floats", UPSIDE_DOWN.replace("int", "float"), "floats.stored must return 2 rows of 4"),
        ("far", UPSIDE_DOWN.replace("int(", "256 + int("), "integers from -1 to 255"),
        (
            "flat",
            UPSIDE_DOWN.replace("memory[:", "memory[0][:"),
            "flat.presented must return 2 rows",
        ),
    ],
)
def test_wrong_module_is_one_line(tmp_path: Path, name: str, text: str, message: str):
    with pytest.raises(GatewareError, match=message):
        image(tmp_path, name, text)


def test_design_of_one_size_needs_parameters_for_an_image():
    design = Design(CONTRACT, "a.v", image="binned")
    design.__dict__["sized"] = False
    with pytest.raises(GatewareError, match=r"--image binned: a\.v has no parameters COLUMNS and"):
        design.check_image()
