"""AraMiS' tables against the thesis' use cases and the program's own numbers."""

import pytest

from cubestack.firmware_model.aramis.detection.mask import SpikeRemoval
from cubestack.firmware_model.aramis.solution import Reason as Finding
from cubestack.firmware_model.interface.aramis import (
    IMAGE_BYTES,
    INTERFACE,
    MS_PER_DAY,
    AckError,
    LatchUpStep,
    Reason,
    SpikeMethod,
)
from cubestack.firmware_model.interface.aramis.telemetry import SETTINGS_SHOWN

# AraMiS thesis, section 2.2: use case to telecommands.
USE_CASES = {
    "activateStarSensor": ["Activate"],
    "deactivateStarSensor": ["Deactivate"],
    "sendSystemTime": ["SetSystemTime"],
    "getStarAttitudeQuaternion": ["GetAttitude", "GetAttitudeNearVector", "GetAttitudeNearPoint"],
    "SELaction": ["LatchUpAction"],
    "inputStarcatalogue": ["BeginCatalogue", "CatalogueBlock", "CommitCatalogue"],
    "inputAOCSparameters": ["SetBodyRotation"],
}


def test_use_case_telecommands_are_exactly_the_non_extensions() -> None:
    named = [name for names in USE_CASES.values() for name in names]
    assert named == [m.name for m in INTERFACE.telecommands if not m.extension]
    assert {m.id >= 100 for m in INTERFACE.telecommands if m.extension} == {True}


def test_aramis_node_has_its_address_and_baud_rate() -> None:
    assert (INTERFACE.i2c_address, INTERFACE.baud) == (0x1D, 57_600)
    assert INTERFACE.ack_errors is AckError
    assert INTERFACE.telemetry("TcmdProcessed").field("Processed").type == "u8"


def test_attitude_telemetry_has_quaternion_time_outcome_and_reason() -> None:
    names = {field.name for field in INTERFACE.telemetry("Attitude").fields}
    wanted = {"Q0", "Q1", "Q2", "Q3", "JulianDay", "Millisecond", "Outcome", "Reason", "Valid"}
    assert wanted <= names


def test_every_processing_finding_has_a_telemetry_reason() -> None:
    assert {finding.name for finding in Finding} <= {reason.name for reason in Reason}
    others = {r.name for r in Reason} - {f.name for f in Finding} - {"NOT_MEASURED"}
    assert all(Reason[name] >= 16 for name in others)


def test_telecommand_spike_methods_match_the_processing() -> None:
    assert {m.name: int(m) for m in SpikeMethod} == {m.name: int(m) for m in SpikeRemoval}


def test_setting_telemetry_has_the_fields_of_its_telecommand() -> None:
    for frame, command in SETTINGS_SHOWN.items():
        assert INTERFACE.telemetry(frame).fields == INTERFACE.telecommand(command).fields
    settings = {m.name for m in INTERFACE.telecommands if m.name.startswith("Set")}
    assert settings - {"SetSystemTime", "SetProfile", "SetSwitch"} <= set(SETTINGS_SHOWN.values())


def test_telecommand_limits_match_the_hardware_limits() -> None:
    last = INTERFACE.telecommand("ImageBlockSet").field("BlockNumber").high
    assert last == IMAGE_BYTES // 128 - 1 == 1280 * 1024 // 128 - 1
    assert INTERFACE.telecommand("SetExposure").field("Rows").high == 0x3FFF
    assert INTERFACE.telecommand("SetSystemTime").field("Millisecond").high == MS_PER_DAY - 1


@pytest.mark.parametrize(
    ("command", "values", "wire"),
    [
        ("LatchUpAction", {"Step": LatchUpStep.OFF}, "00"),
        ("SetSystemTime", {"JulianDay": 2_461_366, "Millisecond": 1000}, "b68e2500e8030000"),
        ("SetGain", {"Gain": 8.5}, "44"),
        ("StartLoop", {"Period": 500, "Mode": 1}, "f40101"),
    ],
)
def test_telecommands_encode_to_the_documented_bytes(
    command: str, values: dict[str, object], wire: str
) -> None:
    assert INTERFACE.telecommand(command).pack(**values).hex() == wire
