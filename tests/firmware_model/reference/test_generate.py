import runpy
import sys
from pathlib import Path

import pytest

from cubestack.firmware_model.reference import generate, tables


def test_creates_named_output_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "header", lambda: "the header")  # all of them take a second
    monkeypatch.setattr(tables, "source", lambda: "the source")
    folder = tmp_path / "build" / "generated"
    monkeypatch.setattr(sys, "argv", ["generate", str(folder)])
    runpy.run_path(generate.__file__, run_name="__main__")
    names = {path.name for path in folder.iterdir()}
    assert names == {"cubestar_tables.h", "cubestar_tables.c", "pins.h", "efm32gg.h"}
    assert (folder / "cubestar_tables.c").read_text() == "the source"
