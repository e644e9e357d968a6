import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest

import cubestack
from cubestack import sensor
from cubestack.firmware_model.interface.codec.field import u8
from tests.together import together


@together("name", cubestack.__all__)
def test_every_public_name_is_documented(name: str) -> None:
    value = getattr(cubestack, name)
    assert name == "__version__" or value.__doc__
    assert name in dir(cubestack)


@pytest.mark.parametrize("module", [cubestack, sensor])
def test_unknown_name_is_rejected(module: ModuleType) -> None:
    with pytest.raises(AttributeError, match=f"'{module.__name__}' has no attribute 'Nodeboard'"):
        _ = module.Nodeboard


def test_lazily_imported_names_equal_the_public_api() -> None:
    assert {*cubestack._HOMES, "__version__"} == set(cubestack.__all__)


@pytest.mark.parametrize(
    "statement",
    [
        "import cubestack",
        "from cubestack.sensor import Message, f32, node_device, node_interface",
        "from cubestack.host.devices.registry import devices; list(devices())",
    ],
)
def test_import_loads_no_heavy_module(statement: str) -> None:
    heavy = {"numpy", "amaranth", "simpy", "cubestack.emulator"}
    script = f"import sys; {statement}; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stderr


def test_command_prints_its_version() -> None:
    script = str(Path(sys.executable).parent / "cubestack")
    for command in ([script], [sys.executable, "-m", "cubestack"]):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"cubestack {version('cubestack')}\n"


def test_script_needs_one_import() -> None:
    with cubestack.connect("emulated:aramis") as aramis:
        assert isinstance(aramis, cubestack.Aramis)
        assert aramis.client.telemetry("Identification")["InterfaceVersion"] == 1


@together("name", sensor.__all__)
def test_every_name_loads(name: str) -> None:
    assert getattr(sensor, name) is not None
    assert name in dir(sensor)


def test_sensor_api_names_equal_those_of_their_modules() -> None:
    assert sensor.u8 is u8
    for names in sensor.TOPICS.values():
        assert all(name == own for name, (_, own) in names.items())
