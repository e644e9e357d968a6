from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.shell.language import Shell
from cubestack.host.targets import Target
from tests.system.conftest import compile_c
from tests.system.cubesense.conftest import FACING

#: Pictures without noise are the same again.
QUIET = EarthSunView(FACING, FisheyeCondition(noise=False))

SOURCE = Path(__file__).with_name("outsider.c")

#: What counts on between two readings.
COUNTING = {"Runtime", "RuntimeSeconds", "RuntimeMilliseconds", "TcmdCount", "TlmCount"}


@pytest.fixture(scope="session")
def outsider(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_c(SOURCE, tmp_path_factory.mktemp("outsider"))


def measure(device: AnyEmulated) -> None:
    node = device.client.client
    steps: tuple[tuple[str, dict[str, Any]], ...] = (
        ("IDStars", {}),  # too early: a flag
        ("setDelayTimerTimeout", {"Time": 37}),
        ("setTrackingMode", {"RightAscension": 1.0, "Declination": 0.5}),
        ("ReadFrom_IS_Register", {"Reg": 0x26}),
        ("CaptureAndProcess", {}),
        ("SelectBestStars", {}),
        ("TestSRAM", {}),
    )
    if device.device.name == "cubesense":
        pictures = [("CaptureAndDetect", {"Camera": n, "Sram": n}) for n in (0, 1)]
        download = {"Sram": 1, "Location": 0, "Size": 2}
        mask = {"Area": 2, "XMin": 1, "XMax": 300, "YMin": 4, "YMax": 5}
        steps = (("Mask2", mask), *pictures, ("StartImageDownload", download))
    for name, parameters in steps:
        node.command(name, **parameters)
        node.wait_processed(10.0)


def by_frame(output: str) -> dict[int, list[tuple[str, str]]]:
    """(name, value) of each line by frame ID; empty for frames without an answer."""
    frames: dict[int, list[tuple[str, str]]] = {}
    for line in output.splitlines():
        name, _, value = line.partition("=")
        number, _, field = name.partition(".")
        if field:
            frames.setdefault(int(number), []).append((field, value))
        else:
            assert line.endswith(": no answer"), line
            frames[int(number.split(":")[0])] = []
    return frames


def same(field: Field, value: str, text: str) -> bool:
    """Whether ``value`` equals what the shell shows."""
    if field.type.startswith("bytes"):
        return value == text
    if field.choices is not None:
        return text in (value, *(one.name for one in field.choices if one == float(value)))
    if field.type == "bool1":
        return (value == "1") is (text == "True")
    return float(value) == pytest.approx(float(text.split()[0]), rel=1e-6, abs=1e-12)


def check(interface: Interface, name: str, shell: Shell, output: str) -> int:
    """Compares each line with the shell; returns the number of lines."""
    lines, frames = 0, by_frame(output)
    published = [message for message in interface.telemetries if not message.extension]
    assert {message.id for message in published} == {*frames}
    for message in published:
        printed = frames[message.id]
        assert bool(printed) is message.supported
        fields = len(message.fields)
        for record in range(len(printed) // fields):
            rows = shell.execute(f"read {message.name}").rows
            if message.starts_measurement:
                shell.target.node.pause(1.0)
            for at, (field, (shown, text)) in enumerate(zip(message.fields, rows, strict=True)):
                theirs, value = printed[record * fields + at]
                assert shown == field.name
                assert name == "cubesense" or theirs == shown
                if shown in COUNTING:
                    assert float(value) <= float(text.split()[0]) or "Milli" in shown
                else:
                    assert same(field, value, text), (message.name, shown, value, text)
                lines += 1
    return lines


@pytest.mark.parametrize("name", ["cubestar", "cubesense"])
def test_every_published_value_is_decoded(outsider: Path, name: str) -> None:
    scene = () if name == "cubestar" else (QUIET,)
    with open_device(name, *scene, seed=4, profile="extended") as device:
        measure(device)
        for _ in range(1 if scene else 2):  # the first requests 138, which raises a flag
            done = device.run(outsider, "{port}", name)
        assert (done.returncode, done.stderr) == (0, "")
        interface, node = device.device.interface, device.client.client
        if name == "cubesense":  # the last two results were scheduled into the other memory
            measure(device)
        shell = Shell(Target("the device", interface, node, node, device=device.device))
        lines = check(interface, name, shell, done.stdout)
        assert lines > (400 if name == "cubestar" else 100)
