import pytest

from tests.benchmarks import scale
from tests.benchmarks.scale import Cost, million_price, simulated_s


def test_cost_of_a_further_sky_is_without_the_start() -> None:
    assert Cost(1010, 21.5, 0, 0).sky_ms(Cost(10, 1.5, 0, 0)) == pytest.approx(20)


def test_workers_share_the_blocks_until_the_scheduler_is_busy() -> None:
    assert simulated_s(1, 10, 2.0, 0.0) == pytest.approx(20)
    assert simulated_s(8, 800, 2.0, 0.0) == pytest.approx(200)
    assert 200 < simulated_s(8, 800, 2.0, 0.01) < 205
    # Eight blocks are done in 2 s, but the scheduler hands out only two in that time.
    assert simulated_s(8, 800, 2.0, 1.0) == pytest.approx(802)


def test_price_of_a_million_skies() -> None:
    assert million_price(0.036, 0.05) == pytest.approx(0.5)


@pytest.mark.slow
def test_campaign_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert scale.main(["2", "4", "--one"]) == 0
    said = capsys.readouterr().out
    assert "4 skies: " in said
    assert "a million skies: " in said
