"""Requirements of every top, at every rate and from every state, on Icarus Verilog."""

from typing import Any

import pytest

from tests.hdl.regression import ANY_TOP, FULL, PAIR, RATES, STAR, TIERS, modules
from tests.tiers import quick

CUBESTAR = ["cubestar", "cubestar-shared", "cubestar-double", "cubestar-boards"]
CASES = [
    *[(top, name) for top in (*CUBESTAR, "cubesense-pair") for name in (ANY_TOP, *[RATES] * FULL)],
    *[(top, *modules(STAR, "states")) for top in CUBESTAR],
    ("cubesense-pair", *modules(PAIR, "borders")),
    *[(top, *modules(PAIR, "states")) for top in TIERS if top.startswith(("cubesense",) * FULL)],
]


@pytest.mark.parametrize(("top", "module"), quick(CASES, 1))
def test_every_top_passes_its_testbench(icarus: Any, top: str, module: str) -> None:
    tier = TIERS[top]
    settings = {"seed": 1, "environment": tier.further}
    icarus.run(tier.design, tier.columns, tier.rows, module, **settings)
