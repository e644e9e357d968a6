from dataclasses import replace

import pytest

from cubestack.host.devices.registry import device
from cubestack.host.experiments.measure import experiment_of
from cubestack.host.studies.upsets.atlas import HEAD, atlas, lines, rows
from cubestack.host.studies.upsets.sample import UpsetResult

RIGHT = UpsetResult(
    *("writer$3.row", 0, False, "storing", 1.0, "nothing", "right", "", 0),
    *({"idle": 0.75, "storing": 0.25}, 1.0, 9, 2.0),
)
PICTURE = replace(RIGHT, effect="picture", bit=1)
WRONG = replace(PICTURE, answer="wrong", recovered=1)
IDLE = replace(RIGHT, phase="idle")


def test_atlas_merges_numbered_names_and_counts_effects() -> None:
    (part,) = atlas([RIGHT, PICTURE, WRONG, IDLE])
    assert part.name == "writer.row"
    assert (part.effects["picture"], part.effects["nothing"], part.answers["wrong"]) == (2, 2, 1)
    assert (part.seen, part.healed) == (2, (1, 1))


def test_rate_weights_phases_by_duration() -> None:
    (part,) = atlas([RIGHT, PICTURE, WRONG, IDLE])
    # Of what is stored in a quarter of the second two upsets of three are seen, of 9 bits.
    assert part.a_day == pytest.approx(2.0 * 9 * 0.25 * 2 / 3)
    (idle,) = atlas([replace(PICTURE, phase="idle")])
    assert idle.a_day == pytest.approx(2.0 * 9 * 0.75)


def test_left_over_state_is_seen_only_with_a_bad_answer() -> None:
    left = replace(RIGHT, effect="left over")
    assert atlas([left])[0].seen == 0
    assert atlas([replace(left, answer="refused")])[0].seen == 1


def test_table_has_all_parts_and_their_sum() -> None:
    results = [RIGHT, WRONG, replace(WRONG, target="bank", bits=1)]
    table = list(rows(atlas(results)))
    assert [len(row) for row in table] == [len(HEAD)] * 3
    assert [row[0] for row in table] == ["bank", "writer.row", "all"]
    assert float(table[-1][-1]) == pytest.approx(sum(float(row[-1]) for row in table[:-1]), rel=0.1)
    assert any("writer.row" in line and "1 picture" in line for line in lines(results))


def test_report_has_table_and_figure() -> None:
    tested = experiment_of(device("cubestar"), "upsets")
    table, figure = tested.sections(map(vars, [RIGHT, WRONG]))
    assert list(table.head) == list(HEAD)
    assert figure.png.startswith(b"\x89PNG")
