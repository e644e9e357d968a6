"""What boards show past their ports is what the devices send, and what they should measure."""

from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.host.clients.quaternions import attitude_columns
from cubestack.host.emulation.emulated import AnyEmulated, open_device

SHAPES = {"cubestar": (512, 1024), "cubesense": (480, 640), "aramis": (1024, 1280)}


def take(name: str, emulated: AnyEmulated) -> None:
    client: Any = emulated.client
    if name == "cubesense":
        for camera, memory in zip(Camera, Sram, strict=True):
            client.capture_and_detect(camera, memory)
    else:
        client.take_picture()


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_image_equals_the_one_sent_by_the_device(name: str) -> None:
    with open_device(name) as emulated:
        take(name, emulated)
        sent = emulated.client.picture()
        shown = emulated.board.pictures().values()
        assert any(np.array_equal(picture, sent) for picture in shown)


@pytest.mark.parametrize("name", SHAPES)
def test_memories_contain_the_captured_image(name: str) -> None:
    with open_device(name) as emulated:
        before = {at: picture.copy() for at, picture in emulated.board.pictures().items()}
        take(name, emulated)
        after = emulated.board.pictures()
        assert {picture.shape for picture in after.values()} == {SHAPES[name]}
        changed = [at for at in after if not np.array_equal(before[at], after[at])]
        assert len(changed) == (2 if name == "cubesense" else 1)
        truths = emulated.board.truths()
        if name == "cubesense":
            assert set(truths) == {"sun", "nadir"}
            found = emulated.client.latest()
            for camera, (alpha, beta) in truths.items():
                assert found[f"{camera}_alpha_deg"] == pytest.approx(alpha, abs=1.0)
                assert found[f"{camera}_beta_deg"] == pytest.approx(beta, abs=1.0)
        else:
            assert set(truths) == {"attitude"}
            assert attitude_columns(truths["attitude"])["dec_deg"] is not None


def test_truth_is_empty_before_the_first_image() -> None:
    with open_device("cubestar") as emulated:
        assert emulated.board.truths() == {}
