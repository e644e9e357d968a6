from collections.abc import Iterator

import pytest

from cubestack.host.devices.registry import device, device_names
from cubestack.host.errors import TargetError
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
