import csv
from collections.abc import Iterator
from io import BytesIO, StringIO

import pyarrow.parquet
import pytest

from cubestack.host.devices.registry import device, device_names
from cubestack.host.errors import TargetError
from cubestack.host.ground import results
from cubestack.host.ground.results import ResultLog
from cubestack.host.ground.session import TargetSession
from cubestack.host.ground.tables import SELECTED, sensor_rows, setting_rows
from cubestack.host.targets import open_target


@pytest.fixture(params=device_names())
def session(request: pytest.FixtureRequest) -> Iterator[TargetSession]:
    opened = TargetSession(open_target(f"emulated:{request.param}"))
    yield opened
    opened.close()


def shown(session: TargetSession, row: dict[str, object]) -> object:
    return session.execute(f"read {row['frame']} {row['field']}").result()["data"]["values"][
        row["field"]
    ]


def test_settings_have_their_defaults_after_power_up(session: TargetSession) -> None:
    rows = session.about["settings"]
    assert len(rows) >= 9
    assert SELECTED not in {row["frame"] for row in rows}
    differing = {}
    for row in rows:
        found = shown(session, row)
        if found != pytest.approx(row["default"], rel=1e-6):
            differing[f"{row['telecommand']}.{row['parameter']}"] = found
    # What the firmware chooses by itself: the board's profile, and an exposure once it is on.
    assert differing.keys() <= {"SetProfile.Profile", "Exposure.exposure"}


def test_changed_setting_is_shown() -> None:
    session = TargetSession(open_target("emulated:cubesense"))
    rows = {(one["frame"], one["field"]): one for one in setting_rows(device("cubesense"))}
    row = rows["Masks1", "YMax3"]
    assert (row["telecommand"], row["default"], shown(session, row)) == ("Mask1", 0, 0)
    session.execute("write Mask1 3 1 9 2 8").result()
    assert shown(session, row) == 8
    session.close()


def test_sensor_registers_are_read_by_name(session: TargetSession) -> None:
    rows = session.about["sensor_registers"]
    if not rows:
        assert "single register" in session.about["missing"]["sensor_registers"]
        with pytest.raises(TargetError, match="single register"):
            session.sensor_register("EXPOSURE").result()
        return
    fixed = [row for row in rows if row["access"] == "ro"] or rows[:1]
    for row in fixed:
        assert session.sensor_register(row["name"]).result()["value"] == row["default"]
    with pytest.raises(TargetError, match="no register 'NONE'"):
        session.sensor_register("NONE").result()


def test_sensor_registers_are_big_endian() -> None:
    session = TargetSession(open_target("emulated:cubestar"))
    (row,) = [one for one in sensor_rows(device("cubestar")) if one["name"] == "CLOCKS_PER_SECOND"]
    session.execute(f"write WriteCameraRegister {row['address']} 0x12").result()
    assert session.sensor_register(row["name"]).result()["value"] == "12" + row["default"][2:]
    session.close()


# --- logged results -------------------------------------------------------------------------------


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


def test_result_log_has_one_error_angle_per_direction(log: ResultLog) -> None:
    truth = {"sun_alpha_deg": 3.0, "sun_beta_deg": 4.0}
    log.add({"sun_alpha_deg": 0.0, "sun_beta_deg": 0.0}, truth)
    log.add({"sun_alpha_deg": -3.0, "sun_beta_deg": -4.0}, truth)
    log.add({"sun_alpha_deg": None, "sun_beta_deg": None}, truth)
    found = [one["sun_error_deg"] for one in lines(log)]
    assert [float(one) for one in found[:2]] == pytest.approx([5.0, 10.0])
    assert found[2] == ""
    assert [one["sun_beta_error_deg"] for one in lines(log)] == ["-4.0", "-8.0", ""]


def test_failed_readings_add_no_lines_to_the_result_log(log: ResultLog) -> None:
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
