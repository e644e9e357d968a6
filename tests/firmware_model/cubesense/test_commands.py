from collections.abc import Callable

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.commands import SOFTWARE_RESET
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, pins
from cubestack.firmware_model.mcu.requests import SetPin, StrobeRead

from ..registry import registered_in
from .harness import Harness, stored
from .scenery import SUN_BORESIGHT, earth, place, sun, thumbnail

Effect = Callable[[Harness], None]
EFFECTS: dict[str, Effect] = {}

#: Their effects show in a result's values and codes, as the verified vision returns them.
OF_RESULTS = {"DetectionThreshold", "Boresight", "Mask", "Distortion"}
#: Decorator: the function shows what the named telecommands do.
telecommand = registered_in(EFFECTS)


def lit(unit: Harness) -> None:
    """Both cameras see what they look for, at (12, -7) deg."""
    unit.scenes[codes.Camera.SUN] = sun(place(12.0, -7.0, SUN_BORESIGHT), 5.0)
    unit.scenes[codes.Camera.NADIR] = earth(12.0, -7.0)


def result(unit: Harness, camera: codes.Camera) -> dict[str, float]:
    return unit.telemetry(f"Result{camera + 1}")


def measured(unit: Harness, camera: codes.Camera) -> tuple[codes.DetectResult, float, float]:
    unit.command("CaptureAndDetect", Camera=camera, Sram=camera)
    found = result(unit, camera)
    return codes.DetectResult(int(found["Detect"])), found["Alpha"], found["Beta"]


def frame(unit: Harness) -> bytes:
    return bytes(unit.telemetry("ImageFrame")["Frame"])


LENS = INTERFACE.telecommand("Distortion2").reset_values()


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        (message.name, "extended" if message.name[:-1] in OF_RESULTS else DEFAULT_PROFILE)
        for message in INTERFACE.telecommands
    ],
)
def test_every_telecommand_has_its_documented_effect(unit: Harness, name: str) -> None:
    EFFECTS[name](unit)


def test_telecommands_handled_tested_and_declared_are_the_same(unit: Harness) -> None:
    declared = {message.name for message in INTERFACE.telecommands}
    assert unit.program.commands.handled == EFFECTS.keys() == declared


@telecommand("Reset")
def reset(unit: Harness) -> None:
    unit.command("DetectionThreshold1", Threshold=9)
    unit.command("StartImageDownload", Size=codes.ImageSize.SIDE_64)
    unit.uart(b"noise")
    unit.command("Reset", Target=codes.ResetTarget.COMMUNICATION)
    counts = unit.telemetry("CommunicationStatus")
    assert counts == {**dict.fromkeys(counts, 0), "TlmCount": 1}
    assert unit.telemetry("TcmdProcessed") == {"LastTcmd": 0, "Processed": 1, "Error": 0}
    assert unit.telemetry("ImageFrameInfo")["FrameNumber"] == codes.EMPTY_FRAME
    assert unit.send("NextImageFrame") == 3
    assert unit.resets == []

    unit.log.clear()
    unit.command("Reset", Target=codes.ResetTarget.CAMERAS)
    requests = [request for _, request in unit.log]
    for camera in codes.Camera:
        off, on = (requests.index(SetPin(pins.CAMERA_POWER[camera], level)) for level in (0, 1))
        assert off < on
        assert unit.cameras[camera].registers["EXPOSURE"] > 0
    assert unit.telemetry("Configuration")["Threshold1"] == 9

    unit.command("Reset", Target=codes.ResetTarget.MCU)
    assert unit.resets == [SOFTWARE_RESET]
    assert unit.telemetry("Configuration")["Threshold1"] == 225


