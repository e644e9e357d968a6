import pytest

from tests import tiers


@pytest.mark.parametrize(("turns", "cases"), [(4, 50), (16, 200), (5, 11), (3, 25), (5, 5)])
def test_every_case_has_its_day(turns: int, cases: int, monkeypatch: pytest.MonkeyPatch) -> None:
    found = set[int]()
    for day in range(-(-cases // turns)):
        monkeypatch.setattr(tiers, "DAY", 739_000 + day)
        of_day = [tiers.todays(turn, turns, cases) for turn in range(turns)]
        assert len({*of_day}) == turns
        found |= {*of_day}
    assert found == set(range(cases))
