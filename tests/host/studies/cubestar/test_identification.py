"""The benchmark of identification alone."""

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.studies.cubestar import identification


@pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")
def test_compiled_identification_is_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(identification, "PICTURES", 20)
    figures = identification.identification_figures()
    assert set(figures) == {f"identify_{n}_{what}" for n in (10, 20) for what in ("ms", "ratio")}
    assert figures["identify_20_ratio"] > 1.2
