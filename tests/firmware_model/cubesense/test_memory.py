from cubestack.firmware_model.cubesense.edges import MAX_EDGES
from cubestack.firmware_model.cubesense.memory import CAPACITY, Memory, budget, used


def test_everything_fits_and_flash_has_room_for_a_program() -> None:
    total = used(budget())
    assert total[Memory.RAM] <= CAPACITY[Memory.RAM] == 1536
    assert total[Memory.FLASH] < CAPACITY[Memory.FLASH] / 8


def test_sizes_follow_from_what_is_kept() -> None:
    sizes = {buffer.name: buffer.size for buffer in budget()}
    assert sizes["scanned pixels"] == 64
    assert sizes["edges"] == 4 * MAX_EDGES
    assert sizes["Sun window"] == 4 + 15 * 15
    assert sizes["distortion tables"] == 2 * 2 * 227
    assert len(sizes) == len(budget())
