from types import SimpleNamespace
from typing import Any

from cubestack.emulator.boards.cubesense.gpio import CHANNELS, GpioPins
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.codes import Camera


def test_a_reset_lets_control_lines_rise_and_switches_everything_off() -> None:
    lines: dict[tuple[Camera, str], int] = {}
    switched: dict[str, bool] = {}

    def camera(which: Camera) -> Any:
        return SimpleNamespace(
            on_pin=lambda line, level, _now_ps: lines.update({(which, line): level})
        )

    power: Any = SimpleNamespace(switch=switched.__setitem__)
    driven = GpioPins(Kernel(), {which: camera(which) for which in Camera}, power)
    high = {(which, line): 1 for which in Camera for line in ("SCL", "SDA")}
    off = dict.fromkeys(CHANNELS.values(), False)
    assert (lines, switched) == (high, off)
    for pin in (*pins.CAMERA_SCL.values(), *pins.CAMERA_SDA.values()):
        driven.set_pin(pin, 0)
    for pin in CHANNELS:
        driven.set_pin(pin, 1)
    assert set(lines.values()) == {0}
    assert set(switched.values()) == {True}
    driven.release()
    assert (lines, switched) == (high, off)
