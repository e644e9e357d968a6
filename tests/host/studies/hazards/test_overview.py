from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.host.studies.hazards.overview import claims


def result(error: float | None, sigma: float = 1.0, **more: Any) -> SimpleNamespace:
    known = error is not None
    axes = {"error_deg": [error] * 3, "sigma_deg": [sigma] * 3}
    return SimpleNamespace(
        **{"solved": known, "right": known, **(axes if known else dict.fromkeys(axes))} | more
    )


def test_claims_count_errors_within_the_claimed_sigmas() -> None:
    results = [result(0.5), result(-2.0), result(5.0), result(-0.1, 0.2), result(None)]
    results[2].right = False
    found = claims(results)  # type: ignore[arg-type]
    shares = {name: found[name] for name in ("right", "refused", "wrong")}
    assert shares == pytest.approx({"right": 60, "refused": 20, "wrong": 20})
    assert (found["inside1"], found["inside3"]) == (50, 75)


def test_claims_are_nan_without_any() -> None:
    found = claims([result(None)])  # type: ignore[list-item]
    assert found["refused"] == 100
    assert np.isnan(found["inside1"])