@telecommand("ClearOverCurrent")
def clear_over_current(unit: Harness) -> None:
    for selection in codes.SramSelection:
        memories = (
            set(codes.Sram) if selection is codes.SramSelection.BOTH else {codes.Sram(selection)}
        )
        unit.latched = set(codes.Sram) - unit.cut()
        unit.run(until_us=unit.now_us + 20_000)
        assert unit.cut() == set(codes.Sram)
        unit.command("ClearOverCurrent", Selection=selection)
        power = unit.telemetry("Power")
        flagged = {sram for sram in codes.Sram if power[f"OverCurrent{sram + 1}"]}
        assert unit.cut() == flagged == set(codes.Sram) - memories


@telecommand("CaptureAndDetect")
def capture_and_detect(unit: Harness) -> None:
    lit(unit)
    for camera in codes.Camera:
        for sram in codes.Sram:
            unit.command("CaptureAndDetect", Camera=camera, Sram=sram)
            found = result(unit, camera)
            assert found["Capture"] == stored(camera, sram)
            assert found["Detect"] == codes.DetectResult.SUCCESS
            assert (found["Alpha"], found["Beta"]) == pytest.approx((12.0, -7.0), abs=0.5)
            np.testing.assert_array_equal(unit.memories[sram], unit.scenes[camera])


@telecommand("CaptureOnly")
def capture_only(unit: Harness) -> None:
    lit(unit)
    for camera in codes.Camera:
        for sram in codes.Sram:
            unit.log.clear()
            unit.command("CaptureOnly", Camera=camera, Sram=sram)
            assert result(unit, camera)["Detect"] == codes.DetectResult.NONE_SCHEDULED
            times = unit.telemetry(f"PhaseTimes{camera + 1}")
            assert (times["Search"], times["Centroid"]) == (0, 0)
            assert not any(isinstance(request, StrobeRead) for _, request in unit.log)
            np.testing.assert_array_equal(unit.memories[sram], unit.scenes[camera])


@telecommand("DetectionThreshold1", "DetectionThreshold2")
def detection_threshold(unit: Harness) -> None:
    lit(unit)
    points = []
    for threshold in (250, 210):
        unit.command("DetectionThreshold1", Threshold=threshold)
        assert measured(unit, codes.Camera.SUN)[0] is codes.DetectResult.SUCCESS
        points.append(unit.telemetry("Details1")["Points"])
    assert points[0] < points[1]
    unit.scenes[codes.Camera.NADIR] = earth(0, 0, level=100)
    assert measured(unit, codes.Camera.NADIR)[0] is codes.DetectResult.SUCCESS
    unit.command("DetectionThreshold2", Threshold=250)
    assert measured(unit, codes.Camera.NADIR)[0] is codes.DetectResult.TOO_FEW_EDGES


@telecommand("AutoAdjust1", "AutoAdjust2")
def auto_adjust(unit: Harness) -> None:
    for camera in codes.Camera:
        before = dict(unit.cameras[camera].registers)
        switched = {"COMMON_A": 0x24, "COMMON_B": 1, "COMMON_I": 0}
        for enabled, expected in ((1, before | switched), (0, before)):
            unit.command(f"AutoAdjust{camera + 1}", Enabled=enabled)
            unit.command("CaptureOnly", Camera=camera)
            assert unit.cameras[camera].registers == expected
            assert unit.telemetry("Configuration")[f"AutoAdjust{camera + 1}"] == enabled


@telecommand("CameraSettings1", "CameraSettings2")
def camera_settings(unit: Harness) -> None:
    expected = {camera: dict(unit.cameras[camera].registers) for camera in codes.Camera}
    for camera, exposure, gain in zip(codes.Camera, (0x1F1F, 200), (0x1F, 200), strict=True):
        sent = {"Exposure": exposure, "Gain": gain, "BlueGain": 0x81, "RedGain": 0x7E}
        unit.command(f"CameraSettings{camera + 1}", **sent)
        unit.command("CaptureOnly", Camera=camera)
        limited = {"EXPOSURE": min(exposure, 255), "GAIN": min(gain, 63)}
        expected[camera] |= {**limited, "BLUE_GAIN": 0x81, "RED_GAIN": 0x7E}
        assert {camera: unit.cameras[camera].registers for camera in codes.Camera} == expected
        shown = unit.telemetry("Configuration")
        assert {name: shown[f"{name}{camera + 1}"] for name in sent} == sent


