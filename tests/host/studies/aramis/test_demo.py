import json
import re
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.interface.aramis import (
    CatalogueState,
    MeasurementMode,
    MeasurementOutcome,
    Reason,
)
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.interface.codec.switches import Switches
from cubestack.host.clients.aramis.client import Attitude
from cubestack.host.studies.aramis import demo

from ....conftest import Run

ORION = quaternion_from_pointing(84.0, -1.0, 20.0)
OFF = quaternion_from_pointing(84.0, -0.99, 20.0)  # 36 arcsec
FOUND = Attitude(
    *(ORION, True, MeasurementOutcome.CONCLUSIVE, Reason.CONFIRMED, MeasurementMode.LOST_IN_SPACE),
    **{"matched": 7, "detected": 9, "frame": 1, "image_uptime_s": 1.0, "julian_date": None},
)


class Tracker:
    """Returns the next of ``attitudes``; ``near`` is the given hint."""

    def __init__(self, *attitudes: Attitude) -> None:
        self.near = list[NDArray[np.float64] | None]()
        self._attitudes = iter(attitudes)
        self.switches: Switches | None = None
        self.activate = lambda: CatalogueState.GOOD
        self.phase_times = lambda: {"match": 12.0}
        self.stars = list
        self.profile = lambda: self.switches
        self.image = lambda _progress: np.zeros((8, 10), np.uint8)

    def measure(self, near: NDArray[np.float64] | None = None) -> Attitude:
        self.near.append(near)
        return next(self._attitudes)


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Tracker], bool]:
    monkeypatch.setattr(demo, "true_stars", lambda *_: [])
    device: Any = SimpleNamespace(name="aramis")

    def shown(tracker: Tracker) -> bool:
        client = nullcontext((tracker, tmp_path))
        monkeypatch.setattr(demo.Demo, "client", lambda *_: client)
        return demo.show(device, tmp_path, 1, None, [])

    return shown


def test_demo_measures_lost_in_space_and_near_a_direction(
    show: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tracker = Tracker(FOUND, replace(FOUND, quaternion=OFF, matched=8))
    assert show(tracker) is True
    none, near = tracker.near
    assert none is None
    ra, dec = np.radians((84.0, -1.0))
    boresight = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    assert np.linalg.norm(near) == pytest.approx(1)
    assert np.degrees(np.arccos(near @ boresight)) == pytest.approx(2, abs=0.01)
    told = " ".join(capsys.readouterr().out.split())
    errors = re.findall(
        r"(lost in space|with a direction 2° off): conclusive: confirmed, (\d) of 9 stars; "
        r"error: ([\d.]+) arcsec across",
        told,
    )
    assert errors == [("lost in space", "7", "0.0"), ("with a direction 2° off", "8", "36.0")]
    for name in ("aramis-raw.png", "aramis-stars.png"):
        assert (tmp_path / name).exists()


def test_demo_prints_the_reason_of_a_refused_attitude(
    show: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    outcome, reason = MeasurementOutcome.AMBIGUOUS, Reason.SEVERAL
    refused = replace(FOUND, valid=False, outcome=outcome, reason=reason)
    assert show(Tracker(FOUND, refused)) is False
    told = capsys.readouterr().out.splitlines()
    assert "with a direction 2° off: ambiguous: several" in told


@pytest.mark.parametrize(
    ("switches", "left_out"),
    [
        (AramisSwitches(belief="unique"), ["names of stars outside the unique triangle"]),
        (AramisSwitches(belief="confirmed"), []),
        (None, []),
    ],
)
def test_caption_says_that_only_a_triangle_is_named(
    monkeypatch: pytest.MonkeyPatch, show: Any, switches: Switches | None, left_out: list[str]
) -> None:
    told = list[Any]()
    monkeypatch.setattr(demo, "annotate", lambda *given: told.append(given[4]))
    tracker = Tracker(FOUND, FOUND)
    tracker.switches = switches
    show(tracker)
    assert told == [left_out]


SMALL = ("--fov", "20", "--stars-per-field", "3", "--mag-limit", "3", "--step", "5")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_catalogue_command_prints_facts_and_writes_the_image(tmp_path: Path, run: Run) -> None:
    output = tmp_path / "image.bin"
    code, out, err = run("catalogue", "aramis", *SMALL, "--json", "--output", output)
    assert (code, err) == (0, "")
    facts = json.loads(out)
    database = Database.unpack(output.read_bytes())
    assert facts["stars"] == len(database.numbers)
    assert facts["triangles"] == len(database)
    assert facts["bytes"] == output.stat().st_size == sum(facts["bytes_of_parts"].values())
    assert (facts["published_stars"], facts["published_triangles"]) == (1312, 265_292)
    assert facts["star_numbers"] == "Hipparcos"
    assert len(list((tmp_path / "cache" / "cubestack").iterdir())) == 1


def test_catalogue_command_prints_text(run: Run) -> None:
    code, out, err = run("catalogue", "aramis", *SMALL)
    assert (code, err) == (0, "")
    assert "published triangles  265292" in out


def test_names_an_output_that_cannot_be_written(tmp_path: Path, run: Run) -> None:
    outcome = run("catalogue", "aramis", *SMALL, "--output", tmp_path / "no" / "x")
    assert (outcome.code, str(tmp_path / "no" / "x") in outcome.line) == (2, True)


def test_demo_replaces_only_pictures_of_a_demo(show: Any, tmp_path: Path) -> None:
    assert show(Tracker(FOUND, FOUND)) is True
    assert show(Tracker(FOUND, FOUND)) is True
    theirs = tmp_path / "aramis-stars.png"
    theirs.write_bytes(b"precious")
    with pytest.raises(ValueError, match=r"stars\.png exists, and no demo wrote it"):
        show(Tracker(FOUND, FOUND))
    assert theirs.read_bytes() == b"precious"
