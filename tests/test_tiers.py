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


@pytest.mark.parametrize("days", [1, 2, 7])
def test_every_slow_test_has_one_turn_and_a_family_is_spread(days: int) -> None:
    names = ["a::test_x", *(f"a::test_y[{case}]" for case in "abcdefgh"), "a::test_z"]
    each = [days] * len(names)
    turns = [tiers.of_day(names, 739_000 + day, each) for day in range(days)]
    assert [sum(of_test) for of_test in zip(*turns, strict=True)] == [1] * len(names)
    family = [sum(of_day[1:9]) for of_day in turns]
    assert max(family) - min(family) <= 1


@pytest.mark.parametrize(
    ("mark", "turns"), [("daily", [1, 1, 1, 1]), ("slow", [1, 1, 7, 9]), ("weekly", [1, 7, 7, 9])]
)
def test_weekly_tests_have_a_turn_in_a_week_and_daily_ones_always(
    mark: str, turns: list[int], request: pytest.FixtureRequest
) -> None:
    item = request.node
    item.add_marker(mark)
    assert [tiers.turns(item, days) for days in (0, 1, 7, 9)] == turns
