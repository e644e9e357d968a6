"""What every top has to do, at every rate, on Icarus Verilog."""

from typing import Any

import pytest
from regression import FULL, TIERS

BENCHES = {
    "cubestar": "bench:Bench",
    "cubestar-shared": "bench_next:SharedBench",
    "cubestar-double": "bench_next:DoubleBench",
    "cubestar-boards": "bench_next:BoardsBench",
    "cubesense-pair": "pair:PairBench",
}


@pytest.mark.parametrize("module", ["benches_any_top", *["benches_rates"] * FULL])
@pytest.mark.parametrize("top", BENCHES)
def test_any_top(icarus: Any, top: str, module: str) -> None:
    tier = TIERS[top]
    environment = {**tier.environment, "BENCH": BENCHES[top]}
    icarus.run(tier.design, tier.columns, tier.rows, module, seed=1, environment=environment)


@pytest.mark.parametrize("top", [top for top in BENCHES if top.startswith("cubestar")])
def test_is_left_in_every_state(icarus: Any, top: str) -> None:
    tier = TIERS[top]
    environment = {"BENCH": BENCHES[top]}
    icarus.run(
        tier.design, tier.columns, tier.rows, "benches_states", seed=1, environment=environment
    )
