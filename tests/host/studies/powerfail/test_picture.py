"""The picture of a run: no label covers another."""

import re
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

from cubestack.emulator.iss.flash_changes import FlashChange, FlashOperation
from cubestack.host.studies.powerfail.picture import LETTER, TEXT, flash_picture


def test_labels_of_steps_and_words_do_not_overlap() -> None:
    changes = [FlashChange(9 * n, 1, 0x800 + 8 * n, 4, 0, 1, 0, 0) for n in range(30)]
    operations = [FlashOperation((one,)) for one in changes]
    course: Any = SimpleNamespace(operations=operations, started=[0, 20, 40, 200, 201, 202])
    drawn = ElementTree.fromstring(flash_picture(course, []))
    space = "{http://www.w3.org/2000/svg}"
    for group in (drawn.findall(f"{space}text"), drawn.findall(f"{space}g/{space}text")):
        boxes = [
            (float(one.attrib["x"]), float(one.attrib["y"]), LETTER * len(one.text or ""))
            for one in group
        ]
        assert len(boxes) >= 6
        for place, (x, y, width) in enumerate(boxes):
            for other_x, other_y, other_width in boxes[:place]:
                apart = x >= other_x + other_width or other_x >= x + width
                assert apart or abs(y - other_y) >= TEXT
    top = re.search(r"translate\(0 (\d+)\)", flash_picture(course, []))
    assert top is not None
    steps = [one for one in drawn.findall(f"{space}text") if "step" in (one.text or "")]
    assert all(float(one.attrib["y"]) < float(top[1]) for one in steps)
