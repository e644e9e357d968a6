from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.devices.registry import device, device_names
from cubestack.host.studies import demo

from ....conftest import Run


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of shown devices; all but the last find their target."""
    seen = list[str]()

    def show(one: Any, *_given: object) -> bool:
        seen.append(one.name)
        return one.name != device_names()[-1]

    devices = [replace(device(name), studies={"demo": lambda: show}) for name in device_names()]
    silent = SimpleNamespace(name="silent", studies={})
    monkeypatch.setattr(demo, "devices", lambda: [*devices, silent])
    return seen


def test_demo_shows_all_devices_or_the_named_one(
    run: Run, shown: list[str], tmp_path: Path
) -> None:
    first, *_, last = device_names()
    assert run("demo", "--out", tmp_path).code == 1
    assert shown == list(device_names())
    for name, code in ((first, 0), (last, 1)):
        shown.clear()
        assert run("demo", name, "--out", tmp_path).code == code
        assert shown == [name]
    assert "silent" in run("demo", "silent", "--out", tmp_path).line
