from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.camera.common.image_sensor import ImageSensor, PixelClock
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import View
from cubestack.firmware_model.interface.cameras import mt9m001 as chip


class Sensor(ImageSensor[Any, Any]):
    scene_types = (str,)
    sees = "it sees words"

    def __init__(self, seen: Any, condition: Any = "good") -> None:
        self.made: list[Any] = []
        self.told: list[int] = []
        self.restarts: list[int] = []
        super().__init__(seen, condition, chip.REGISTERS, 3_000_000)
        self.on_change = lambda: self.told.append(1)

    def _check(self, scene: Any, condition: Any) -> None:
        if scene == "odd":
            raise ValueError("odd")

    def _on_restart(self, now_ps: int) -> None:
        self.restarts.append(now_ps)

    def look(self, frame: object) -> int:
        def make() -> Any:
            self.made.append(frame)
            return np.array([len(self.made)])

        return int(self._cached(frame, make)[0])


def test_images_are_rendered_once_and_two_are_cached() -> None:
    sensor = Sensor("sky")
    assert sensor.rendered is None
    assert [sensor.look(frame) for frame in (1, 1, 2, 1)] == [1, 1, 2, 1]
    assert sensor.rendered[0] == 1  # the frame looked at last, not the one made last
    assert sensor.look(3) == 3  # and frame 2 goes, which was looked at before
    assert [sensor.look(frame) for frame in (1, 3)] == [1, 3]
    assert sensor.look(2) == 4
    assert sensor.made == [1, 2, 3, 2]


def test_changed_scene_or_condition_re_renders_the_image() -> None:
    sensor = Sensor("sky")
    assert sensor.look(1) == 1
    sensor.scene = "ground"
    assert sensor.look(1) == 2
    sensor.condition = "bad"
    assert sensor.look(1) == 3
    sensor.scene = View("ground", "good")
    assert sensor.look(1) == 2  # kept
    assert (sensor.scene, sensor.condition) == ("ground", "good")


def test_rejected_scene_leaves_the_sensor_unchanged() -> None:
    sensor = Sensor(View("sky", "bad"))
    assert (sensor.scene, sensor.condition) == ("sky", "bad")
    with pytest.raises(TypeError, match="it sees words, not 3"):
        sensor.scene = 3
    with pytest.raises(TypeError, match="it sees words, not 3"):
        sensor.scene = View(3, "good")
    with pytest.raises(ValueError, match="odd"):
        sensor.scene = "odd"
    assert (sensor.scene, sensor.condition) == ("sky", "bad")


def test_image_sensor_follows_supply_and_clock() -> None:
    sensor = Sensor("sky")
    assert sensor.running
    assert sensor.period * 3 == 10**6
    sensor.registers.store("SHUTTER_WIDTH", 5)
    sensor.power(True, 10)
    assert (sensor.restarts, sensor.told) == ([], [])
    sensor.power(False, 20)
    assert not sensor.running
    sensor.power(False, 25)
    sensor.power(True, 30)
    assert sensor.running
    assert (sensor.restarts, sensor.told) == ([20, 30], [1, 1])
    assert sensor.registers.active("SHUTTER_WIDTH") == 0x0419


def test_edges_stand_on_a_grid_that_does_not_drift() -> None:
    clock = PixelClock(10_000_000, origin_ps=7)
    assert clock.period == 100_000
    assert [clock.edge_ps(k) for k in range(3)] == [7, 100_007, 200_007]
    assert [clock.first_edge(t) for t in (0, 7, 8, 100_007, 100_008)] == [0, 0, 1, 1, 2]
    assert PixelClock(1).edge_ps(2) == 2 * 10**12
    for wrong in (0, -1):
        with pytest.raises(ValueError, match=f"positive frequency, not {wrong} Hz"):
            PixelClock(wrong)
    clock = PixelClock(11_000_000)
    assert clock.period == Fraction(10**12, 11_000_000)
    assert clock.edge_ps(11_000_000 * 3600) == 3600 * 10**12


@given(hz=st.integers(1, 60_000_000), origin=st.integers(0, 10**15), time=st.integers(0, 10**16))
def test_first_edge_is_the_earliest_at_or_after_a_time(hz: int, origin: int, time: int) -> None:
    clock = PixelClock(hz, origin)
    edge = clock.first_edge(time)
    assert clock.edge_ps(edge) >= time
    assert edge == 0 or clock.edge_ps(edge - 1) < time


THIRD_PS = Fraction(10**12, 3)  # a third of a second, so that nothing is even by chance


@pytest.mark.parametrize("exposure", [1, 2, 7])
def test_each_row_is_exposed_up_to_its_own_readout(exposure: int) -> None:
    shutter = RollingShutter(5 * 10**12, THIRD_PS, exposure, 4)
    assert shutter.line_s == pytest.approx(1 / 3)
    assert shutter.exposure_s == pytest.approx(exposure / 3)
    assert shutter.relative_exposure == pytest.approx(exposure / 4)
    for row in (0, 1, 2.5, 511):
        end = shutter.readout_ps + row * THIRD_PS
        begin = end - exposure * THIRD_PS
        assert shutter.mid_exposure_ps(row) == pytest.approx(float(begin + end) / 2, abs=0.51)
