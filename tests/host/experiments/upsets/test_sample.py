"""What an upset is said to have done, from what the processor saw with it and without."""

from dataclasses import replace

import numpy as np
import pytest

from cubestack.host.experiments.upsets.clean import Snapshot
from cubestack.host.experiments.upsets.sample import Effect, effect_of

ROW = 16
CLEAN = Snapshot(
    np.arange(8 * ROW, dtype=np.uint8),
    [(1000, "ACK", 1), (2000, "ACK", 0)],
    bytes(8),
    {"SRAM": np.zeros(8 * ROW, np.uint8)},
    {"read-access": 1},
)


def changed(*places: int) -> Snapshot:
    data = CLEAN.data.copy()
    data[list(places)] ^= 1
    return replace(CLEAN, data=data)


@pytest.mark.parametrize(
    ("found", "effect"),
    [
        (CLEAN, "nothing"),
        (replace(CLEAN, registers=b"\1" + bytes(7)), "left over"),
        (replace(CLEAN, memories={"SRAM": np.ones(8 * ROW, np.uint8)}), "left over"),
        (changed(5), "pixel"),
        (changed(5, 6), "pixel"),
        (changed(5, 6, 7), "row"),
        (changed(2, 3, 2 + ROW - 1), "row"),
        (changed(2, 3, 2 + ROW), "picture"),
        (replace(CLEAN, data=CLEAN.data[:-1]), "picture"),
        (replace(CLEAN, seen=[(1001, "ACK", 1), (2000, "ACK", 0)]), "late"),
        (replace(changed(5), seen=[]), "no ACK"),
        (replace(changed(5), violations={"read-access": 2}), "timing"),
        (replace(CLEAN, violations={"read-access": 1, "wire-contention": 1}), "contention"),
    ],
)
def test_the_gravest_is_told(found: Snapshot, effect: Effect) -> None:
    assert effect_of(found, CLEAN, ROW) == effect
