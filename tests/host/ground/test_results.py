import csv
from collections.abc import Iterator
from io import BytesIO, StringIO

import pyarrow.parquet
import pytest

from cubestack.host.ground import results
from cubestack.host.ground.results import ResultLog


@pytest.fixture
def log() -> Iterator[ResultLog]:
    opened = ResultLog()
    yield opened
    opened.close()


def lines(log: ResultLog) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(log.csv().decode())))


def test_lines_have_every_column(log: ResultLog) -> None:
    log.add({"ra_deg": 359.5, "task": "IDLE"}, {"ra_deg": 0.25, "dec_deg": 1.0})
    log.add({"ra_deg": None, "task": "a,b\n", "stars": 4}, {})
    first, second = lines(log)
    assert (first["ra_deg"], first["task"], first["stars"]) == ("359.5", "IDLE", "")
    assert float(first["ra_error_deg"]) == -0.75  # the short way round
    assert (second["ra_deg"], second["task"], second["ra_error_deg"]) == ("", "a,b\n", "")
    table = pyarrow.parquet.read_table(BytesIO(log.parquet())).to_pydict()
    assert list(table) == list(first)
    assert (table["stars"], table["ra_error_deg"]) == ([None, 4.0], [-0.75, None])
    assert table["utc"] == [first["utc"], second["utc"]]


def test_direction_has_one_error_angle(log: ResultLog) -> None:
    truth = {"sun_alpha_deg": 3.0, "sun_beta_deg": 4.0}
    log.add({"sun_alpha_deg": 0.0, "sun_beta_deg": 0.0}, truth)
    log.add({"sun_alpha_deg": -3.0, "sun_beta_deg": -4.0}, truth)
    log.add({"sun_alpha_deg": None, "sun_beta_deg": None}, truth)
    found = [one["sun_error_deg"] for one in lines(log)]
    assert [float(one) for one in found[:2]] == pytest.approx([5.0, 10.0])
    assert found[2] == ""
    assert [one["sun_beta_error_deg"] for one in lines(log)] == ["-4.0", "-8.0", ""]


def test_failures_add_no_lines(log: ResultLog) -> None:
    log.add({"error": "no answer"}, {})
    log.add({}, {})
    assert (log.count, lines(log)) == (0, [])
    assert pyarrow.parquet.read_table(BytesIO(log.parquet())).num_rows == 0


def test_log_is_read_in_chunks_up_to_its_maximum(
    log: ResultLog, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(results, "MOST", 3000)
    for number in range(3010):
        log.add({"number": number, "text": 400 * "x"}, {})
    assert [int(one["number"]) for one in lines(log)] == list(range(3000))
