import numpy as np

from cubestack.firmware_model.cubesense.memory import CAPACITY, Memory, budget, report, used
from cubestack.firmware_model.cubesense.vision.edges import MAX_EDGES, EdgeConfig, NadirLines
from cubestack.firmware_model.interface.cubesense.codes import Sram

from .harness import Harness
from .scenery import chequered


def sizes() -> dict[str, int]:
    return {buffer.name: buffer.size for buffer in budget()}


def test_everything_fits_and_flash_has_room_for_a_program() -> None:
    total = used(budget())
    assert total[Memory.RAM] <= CAPACITY[Memory.RAM] == 1536
    assert total[Memory.FLASH] < CAPACITY[Memory.FLASH] / 8


def test_sizes_follow_from_what_is_kept() -> None:
    size = sizes()
    assert size["scanned pixels"] == 64
    assert size["edges"] == 4 * MAX_EDGES
    assert size["Sun window"] == 4 + 15 * 15
    assert size["distortion tables of the reset values"] == 2 * 2 * 227
    assert len(size) == len(budget())


def test_what_shares_a_place_fits_into_it() -> None:
    size = sizes()
    for name in {buffer.inside for buffer in budget()} - {""}:
        assert sum(buffer.size for buffer in budget() if buffer.inside == name) <= size[name]


def test_the_programs_buffers_are_as_large_as_the_budget_says(unit: Harness) -> None:
    size = sizes()
    acquisition = unit.program.acquisition
    scanned, window = acquisition.buffers
    assert scanned.nbytes == size["scanned pixels"]
    assert window.nbytes == size["Sun window"]
    assert np.shares_memory(scanned, window)
    assert unit.program.commands.download.data.nbytes == size["image frame"]
    lines = NadirLines(EdgeConfig(), unit.meter, buffer=scanned)
    assert np.shares_memory(lines.space, scanned)
    unit.memories[Sram.SRAM2] = chequered()
    unit.perform(acquisition.scan(Sram.SRAM2, lines))
    assert lines.edges.full
    assert lines.edges.points.nbytes == size["edges"]


def test_the_report_lists_every_buffer_and_the_sums() -> None:
    text = report()
    assert all(buffer.name in text for buffer in budget())
    assert f"**{used(budget())[Memory.RAM]}**" in text
