from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.scene.sky import PictureScene


@pytest.fixture
def striped(tmp_path: Path) -> PictureScene:
    """A picture whose row r has the grey value 100 + r // 4, below 228."""
    rows = np.repeat(100 + np.arange(512, dtype=np.uint8) // 4, 1024).reshape(512, 1024)
    Image.fromarray(rows).save(tmp_path / "striped.png")
    return PictureScene(tmp_path / "striped.png")
