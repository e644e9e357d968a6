"""What every telecommand of the table does, seen from the pins and the buses."""

from collections.abc import Callable

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.commands import SOFTWARE_RESET
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.thumbnail import thumbnail
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    EMPTY_FRAME,
    Camera,
    CaptureResult,
    DetectResult,
    ImageSize,
    NadirSearch,
    ResetTarget,
    Sram,
    SramSelection,
    checksum,
    split_coefficient,
)
from cubestack.firmware_model.interface.cubesense.pins import CAMERA_POWER
from cubestack.firmware_model.mcu.requests import SetPin

from .bench import Bench
from .scenery import earth, place, sun

Effect = Callable[[Bench], None]
EFFECTS: dict[str, Effect] = {}

SUN_BORESIGHT = (369.0, 250.0)


def telecommand(*names: str) -> Callable[[Effect], Effect]:
    """The function shows what the telecommands do."""

    def register(effect: Effect) -> Effect:
        for name in names:
            assert EFFECTS.setdefault(name, effect) is effect
        return effect

    return register


def lit(bench: Bench) -> None:
    """Both cameras see what they look for, at (12, -7) deg."""
    bench.scenes[Camera.SUN] = sun(place(12.0, -7.0, SUN_BORESIGHT), 5.0)
    bench.scenes[Camera.NADIR] = earth(12.0, -7.0)


def result(bench: Bench, camera: Camera) -> dict[str, float]:
    return bench.telemetry(f"Result{camera + 1}")


def measured(bench: Bench, camera: Camera) -> tuple[DetectResult, float, float]:
    """What a measurement finds."""
    bench.command("CaptureAndDetect", Camera=camera, Sram=camera)
    found = result(bench, camera)
    return DetectResult(int(found["Detect"])), found["Alpha"], found["Beta"]


def frame(bench: Bench) -> bytes:
    return bytes(bench.telemetry("ImageFrame")["Frame"])


@pytest.mark.parametrize("name", [message.name for message in INTERFACE.telecommands])
def test_every_telecommand_does_what_it_says(bench: Bench, name: str) -> None:
    EFFECTS[name](bench)


def test_every_telecommand_has_an_effect_and_no_other_does(bench: Bench) -> None:
    declared = {message.name for message in INTERFACE.telecommands}
    assert bench.program.commands.handled == EFFECTS.keys() == declared


# --- node ---------------------------------------------------------------------------------------


@telecommand("Reset")
def reset(bench: Bench) -> None:
    bench.command("DetectionThreshold1", Threshold=9)
    bench.command("StartImageDownload", Size=ImageSize.SIDE_64)
    bench.uart(b"noise")
    bench.command("Reset", Target=ResetTarget.COMMUNICATION)
    counts = bench.telemetry("CommunicationStatus")
    assert counts == {**dict.fromkeys(counts, 0), "TlmCount": 1}
    assert bench.telemetry("TcmdProcessed") == {"LastTcmd": 0, "Processed": 1, "Error": 0}
    assert bench.telemetry("ImageFrameInfo")["FrameNumber"] == EMPTY_FRAME
    assert bench.send("NextImageFrame") == 3
    assert bench.resets == []

    bench.log.clear()
    bench.command("Reset", Target=ResetTarget.CAMERAS)
    requests = [request for _, request in bench.log]
    for camera in Camera:
        off, on = (requests.index(SetPin(CAMERA_POWER[camera], level)) for level in (0, 1))
        assert off < on
        assert bench.cameras[camera].registers["EXPOSURE"] > 0
    assert bench.telemetry("Configuration")["Threshold1"] == 9

    bench.command("Reset", Target=ResetTarget.MCU)
    assert bench.resets == [SOFTWARE_RESET]
    assert bench.telemetry("Configuration")["Threshold1"] == 225


@telecommand("ClearOverCurrent")
def clear_over_current(bench: Bench) -> None:
    for selection in SramSelection:
        memories = set(Sram) if selection is SramSelection.BOTH else {Sram(selection)}
        bench.latched = set(Sram) - bench.cut()
        bench.run(until_us=bench.now_us + 20_000)
        assert bench.cut() == set(Sram)
        bench.command("ClearOverCurrent", Selection=selection)
        assert bench.cut() == set(Sram) - memories


# --- measurement --------------------------------------------------------------------------------


@telecommand("CaptureAndDetect")
def capture_and_detect(bench: Bench) -> None:
    lit(bench)
    for camera in Camera:
        for sram in Sram:
            bench.command("CaptureAndDetect", Camera=camera, Sram=sram)
            found = result(bench, camera)
            own = CaptureResult.STORED_OWN_SRAM
            assert found["Capture"] == (own if sram == camera else CaptureResult.STORED_OTHER_SRAM)
            assert found["Detect"] == DetectResult.SUCCESS
            assert (found["Alpha"], found["Beta"]) == pytest.approx((12.0, -7.0), abs=0.5)
            np.testing.assert_array_equal(bench.memories[sram], bench.scenes[camera])


