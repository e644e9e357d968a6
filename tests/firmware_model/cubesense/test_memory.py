import numpy as np
import pytest

from cubestack.firmware_model.cubesense.memory import CAPACITY, Memory, budget, report, used
from cubestack.firmware_model.cubesense.vision.edges import MAX_EDGES, EdgeConfig, NadirLines
from cubestack.firmware_model.interface.codec.switches import PROFILES, Profile
from cubestack.firmware_model.interface.cubesense.codes import Sram
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches

from .harness import Harness
from .scenery import chequered

EXTENDED = CubeSenseSwitches.of("extended")


def sizes() -> dict[str, int]:
    return {buffer.name: buffer.size for buffer in budget(EXTENDED)}


@pytest.mark.parametrize("profile", PROFILES)
def test_everything_fits_and_flash_has_room_for_a_program(profile: Profile) -> None:
    total = used(budget(CubeSenseSwitches.of(profile)))
    assert total[Memory.RAM] <= CAPACITY[Memory.RAM] == 1536
    assert total[Memory.FLASH] < CAPACITY[Memory.FLASH] / 8


def test_sizes_follow_from_what_is_kept() -> None:
    size = sizes()
    assert size["scanned pixels"] == 64
    assert size["edges"] == 4 * MAX_EDGES
    assert size["Sun window"] == 4 + 15 * 15
    assert size["distortion tables of the reset values"] == 227 + 2 * 2 * 227
    assert len(size) == len(budget(EXTENDED))


def test_the_published_program_takes_less_ram_and_its_table_needs_flash() -> None:
    ours, printed = (used(budget(CubeSenseSwitches.of(profile))) for profile in PROFILES[::-1])
    assert ours[Memory.FLASH] == printed[Memory.FLASH]  # telecommands change the kind of table
    # The 3 x 3 matrix, two rows of its inverse and its right side, in place of the sums of chords;
    # a byte for each edge, and where a bright run began.
    assert ours[Memory.RAM] - printed[Memory.RAM] == 16 * (4 + 2) - 18 * 4 + 40 + 4
    assert 0 < CAPACITY[Memory.RAM] - printed[Memory.RAM] < 227


@pytest.mark.parametrize("profile", PROFILES)
def test_overlaid_buffers_fit_their_shared_memory(profile: Profile) -> None:
    buffers = budget(CubeSenseSwitches.of(profile))
    size = {buffer.name: buffer.size for buffer in buffers}
    for name in {buffer.inside for buffer in buffers} - {""}:
        assert sum(buffer.size for buffer in buffers if buffer.inside == name) <= size[name]


@pytest.mark.parametrize("profile", ["extended"])
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
    text = report(budget())
    assert all(buffer.name in text for buffer in budget())
    assert f"**{used(budget())[Memory.RAM]}**" in text
