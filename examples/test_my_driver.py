"""Tests of your own driver, with pytest and the fixtures of cubestack.

The driver here reads the identification of a CubeStar. You would import a real one.
"""

from typing import Any

import pytest


class MyDriver:
    """A driver on a port with the interface of pyserial's."""

    def __init__(self, port: Any) -> None:
        self.port = port
        self.port.timeout = 0.1

    def node_type(self, attempts: int = 3) -> int:
        """First byte of telemetry 128; raises TimeoutError without a good answer."""
        for _ in range(attempts):
            self.port.reset_input_buffer()
            self.port.write(bytes([0x1F, 0x7F, 128, 0x1F, 0xFF]))
            answer = self.port.read(64)
            if answer[:2] == b"\x1f\x7f" and answer[-2:] == b"\x1f\xff" and len(answer) == 12:
                return int(answer[2])
        raise TimeoutError("no answer")


def test_driver_reads_the_node_type(cubestar: Any) -> None:
    assert MyDriver(cubestar.serial()).node_type() == 5


def test_retries_after_lost_bytes(cubestar: Any) -> None:
    """Every byte is lost for a millisecond."""
    driver = MyDriver(cubestar.serial())
    cubestar.faults.inject("uart-drop", for_s=0.001)
    assert driver.node_type() == 5
    assert cubestar.faults.events > 0


def test_times_out_on_a_dead_line(cubestar: Any) -> None:
    """No byte arrives. Time is virtual, so the test does not wait."""
    driver = MyDriver(cubestar.serial())
    cubestar.faults.inject("uart-drop")
    with pytest.raises(TimeoutError):
        driver.node_type()
    assert cubestar.time_s < 1.0


@pytest.mark.cubestack(seed=5, faults="[[fault]]\nkind = 'latch-up'\nat_s = 0.3\n")
def test_latch_up_spoils_one_image(cubestar: Any) -> None:
    """The fault happens during the first capture."""
    assert cubestar.client.capture_and_process().name == "CAPTURE_FAILED"
    assert cubestar.client.capture_and_process().name == "CALCULATED"


@pytest.mark.cubestack(profile="extended")  # in `published`, the lens adds tenths of a degree
def test_measures_the_nadir_direction(cubesense: Any) -> None:
    """The default scene has the Earth at (-8, 12) degrees."""
    measured = cubesense.client.capture_and_detect(1)
    assert (measured.alpha_deg, measured.beta_deg) == pytest.approx((-8, 12), abs=0.1)
