from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.host.emulation.process import emulating
from cubestack.host.pictures.images import png, save_picture
from cubestack.host.targets import connect

from ..browser import line, port_of, saved, shown, station

pytestmark = [pytest.mark.xdist_group("other pages"), pytest.mark.slow]


@pytest.fixture
def port(request: pytest.FixtureRequest) -> Iterator[str]:
    """Port of an emulated device; one client at a time."""
    words = [request.param, "--tcp", "0", "--pace", "fast", "--seed", "3"]
    with emulating(words) as said:
        yield port_of(said)


def downloaded(page: Any, path: Path, source: str | None = None) -> bytes:
    """The picture file that the page saves."""
    if source is not None:
        page.select_option("#source", source)
    page.click("#download")
    page.wait_for_selector("#transfer-status >> text=/^download: .* done$/")
    return saved(page, "#save-image", path).read_bytes()


@pytest.mark.parametrize("port", ["cubestar"], indirect=True)
def test_uploaded_image_is_downloaded_unchanged(chromium: Any, tmp_path: Path, port: str) -> None:
    sent = np.zeros((2, 512, 1024), np.uint8)
    sent[:, 100:130] = np.random.default_rng(4).integers(0, 256, (2, 30, 1024), np.uint8)
    save_picture(sent[0], tmp_path / "sent.png")
    with station(port, "--device", "cubestar") as address, shown(chromium, address) as page:
        page.set_input_files("#upload", tmp_path / "sent.png")
        page.wait_for_selector("#transfer-status >> text=/^upload: .* done$/")
    with closing(connect(port, "cubestar")) as client:
        assert client.picture().tobytes() == sent[0].tobytes()
        client.upload(sent[1])
    with station(port, "--device", "cubestar") as address, shown(chromium, address) as page:
        assert downloaded(page, tmp_path / "other.png") == png(sent[1])


@pytest.mark.parametrize("port", ["cubesense"], indirect=True)
def test_captured_image_is_downloaded_unchanged(chromium: Any, tmp_path: Path, port: str) -> None:
    with station(port, "--device", "cubesense") as address, shown(chromium, address) as page:
        line(page, "write CaptureAndDetect Camera=NADIR Sram=SRAM2")
        page.wait_for_selector("#lines li.good >> text=CaptureAndDetect: done")
        by_page = downloaded(page, tmp_path / "sram2.png", "sram2")
    with closing(connect(port, "cubesense")) as client:
        assert by_page == png(client.picture("sram2"))