@telecommand("Boresight1", "Boresight2")
def boresight(unit: Harness) -> None:
    lit(unit)
    for camera in codes.Camera:
        reset_value = INTERFACE.telecommand(f"Boresight{camera + 1}").reset_values()
        x, y = float(reset_value["X"]), float(reset_value["Y"])
        before = measured(unit, camera)
        unit.command(f"Boresight{camera + 1}", X=x - 2.9, Y=y + 5.8)
        after = measured(unit, camera)
        moved = (after[1] - before[1], after[2] - before[2])
        # Edges far from the axis move by more than the angle there.
        tolerance = 0.1 if camera is codes.Camera.SUN else 0.7
        assert moved == pytest.approx((1.0, -2.0), abs=tolerance)


@telecommand("Mask1", "Mask2")
def mask(unit: Harness) -> None:
    lit(unit)
    missed = codes.DetectResult.SUN_NOT_FOUND, codes.DetectResult.TOO_FEW_EDGES
    for camera in codes.Camera:
        name = f"Mask{camera + 1}"
        unit.command(name, Area=3, XMin=0, XMax=639, YMin=0, YMax=479)
        assert measured(unit, camera)[0] is missed[camera]
        unit.command(name, Area=3, XMin=0, XMax=0, YMin=0, YMax=0)
        unit.command(name, Area=5, XMin=0, XMax=1, YMin=2, YMax=3)
        assert measured(unit, camera)[0] is codes.DetectResult.SUCCESS
        shown = unit.telemetry(f"Masks{camera + 1}")
        assert {key for key, value in shown.items() if value} == {"XMax5", "YMin5", "YMax5"}


@telecommand("Distortion1", "Distortion2")
def distortion(unit: Harness) -> None:
    lit(unit)
    _, alpha, _ = measured(unit, codes.Camera.SUN)
    assert measured(unit, codes.Camera.NADIR)[0] is codes.DetectResult.SUCCESS
    radius = unit.telemetry("Details2")["Radius"]
    factors: dict[str, int] = {}
    for power, factor in enumerate((0.0, 0.8, 0.0, 0.0, 0.0)):
        mantissa, exponent = codes.split_coefficient(factor)
        factors |= {f"Mantissa{power}": mantissa, f"Exponent{power}": exponent}
    unit.command("Distortion1", **factors)
    # The lens is nearly straight near its axis, with a slope of 1.
    assert measured(unit, codes.Camera.SUN)[1] == pytest.approx(alpha / 0.8, rel=0.01)
    assert measured(unit, codes.Camera.NADIR)[0] is codes.DetectResult.SUCCESS
    assert unit.telemetry("Details2")["Radius"] == radius
    unit.command("Distortion2", **factors)
    measured(unit, codes.Camera.NADIR)
    assert unit.telemetry("Details2")["Radius"] > 1.05 * radius


@telecommand("SetNadirSearch")
def set_nadir_search(_: Harness) -> None:
    unit = Harness(mcu_addressing=True)
    lit(unit)
    detect, alpha, beta = measured(unit, codes.Camera.NADIR)
    lines = unit.telemetry("Details2")["PixelsRead"]
    unit.command("SetNadirSearch", Search=codes.NadirSearch.AROUND_SAMPLES)
    assert unit.telemetry("NadirSearchMode")["Search"] == codes.NadirSearch.AROUND_SAMPLES
    again = measured(unit, codes.Camera.NADIR)
    assert again[0] is detect is codes.DetectResult.SUCCESS
    assert again[1:] == pytest.approx((alpha, beta), abs=0.3)
    assert unit.telemetry("Details2")["PixelsRead"] < lines / 5


