"""Frame rate and discard delay, set by telecommand and seen in what comes back.

CubeStar thesis, sections 5.3.6 and appendix D (table D.2).
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.scene.sky import PictureScene, SkyScene

ROWS = 512
LINE_MS = 1322 / 10_000.0  # clocks a line at 10 MHz
READ_OUT_MS = ROWS * LINE_MS


def capture_ms(cubestar: Any, delay_ms: int) -> float:
    """Time from enabling the sensor to ACK, from telemetry."""
    cubestar.client.command("SetDiscardDelay", Delay=delay_ms)
    cubestar.capture()
    phases = cubestar.phase_times()
    return float(phases["discard"] + phases["capture"])


@pytest.mark.parametrize(
    ("register", "published_fps"), [(30, 11.110), (9, 3.333), (8, 2.966), (7, 2.593), (6, 2.224)]
)
def test_frame_rate_register_sets_the_published_period(
    session: Any, register: int, published_fps: float
) -> None:
    with session(SkyScene.pointing(0, 0)) as opened:
        opened.client.client.command("SetFrameRate", FrameRate=register)
        period_ms = 1000 / published_fps
        first = capture_ms(opened.client, 70)
        # Enabled just after that frame began: it is dropped, and the next one is stored.
        second = capture_ms(opened.client, round(period_ms) + 5)
    assert second - first == pytest.approx(period_ms, rel=2e-3)
    assert first == pytest.approx(period_ms + READ_OUT_MS, abs=2)  # line-rounded, and set-up


@pytest.fixture
def striped(tmp_path: Path) -> PictureScene:
    """A picture whose row r has the grey value 20 + r
    4; its light scales with exposure."""
    rows = np.repeat(20 + np.arange(ROWS, dtype=np.uint8) // 4, 1024).reshape(ROWS, 1024)
    Image.fromarray(rows).save(tmp_path / "striped.png")
    return PictureScene(tmp_path / "striped.png", exposure_ms=385.6)


@pytest.mark.parametrize("delay_ms", [10, 66])
def test_too_short_delay_splits_the_image(
    session: Any, striped: PictureScene, delay_ms: int
) -> None:
    with session(striped) as opened:
        capture_ms(opened.client, delay_ms)
        rows = opened.board.program._capture.memory.image[:, 500].astype(float)
    # The rows of the undefined frame that were still to come, then the first of the good one.
    rest = ROWS - 1 - int(delay_ms / LINE_MS)
    (seam,) = (at for at in range(rest - 2, rest + 2) if abs(rows[at] - rows[at - 1]) > 5)
    light = striped.pixels[:, 500].astype(float)
    upper, lower = light[ROWS - seam :], light[: ROWS - seam]
    assert np.abs(rows[seam:] - lower).max() <= 1
    factor = rows[:seam].sum() / upper.sum()
    assert abs(factor - 1) > 0.02  # another exposure
    assert np.abs(rows[:seam] - factor * upper).max() <= 2


@pytest.mark.slow
def test_published_delay_yields_a_whole_image(session: Any, striped: PictureScene) -> None:
    with session(striped) as opened:
        capture_ms(opened.client, 70)
        streamed = opened.client.stream_image().astype(float)
    assert np.abs(streamed - striped.pixels)[:, 500].max() <= 1