@telecommand("CaptureOnly")
def capture_only(bench: Bench) -> None:
    lit(bench)
    for camera in Camera:
        for sram in Sram:
            bench.command("CaptureOnly", Camera=camera, Sram=sram)
            assert result(bench, camera)["Detect"] == DetectResult.NONE_SCHEDULED
            np.testing.assert_array_equal(bench.memories[sram], bench.scenes[camera])


# --- settings -----------------------------------------------------------------------------------


@telecommand("DetectionThreshold1", "DetectionThreshold2")
def detection_threshold(bench: Bench) -> None:
    lit(bench)
    bench.scenes[Camera.SUN] = np.minimum(bench.scenes[Camera.SUN], 240)  # type: ignore[type-var]
    bench.command("DetectionThreshold1", Threshold=241)
    assert measured(bench, Camera.SUN)[0] is DetectResult.SUN_NOT_FOUND
    assert measured(bench, Camera.NADIR)[0] is DetectResult.SUCCESS
    bench.command("DetectionThreshold1", Threshold=240)
    assert measured(bench, Camera.SUN)[0] is DetectResult.SUCCESS
    bench.command("DetectionThreshold2", Threshold=250)
    assert measured(bench, Camera.NADIR)[0] is DetectResult.TOO_FEW_EDGES


@telecommand("AutoAdjust1", "AutoAdjust2")
def auto_adjust(bench: Bench) -> None:
    for camera in Camera:
        assert bench.cameras[camera].registers["COMMON_B"] & 1 == 0
        bench.command(f"AutoAdjust{camera + 1}", Enabled=1)
        bench.command("CaptureOnly", Camera=camera)
        assert bench.cameras[camera].registers["COMMON_B"] & 1 == 1
        assert bench.telemetry("Configuration")[f"AutoAdjust{camera + 1}"] == 1


@telecommand("CameraSettings1", "CameraSettings2")
def camera_settings(bench: Bench) -> None:
    for camera, exposure in zip(Camera, (0x1F1F, 200), strict=True):
        sent = {"Exposure": exposure, "Gain": 0x1F, "BlueGain": 0x81, "RedGain": 0x7E}
        bench.command(f"CameraSettings{camera + 1}", **sent)
        bench.command("CaptureOnly", Camera=camera)
        registers = bench.cameras[camera].registers
        assert registers["EXPOSURE"] == min(exposure, 255)
        names = ("GAIN", "BLUE_GAIN", "RED_GAIN")
        assert [registers[name] for name in names] == [0x1F, 0x81, 0x7E]
        shown = bench.telemetry("Configuration")
        assert {name: shown[f"{name}{camera + 1}"] for name in sent} == sent


@telecommand("Boresight1", "Boresight2")
def boresight(bench: Bench) -> None:
    lit(bench)
    for camera in Camera:
        reset_value = INTERFACE.telecommand(f"Boresight{camera + 1}").reset_values()
        x, y = float(reset_value["X"]), float(reset_value["Y"])
        before = measured(bench, camera)
        bench.command(f"Boresight{camera + 1}", X=x - 2.9, Y=y + 5.8)
        after = measured(bench, camera)
        moved = (after[1] - before[1], after[2] - before[2])
        # Edges far from the axis move by more than the angle there.
        tolerance = 0.1 if camera is Camera.SUN else 0.7
        assert moved == pytest.approx((1.0, -2.0), abs=tolerance)


@telecommand("Mask1", "Mask2")
def mask(bench: Bench) -> None:
    lit(bench)
    missed = {Camera.SUN: DetectResult.SUN_NOT_FOUND, Camera.NADIR: DetectResult.TOO_FEW_EDGES}
    for camera in Camera:
        name = f"Mask{camera + 1}"
        bench.command(name, Area=3, XMin=0, XMax=639, YMin=0, YMax=479)
        assert measured(bench, camera)[0] is missed[camera]
        bench.command(name, Area=3, XMin=0, XMax=0, YMin=0, YMax=0)
        bench.command(name, Area=5, XMin=0, XMax=1, YMin=2, YMax=3)
        assert measured(bench, camera)[0] is DetectResult.SUCCESS
        shown = bench.telemetry(f"Masks{camera + 1}")
        assert {key for key, value in shown.items() if value} == {"XMax5", "YMin5", "YMax5"}


