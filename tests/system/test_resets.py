from collections.abc import Callable
from typing import Any

import pytest
from smbus2 import i2c_msg

from cubestack.emulator.boards.aramis import board as aramis_board
from cubestack.emulator.boards.cubestar import board as cubestar_board
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.firmware_model.mcu.memory import FlashStore
from tests.system.conftest import ROOT
from tests.system.cubesense.conftest import held
from tests.system.faults.bench import BENCHES, powered

Read = Callable[[Any], object]


def shown(frame: str, *fields: str) -> Read:
    """The given fields of a telemetry frame, by default all."""
    return lambda bench: [
        value for name, value in bench.telemetry(frame).items() if not fields or name in fields
    ]


def flags(bench: Any) -> object:
    return bench.flags()


def saved_delay(bench: Any) -> object:
    do(bench, "ReadConfig")
    return bench.telemetry("DelayTime")


def many(frame: str) -> Read:
    """Whether more telecommands were counted than the reset and this read make."""
    return lambda bench: bench.telemetry(frame)["TcmdCount"] > 10


#: How to see each row of a page's table; the last one changes something.
ITEMS: dict[str, dict[str, Read]] = {
    "cubestar": {
        "settings": shown("DelayTime"),
        "switches (telemetry 208)": shown("Profile"),
        "picture in memory": shown("PerformanceParameters", "ImageCaptureSuccess"),
        "latest attitude": shown("AttitudeQuaternion", "Q0", "Q1", "Q2", "Q3"),
        "its validity": shown("AttitudeQuaternion", "Valid"),
        "mode flag": shown("LoopStatus", "ModeFlag"),
        "direction of setTrackingMode": lambda b: b.board.program.state.retained.hint_present,
        "counters": many("ExtendedIdentification"),
        "error flags": flags,
        "1 s loop": shown("LoopStatus", "Running"),
        "imager switched off": shown("PowerStatus", "Status"),
        "stars of the latest picture, times of its steps": lambda b: (
            b.telemetry("DetectionSummary")["NumStarsDetected"],
            b.telemetry("DetectionTimingTwo")["StarDetectionTime"],
        ),
        "result of TestSRAM": shown("SRAMTestResults"),
        "progress of an upload": shown("UploadStatus"),
        "saved configuration": saved_delay,
    },
    "cubesense": {
        "settings": shown("Configuration", "Threshold2"),
        "switches (telemetry 227)": shown("Profile"),
        "counters": many("CommunicationStatus"),
        "error flags": flags,
        "latest results": shown("Result2", "Alpha", "Beta"),
        "pictures in memory": lambda b: held(b.board, Camera.NADIR).tobytes(),
        "picture selected for download": shown("ImageFrameInfo"),
        "memory that is cut off": shown("Power", "OverCurrent1"),
        "runtime": lambda b: b.telemetry("Identification")["RuntimeSeconds"] > 2,
    },
    "aramis": {
        "settings": shown("Gain"),
        "body rotation": shown("BodyRotation"),
        "catalogue in flash": lambda b: b.board.faults._sites.all_memories()["flash"].tobytes(),
        "switches (telemetry 210)": shown("Profile"),
        "activation, with the catalogue in RAM": shown("SensorStatus", "State", "Catalogue"),
        "time": shown("SystemTime", "JulianDay"),
        "latest attitude": shown("Attitude", "Q0", "Q1", "Q2", "Q3"),
        "counters": many("ExtendedIdentification"),
        "error flags": flags,
        "loop": shown("LoopStatus", "Running"),
        "catalogue that is being loaded": shown("UploadStatus"),
        "camera switched off": shown("SupplyStatus", "Switch"),
    },
}


def do(bench: Any, name: str, **parameters: object) -> None:
    bench.client.command(name, **parameters)
    bench.client.wait_processed(10.0)


def prepare(bench: Any) -> None:
    """Changes switches, counts telecommands and sets an error flag, on any device."""
    for _ in range(11):
        do(bench, "SetProfile", Profile="EXTENDED")
    bench.board.i2c().i2c_rdwr(i2c_msg.read(bench.interface.i2c_address, 1))  # without an ID


def prepare_cubestar(bench: Any, loop: bool = True) -> object:
    prepare(bench)
    do(bench, "TestSRAM")
    do(bench, "UploadImage")
    do(bench, "UploadBlock", BlockNumber=1, Data=bytes(128))
    do(bench, "setDelayTimerTimeout", Time=7)
    do(bench, "SaveConfig")
    do(bench, "setDelayTimerTimeout", Time=100)
    do(bench, "CaptureAndProcess")
    do(bench, "setTrackingMode", RightAscension=0.1, Declination=0.1)
    if loop:
        do(bench, "TogglePowerSW")
        do(bench, "Trigger")
    return [7]


def prepare_cubesense(bench: Any) -> None:
    prepare(bench)
    do(bench, "DetectionThreshold2", Threshold=75)
    do(bench, "CaptureAndDetect", Camera="NADIR", Sram="SRAM2")
    do(bench, "StartImageDownload", Sram="SRAM2", Location="TOP", Size="SIDE_64")
    bench.client.pause(3.0)
    bench.inject("latch-up", target="SRAM1")
    bench.client.pause(0.1)


