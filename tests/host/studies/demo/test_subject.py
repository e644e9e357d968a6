import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.clients.cubestar.client import Attitude
from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.registry import device, device_names
from cubestack.host.errors import PortClosedError, PortOpenError
from cubestack.host.experiments.scene_truth import cameras_of
from cubestack.host.studies import demo
from cubestack.host.studies.cubesense import demo as cubesense
from cubestack.host.studies.cubestar import demo as cubestar
from cubestack.host.studies.demo import Demo, download
from cubestack.host.targets import Target, open_target

from ....conftest import Run
from ...pictures.conftest import opened

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = list[Target]()

    @contextmanager
    def client(
        self: Demo, device: AnyDevice, scene: str, board: Sequence[str] = ()
    ) -> Iterator[tuple[Any, Path]]:
        path = self.out / f"{self.name}.toml"
        path.write_text(scene, "utf-8")
        options = dict(word.removeprefix("--").split("=") for word in board)
        target = open_target(f"emulated:{device.name}", scene=path, options=options)
        seen.append(target)
        yield device.client(target.node), path
        target.close()

    def rendered(what: str, _fetch: object) -> NDArray[np.uint8]:
        # What a download would bring, at once.
        controls: Any = seen[-1].controls
        cameras = cameras_of(controls._board)
        picture = cameras["nadir" in what if len(cameras) > 1 else 0].rendered
        return np.asarray(picture)

    monkeypatch.setattr(Demo, "client", client)
    for module in (cubestar, cubesense):
        monkeypatch.setattr(module, "download", rendered)


def errors_told(text: str) -> list[float]:
    """Sizes of all printed errors, in their own units."""
    told = re.findall(r"error:? ([\d.]+)(?:°| arcsec across, [+-]([\d.]+) arcsec about)", text)
    return [float(size) for sizes in told for size in sizes if size]


