import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from .conftest import ROOT

FILE = ROOT / "examples" / "tour.ipynb"
SOON_S = 120


def text_of(notebook: nbformat.NotebookNode) -> str:
    """All that its cells print and show as text."""
    outputs = [one for cell in notebook.cells for one in cell.get("outputs", ())]
    return "\n".join(one.get("text") or one.data["text/plain"] for one in outputs)


def test_notebook_has_no_outputs() -> None:
    notebook = nbformat.read(FILE, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) > 4
    for cell in code:
        assert (cell.outputs, cell.execution_count) == ([], None)


@pytest.mark.slow
def test_notebook_runs_and_finds_the_attitude(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_DATA_DIR", "JUPYTER_CONFIG_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    notebook = nbformat.read(FILE, as_version=4)
    folder = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=SOON_S, kernel_name="python3", resources=folder).execute()
    text = text_of(notebook)
    assert "1024 x 512 pixels in" in text
    assert len(re.findall(r"HIP +\d+ ", text)) >= 5
    (error,) = re.findall(r"([\d.]+) deg between them", text)
    assert 0 < float(error) < 0.05
    pictures = [one for cell in notebook.cells for one in cell.get("outputs", ())]
    assert any("image/png" in one.get("data", {}) for one in pictures)