def prepare_aramis(bench: Any) -> object:
    prepare(bench)
    do(bench, "SetBodyRotation", Q0=0, Q1=1, Q2=0, Q3=0)
    do(bench, "SetGain", Gain=13)
    do(bench, "SaveConfig")
    do(bench, "SetGain", Gain=14)
    do(bench, "SetSystemTime", JulianDay=2_461_366, Millisecond=0)
    do(bench, "Activate")
    do(bench, "GetAttitude")
    do(bench, "BeginCatalogue", Length=1000, Checksum=1)
    do(bench, "CatalogueBlock", BlockNumber=0, Data=bytes(128))
    do(bench, "StartLoop", Period=60_000, Mode=0)
    bench.client.pause(3.0)
    do(bench, "LatchUpAction", Step="OFF")
    return [13.0]


PREPARE: dict[str, Callable[..., object]] = {
    "cubestar": prepare_cubestar,
    "cubesense": prepare_cubesense,
    "aramis": prepare_aramis,
}

PAGES = {"cubestar": "protocols", "cubesense": "protocols-cubesense", "aramis": "protocols-aramis"}

#: What resets, by device and column of its page's table: a telecommand, or a fault's target.
RESETS: list[tuple[str, int, str, dict[str, Any]]] = [
    ("cubestar", 1, "Reset", {}),
    ("cubestar", 2, "MCUReset", {}),
    ("cubestar", 2, "TestWDG", {}),
    *(("cubestar", 2, fault, {}) for fault in ("brown-out", "reset-pin", "lock-up")),
    *(("cubesense", column, "Reset", {"Target": column}) for column in (1, 2, 3)),
    ("aramis", 1, "Reset", {}),
]


def table(name: str) -> dict[str, list[str]]:
    """Rows of the page's table: item, and its fate by column."""
    page = (ROOT / "docs" / "sensors" / f"{PAGES[name]}.md").read_text(encoding="utf-8")
    part = page.split("## What a reset keeps\n")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in part.splitlines() if line.startswith("|")]
    return {row[0].strip(): [cell.strip() for cell in row[1:]] for row in rows[2:]}


def there_is(name: str, bench: Any) -> dict[str, object]:
    stored = {"saved configuration": {"Timeout": 7}}  # not read: that would bring it back
    return {item: stored.get(item) or read(bench) for item, read in ITEMS[name].items()}


def check(name: str, column: int, before: dict[str, object], bench: Any, saved: object) -> None:
    """Each item is as documented; ``before`` are the values before the reset."""
    wrong = []
    for item, read in ITEMS[name].items():
        value = read(bench)
        told = table(name)[item][column]
        if item in before:
            right = {"kept": value == before[item], "lost": value != before[item]}
            if not (right | {"saved": value == saved}).get(told):
                wrong.append((item, told, before[item], value))
    assert not wrong


@pytest.mark.parametrize("name", BENCHES)
def test_every_row_of_the_page_is_tested(name: str) -> None:
    assert {*table(name)} - {*ITEMS[name]} == {"waiting telecommands"} & {*table(name)}
    assert {cell for row in table(name).values() for cell in row} <= {"kept", "lost", "saved"}


@pytest.mark.parametrize(("name", "column", "what", "parameters"), RESETS)
def test_reset_keeps_only_what_is_documented(
    name: str, column: int, what: str, parameters: dict[str, Any]
) -> None:
    hangs = {"loop": False} if what == "TestWDG" else {}  # else the loop is under way when it ends
    with powered(name, "published") as bench:
        saved = PREPARE[name](bench, **hangs)
        before = there_is(name, bench)
        if hangs:
            del before["1 s loop"], before["imager switched off"]
        resets = bench.board.processor.resets
        if what in {message.name for message in bench.interface.telecommands}:
            bench.client.command(what, **parameters)
        else:
            bench.inject("processor-reset", target=what)
        bench.client.pause(2.1 if hangs else 0.9 if name == "cubesense" else 0.05)
        assert bench.board.processor.resets - resets == (name != "cubesense" or column == 3)
        check(name, column, before, bench, saved)


@pytest.mark.parametrize("name", BENCHES)
def test_power_cycle_keeps_only_what_is_documented(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with powered(name, "published") as bench:
        saved = PREPARE[name](bench)
        before = there_is(name, bench)
        hardware = getattr(bench.board, "_hardware", None)
        flash = FlashStore() if hardware is None else hardware.flash
    for module in (cubestar_board, aramis_board):
        monkeypatch.setattr(module, "FlashStore", lambda: flash)
    with powered(name, "published") as bench:
        bench.client.pause(0.5)
        check(name, 0, before, bench, saved)


@pytest.mark.parametrize("what", ["Reset", "MCUReset"])
def test_telecommands_behind_a_reset_are_lost(what: str) -> None:
    with powered("cubestar", "published") as bench:
        do(bench, "CaptureImage")
        for name in ("DetectStars", what):  # the first one takes long enough
            bench.client.command(name)
        bench.client.command("Exposure", exposure=77)
        bench.client.pause(1.0)
        assert bench.board.processor.resets == 1
        assert bench.telemetry("Exposure")["exposure"] == 0
        assert bench.telemetry("TcmdProcessed")["Processed"]