@telecommand("Distortion1", "Distortion2")
def distortion(bench: Bench) -> None:
    lit(bench)
    _, alpha, _ = measured(bench, Camera.SUN)
    assert measured(bench, Camera.NADIR)[0] is DetectResult.SUCCESS
    radius = bench.telemetry("Details2")["Radius"]
    factors: dict[str, int] = {}
    for power, factor in enumerate((0.0, 0.8, 0.0, 0.0, 0.0)):
        mantissa, exponent = split_coefficient(factor)
        factors |= {f"Mantissa{power}": mantissa, f"Exponent{power}": exponent}
    bench.command("Distortion1", **factors)
    # The lens is nearly straight near its axis, with a slope of 1.
    assert measured(bench, Camera.SUN)[1] == pytest.approx(alpha / 0.8, rel=0.01)
    assert measured(bench, Camera.NADIR)[0] is DetectResult.SUCCESS
    assert bench.telemetry("Details2")["Radius"] == radius
    bench.command("Distortion2", **factors)
    measured(bench, Camera.NADIR)
    assert bench.telemetry("Details2")["Radius"] > 1.05 * radius


@telecommand("SetNadirSearch")
def set_nadir_search(_: Bench) -> None:
    bench = Bench(mcu_addressing=True)
    lit(bench)
    detect, alpha, beta = measured(bench, Camera.NADIR)
    lines = bench.telemetry("Details2")["PixelsRead"]
    bench.command("SetNadirSearch", Search=NadirSearch.AROUND_SAMPLES)
    assert bench.telemetry("NadirSearchMode")["Search"] == NadirSearch.AROUND_SAMPLES
    again = measured(bench, Camera.NADIR)
    assert again[0] is detect is DetectResult.SUCCESS
    assert again[1:] == pytest.approx((alpha, beta), abs=0.3)
    assert bench.telemetry("Details2")["PixelsRead"] < lines / 5


def test_a_search_that_the_fpgas_are_not_built_for_is_refused(bench: Bench) -> None:
    assert bench.send("SetNadirSearch", Search=NadirSearch.AROUND_SAMPLES) == 3
    assert bench.send("SetNadirSearch", Search=NadirSearch.LINES) == 0


def test_a_lens_that_only_the_table_finds_out_is_refused_later(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    lit(bench)
    monkeypatch.setattr("cubestack.firmware_model.cubesense.links.node.invertible", lambda *_: True)
    bench.command("Distortion1", **{f"Mantissa{power}": 0 for power in range(5)})
    assert bench.telemetry("TcmdProcessed") == {"LastTcmd": 54, "Processed": 1, "Error": 3}
    assert measured(bench, Camera.SUN)[0] is DetectResult.SUCCESS


# --- download -----------------------------------------------------------------------------------


@telecommand("StartImageDownload", "NextImageFrame")
def image_download(bench: Bench) -> None:
    rng = np.random.default_rng(64)
    for sram in Sram:
        picture = rng.integers(0, 256, (480, 640), np.uint8)
        bench.memories[sram] = picture
        size = ImageSize.SIDE_128
        expected = thumbnail(picture, size).reshape(-1, 128)
        assert bench.send("StartImageDownload", Sram=sram, Size=size) == 0
        assert bench.telemetry("ImageFrameInfo")["FrameNumber"] == EMPTY_FRAME
        bench.run()
        for number in (0, 40, 41, 90, 40):
            if number:
                assert bench.send("NextImageFrame", Frame=number) == 0
                assert bench.telemetry("ImageFrameInfo")["FrameNumber"] == EMPTY_FRAME
                bench.run()
            data = frame(bench)
            assert data == expected[number].tobytes()
            info = {"FrameNumber": number, "Checksum": checksum(data)}
            assert bench.telemetry("ImageFrameInfo") == info


# --- order --------------------------------------------------------------------------------------


def test_telecommands_are_executed_in_order(bench: Bench) -> None:
    for threshold in (1, 2, 3, 4):
        bench.send("DetectionThreshold1", Threshold=threshold)
    assert bench.telemetry("Configuration")["Threshold1"] == 225
    bench.run()
    assert bench.telemetry("Configuration")["Threshold1"] == 4


@pytest.mark.parametrize("more", [False, True])
def test_a_reset_drops_what_waits_and_is_not_processed_before(bench: Bench, more: bool) -> None:
    bench.send("Reset", Target=ResetTarget.MCU)
    seen: list[tuple[int, int]] = []
    bench.on_request = lambda _request: seen.append(
        (len(bench.resets), bench.telemetry("TcmdProcessed")["Processed"])
    )
    if more:
        bench.send("DetectionThreshold1", Threshold=9)
    bench.run()
    assert set(seen) == {(0, 0), (1, 1)}
    assert bench.telemetry("Configuration")["Threshold1"] == 225


def test_a_bench_letter_and_a_telecommand_take_turns(bench: Bench) -> None:
    bench.uart(b"s", Port.BENCH)
    bench.run(until_us=bench.now_us + 5_000)
    begun = len(bench.sent[Port.BENCH])
    assert 0 < begun < 307_200
    assert bench.send("DetectionThreshold1", Threshold=9) == 0
    bench.run(until_us=bench.now_us + 5_000)
    assert begun < len(bench.sent[Port.BENCH]) < 307_200
    assert bench.telemetry("Configuration")["Threshold1"] == 9
