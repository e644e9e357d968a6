import numpy as np
import pytest

from cubestack.host.emulation.emulated import open_device
from cubestack.host.experiments.cubesense.pictures import overlay
from cubestack.host.pictures.overlay import star_overlay


@pytest.mark.parametrize(("profile", "limbs"), [("published", 0), ("extended", 1)])
def test_overlay_has_nadir_edges_and_limb(profile: str, limbs: int) -> None:
    with open_device("cubesense", profile=profile) as emulated:
        emulated.client.client.command("CaptureAndDetect", Camera="NADIR", Sram="SRAM2")
        emulated.client.client.wait_processed(10)
        found = overlay(emulated.client, "memory nadir")
        assert not overlay(emulated.client, "memory sun").marks
    edges = np.array([(one.x_px, one.y_px) for one in found.marks if one.name == "edge"])
    (centre,) = (one for one in found.marks if one.name == "nadir")
    assert len(edges) > 10
    assert len(found.lines) == limbs
    for line in found.lines:
        apart = np.linalg.norm(edges[:, None] - line, axis=2).min(axis=1)
        assert np.median(apart) < 4  # points of the limb are some pixels apart
        assert np.linalg.norm(line.mean(axis=0) - (centre.x_px, centre.y_px)) < 30


def test_overlay_names_identified_stars() -> None:
    with open_device("cubestar") as emulated:
        emulated.client.client.command("CaptureAndProcess")
        emulated.client.client.wait_processed(10)
        marks = star_overlay(emulated.client, "SRAM").marks
    assert {one.name: one.hipparcos for one in marks}["Rigel"] == 24436
    assert all((one.hipparcos is None) == (one.name == "") for one in marks)