@pytest.mark.slow
def test_cubestar_demo_solves_a_sky_and_a_photograph(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = cubestar.show(device("cubestar"), tmp_path, 1, tmp_path, ["--profile=extended"])
    told = capsys.readouterr().out
    assert found is True
    across_about = errors_told(told)
    assert len(across_about) == 4
    assert max(across_about) < 60
    for name in ("sky", "photograph"):
        raw, stars = opened(tmp_path / f"{name}-raw.png"), opened(tmp_path / f"{name}-stars.png")
        assert raw.shape == (512, 1024)
        assert stars.shape[1:] == (1024, 3)
        # What was found is marked where stars are bright: both rings and ticks.
        assert np.all(stars[:512] == (120, 255, 120), axis=2).sum() > 200
        assert np.all(stars[:512] == (255, 225, 70), axis=2).sum() > 50
    for text in (
        "detection threshold from a search",
        "measured beside the truth",
        "virtual time: discard 70.0 ms",
        "published:    discard 68 ms",
        "rendered sky: Orion",
        "an image rendered by this project",
    ):
        assert text in told
    rows = re.findall(r"(measured|truth) +RA +([\d.]+)°  Dec +([+-][\d.]+)°", told)
    assert [name for name, *_ in rows] == ["measured", "truth"] * 2
    for (_, ra, dec), (_, true_ra, true_dec) in zip(rows[::2], rows[1::2], strict=True):
        assert float(ra) == pytest.approx(float(true_ra), abs=0.05)
        assert float(dec) == pytest.approx(float(true_dec), abs=0.05)
    assert (float(rows[1][1]), float(rows[1][2])) == pytest.approx((84, -1))
    (virtual_s, *_) = re.findall(r"([\d.]+) s of virtual time in [\d.]+ s of wall time", told)
    assert 2 < float(virtual_s) < 300


def test_photograph_has_the_truth_of_its_camera_file(tmp_path: Path) -> None:
    known = {"quaternion_xyzw_inertial_to_camera": [0, 0, 0, 1]}
    truth = {"images": {"missing.png": {}, "sky.png": known}}
    (tmp_path / "truth.json").write_text(json.dumps(truth), "utf-8")
    Image.fromarray(np.zeros((1024, 1024), np.uint8)).save(tmp_path / "sky.png")
    subject = cubestar._photograph(tmp_path)
    assert subject.camera == tmp_path / "truth.json"
    assert f'file = "{tmp_path.resolve() / "sky.png"}"' in subject.scene
    assert "crop = [0, 256]" in subject.scene
    assert subject.truth.tolist() == [0, 0, 0, 1]
    assert "photograph sky.png" in subject.title
    assert cubestar._photograph(None).camera is None
    assert cubestar._photograph(tmp_path / "none").camera is None


def test_quaternion_of_either_sign_is_the_same_attitude(capsys: pytest.CaptureFixture[str]) -> None:
    found: Any = replace(_attitude(Attitude), quaternion=np.array([0.0, 0.0, 0.6, 0.8]))
    for sign in (1, -1):
        cubestar._report(found, sign * found.quaternion)
        measured, truth = re.findall(r"q \[([^]]+)]", capsys.readouterr().out)
        assert measured == truth
    cubestar._report(replace(found, valid=False), found.quaternion)
    assert capsys.readouterr().out == "no attitude found in this picture\n"


def _attitude(kind: Any) -> Any:
    return kind(**{field.name: 5 for field in fields(kind)} | {"valid": True})


def test_cubesense_demo_prints_sun_and_nadir_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    line = SimpleNamespace(close=lambda: None)
    monkeypatch.setattr(cubesense, "open_transport", lambda *_where: line)
    found = cubesense.show(device("cubesense"), tmp_path, 1, None, ["--profile=extended"])
    told = capsys.readouterr().out
    assert found is True
    assert max(errors_told(told)) < 0.5
    assert len(errors_told(told)) == 2
    assert "sun: measured alpha +20" in told
    assert "truth +20.00°, +10.00°" in told
    assert "truth -8.00°, +12.00°" in told
    assert "published:    70.4 ms" in told
    assert "published:    245.0 ms" in told
    for name, colour in (("sun", (255, 90, 90)), ("nadir", (120, 255, 120))):
        assert opened(tmp_path / f"{name}-raw.png").shape == (480, 640)
        drawn = opened(tmp_path / f"{name}.png")
        assert drawn.shape[1:] == (1280, 3)
        assert np.all(drawn[:960] == colour, axis=2).sum() > 100
    nadir = opened(tmp_path / "nadir-raw.png")
    assert np.median(nadir[240:300, 280:340]) > 100  # the Earth


def test_download_calls_the_progress_function() -> None:
    picture = np.zeros((2, 2), np.uint8)

    def fetch(progress: Any) -> NDArray[np.uint8]:
        progress(1, 2)
        progress(2, 2)
        return picture

    assert download("it", fetch) is picture


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


def test_demo_shows_all_devices_or_the_named_one(run: Run, shown: Any, tmp_path: Path) -> None:
    first, *_, last = device_names()
    assert run("demo", "--out", tmp_path).code == 1
    assert shown == list(device_names())
    for name, code in ((first, 0), (last, 1)):
        shown.clear()
        assert run("demo", name, "--out", tmp_path).code == code
        assert shown == [name]
    assert "silent" in run("demo", "silent", "--out", tmp_path).line


LONG = "cubestack emulate: sky.toml: " + "a message that takes several lines of a terminal, " * 5
SERVES = "CubeStar serves on out/ttyCUBESTAR at 57600 baud; Ctrl-C ends it"


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    lines: list[str] = []
    monkeypatch.setattr(demo, "say", lines.append)
    return lines


def emulator(*lines: str, port: Path) -> Callable[[object], object]:
    """An emulator that prints ``lines``; its port exists from `SERVES` on."""

    def talk() -> Iterator[str]:
        for line in lines:
            if line == SERVES:
                port.touch()
            yield line

    return lambda _words: nullcontext(talk())


def test_output_of_the_emulator_is_shown_in_full(
    monkeypatch: pytest.MonkeyPatch, said: list[str], tmp_path: Path
) -> None:
    port = tmp_path / "tty"
    monkeypatch.setattr(demo, "emulating", emulator("a warning", LONG, port=port))
    with pytest.raises(PortOpenError), demo._served(["cubestar"], port):
        pass
    assert said == ["starting the emulator", "a warning", LONG]
    said.clear()
    monkeypatch.setattr(demo, "emulating", emulator("starting: 5 s", SERVES, "more", port=port))
    with demo._served(["cubestar"], port) as served:
        assert served == port
    assert said == ["starting the emulator", "starting: 5 s", SERVES]
    monkeypatch.setattr(demo, "emulating", emulator(SERVES, "latch-up", LONG, port=port))
    with pytest.raises(PortClosedError), demo._served(["cubestar"], port):
        raise PortClosedError
    assert said[-1] == f"the emulator ended: {LONG}"