@telecommand("SetProfile", "SetSwitch")
def set_switches(_: Harness) -> None:
    """Before and after the first measurement; other coefficients need a new table."""
    seen = []
    for coefficients in (False, True):
        for early in (False, True):
            unit = Harness()
            lit(unit)
            unit.command("CaptureOnly", Camera=codes.Camera.NADIR, Sram=0)  # sets the camera up
            unit.command("SetProfile", Profile="extended")
            if coefficients:
                unit.command("Distortion2", **{**LENS, "Mantissa1": 9940})
            if early:
                measured(unit, codes.Camera.NADIR)
            unit.command("SetProfile", Profile="published")
            unit.command("SetSwitch", Switch="EDGES", Value="SUB_PIXEL")
            before_us = unit.now_us
            measured(unit, codes.Camera.NADIR)
            frames = [unit.telemetry(f"{name}2") for name in ("Result", "Details")]
            seen.append((round((unit.now_us - before_us) / 1000), frames))
    assert seen[0] == seen[1] != seen[2] == seen[3]
    assert seen[2][0] > seen[0][0] + 400


def test_telecommand_refuses_a_search_unsupported_by_the_fpgas(unit: Harness) -> None:
    assert unit.send("SetNadirSearch", Search=codes.NadirSearch.AROUND_SAMPLES) == 3
    assert unit.send("SetNadirSearch", Search=codes.NadirSearch.LINES) == 0


def test_lens_without_an_inverse_table_is_refused_and_the_old_one_kept(
    unit: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    lit(unit)
    monkeypatch.setattr("cubestack.firmware_model.cubesense.links.node.invertible", lambda *_: True)
    unit.command("Distortion1", **{f"Mantissa{power}": 0 for power in range(5)})
    assert unit.telemetry("TcmdProcessed") == {"LastTcmd": 54, "Processed": 1, "Error": 3}
    assert measured(unit, codes.Camera.SUN)[0] is codes.DetectResult.SUCCESS


@telecommand("StartImageDownload", "NextImageFrame")
def image_download(unit: Harness) -> None:
    rng = np.random.default_rng(64)
    for sram in codes.Sram:
        picture = rng.integers(0, 256, (480, 640), np.uint8)
        unit.memories[sram] = picture
        size = codes.ImageSize.SIDE_128
        expected = thumbnail(picture, size).reshape(-1, 128)
        assert unit.send("StartImageDownload", Sram=sram, Size=size) == 0
        assert unit.telemetry("ImageFrameInfo")["FrameNumber"] == codes.EMPTY_FRAME
        unit.run()
        for number in (0, 40, 41, 90, 40):
            if number:
                assert unit.send("NextImageFrame", Frame=number) == 0
                assert unit.telemetry("ImageFrameInfo")["FrameNumber"] == codes.EMPTY_FRAME
                unit.run()
            data = frame(unit)
            assert data == expected[number].tobytes()
            info = {"FrameNumber": number, "Checksum": codes.checksum(data)}
            assert unit.telemetry("ImageFrameInfo") == info


def test_telecommands_are_executed_in_order(unit: Harness) -> None:
    for threshold in (1, 2, 3, 4):
        unit.send("DetectionThreshold1", Threshold=threshold)
    assert unit.telemetry("Configuration")["Threshold1"] == 225
    unit.run()
    assert unit.telemetry("Configuration")["Threshold1"] == 4


@pytest.mark.parametrize("more", [False, True])
def test_reset_drops_waiting_telecommands_and_is_counted_afterwards(
    unit: Harness, more: bool
) -> None:
    unit.send("Reset", Target=codes.ResetTarget.MCU)
    seen: list[tuple[int, int]] = []
    unit.on_request = lambda _request: seen.append(
        (len(unit.resets), unit.telemetry("TcmdProcessed")["Processed"])
    )
    if more:
        unit.send("DetectionThreshold1", Threshold=9)
    unit.run()
    assert set(seen) == {(0, 0), (1, 1)}
    assert unit.telemetry("Configuration")["Threshold1"] == 225
