import subprocess
import sys
from pathlib import Path

import pytest

from cubestack import sensor
from cubestack.firmware_model.interface.codec.field import u8


@pytest.mark.parametrize("name", sensor.__all__)
def test_every_name_loads(name: str) -> None:
    assert getattr(sensor, name) is not None
    assert name in dir(sensor)


def test_names_are_those_of_their_modules() -> None:
    assert sensor.u8 is u8
    for names in sensor.TOPICS.values():
        assert all(name == own for name, (_, own) in names.items())


def test_unknown_name_is_rejected() -> None:
    with pytest.raises(AttributeError, match=r"'cubestack.sensor' has no attribute 'Nodeboard'"):
        _ = sensor.Nodeboard


def test_tables_and_device_load_no_emulator(tmp_path: Path) -> None:
    script = (
        "import sys; from cubestack.sensor import Message, f32, node_device, node_interface;"
        "heavy = {'numpy', 'amaranth', 'simpy', 'cubestack.emulator'};"
        "print(heavy & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stderr
