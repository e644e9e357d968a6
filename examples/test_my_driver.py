"""A suite for a driver of one's own, with pytest and the fixtures of cubestack.

The driver here asks a CubeStar for its identification. A real one would be imported.
"""

from typing import Any

import pytest


class MyDriver:
    """Talks to a port that looks like pyserial's."""

    def __init__(self, port: Any) -> None:
        """Use ``port``."""
        self.port = port
        self.port.timeout = 0.1

    def node_type(self, attempts: int = 3) -> int:
        """First byte of telemetry 128; TimeoutError when no good answer comes."""
        for _ in range(attempts):
            self.port.reset_input_buffer()
            self.port.write(bytes([0x1F, 0x7F, 128, 0x1F, 0xFF]))
            answer = self.port.read(64)
            if answer[:2] == b"\x1f\x7f" and answer[-2:] == b"\x1f\xff" and len(answer) == 12:
                return int(answer[2])
        raise TimeoutError("no answer")


def test_it_finds_a_cubestar(cubestar: Any) -> None:
    """A good line."""
    assert MyDriver(cubestar.serial()).node_type() == 5


def test_it_asks_again_when_a_byte_is_lost(cubestar: Any) -> None:
    """For a millisecond, every byte is."""
    driver = MyDriver(cubestar.serial())
    cubestar.faults.inject("uart-drop", for_s=0.001)
    assert driver.node_type() == 5
    assert cubestar.faults.events > 0


def test_it_gives_up_in_time(cubestar: Any) -> None:
    """Nothing gets through; time is virtual, so this takes none."""
    driver = MyDriver(cubestar.serial())
    cubestar.faults.inject("uart-drop")
    with pytest.raises(TimeoutError):
        driver.node_type()
    assert cubestar.time_s < 1.0


@pytest.mark.cubestack(seed=5, faults="[[fault]]\nkind = 'latch-up'\nat_s = 0.3\n")
def test_a_latch_up_costs_one_picture(cubestar: Any) -> None:
    """The plan strikes while the first picture is taken."""
    assert cubestar.client.capture_and_process().name == "CAPTURE_FAILED"
    assert cubestar.client.capture_and_process().name == "CALCULATED"


@pytest.mark.cubestack(profile="extended")  # as published, the lens is off by tenths of a degree
def test_the_nadir_camera_measures(cubesense: Any) -> None:
    """In view are the Earth at (-8, 12) degrees, and the Sun."""
    measured = cubesense.client.capture_and_detect(1)
    assert (measured.alpha_deg, measured.beta_deg) == pytest.approx((-8, 12), abs=0.1)
