"""Measurements: results, every result code, times, settings, and what is left whole."""

from itertools import groupby, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.measurement import (
    READ_OUT_TICKS,
    microseconds,
    read_ticks,
    ticks_of,
    ticks_since,
)
from cubestack.firmware_model.cubesense.state import distortion_of
from cubestack.firmware_model.cubesense.vision.distortion import Projection, RadiusTable, fine_table
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig, find_nadir
from cubestack.firmware_model.cubesense.vision.sun_centroid import SunConfig, find_sun
from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    EDGE_UNIT,
    Camera,
    CaptureResult,
    DetectResult,
    NadirSearch,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, SetPin, StrobeRead
from tests.tiers import quick

from .harness import FRAME_US, READ_OUT_US, Harness, stored
from .scenery import SUN_BORESIGHT, chequered, earth, edges_in, error_deg, place, sun, window

TICK_US = 51.2
#: Edges that lie on no circle.
RECTANGLE = np.pad(np.full((140, 120), 200, np.uint8), ((200, 140), (300, 220)), constant_values=34)


def measure(unit: Harness, camera: Camera, sram: Sram | None = None) -> dict[str, Any]:
    unit.command("CaptureAndDetect", Camera=camera, Sram=camera if sram is None else sram)
    return result(unit, camera)


def result(unit: Harness, camera: Camera) -> dict[str, Any]:
    frames = (unit.telemetry(f"{n}{camera + 1}") for n in ("Result", "Details", "PhaseTimes"))
    return {name: value for frame in frames for name, value in frame.items()}


def reset_table(camera: Camera, projection: Projection) -> RadiusTable:
    factors = distortion_of(INTERFACE.telecommand(f"Distortion{camera + 1}").reset_values())
    return fine_table(Meter(PIC18F45K20), projection, factors)


def outcome(values: dict[str, Any]) -> tuple[CaptureResult, DetectResult]:
    return CaptureResult(values["Capture"]), DetectResult(values["Detect"])


def sun_at(alpha: float, beta: float) -> NDArray[np.uint8]:
    return sun(place(alpha, beta, SUN_BORESIGHT), 6)


def edges_of(unit: Harness) -> set[tuple[float, float]]:
    """Edges of the latest nadir picture, px, as telemetry hands them out."""
    values = {**unit.telemetry("NadirEdges1"), **unit.telemetry("NadirEdges2")}
    return {(values[f"X{n}"], values[f"Y{n}"]) for n in range(1, values["Count"] + 1)}


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("sram", Sram)
@pytest.mark.parametrize("truth", [(0.0, 0.0), (25.0, -40.0), (-60.0, 35.0)])
def test_sun_is_measured_from_either_memory(
    unit: Harness, sram: Sram, truth: tuple[float, float]
) -> None:
    unit.scenes[Camera.SUN] = picture = sun_at(*truth)
    measured = measure(unit, Camera.SUN, sram)
    assert outcome(measured) == (stored(Camera.SUN, sram), DetectResult.SUCCESS)
    assert error_deg((measured["Alpha"], measured["Beta"]), truth) < 0.1
    data, table = window(picture), reset_table(Camera.SUN, Projection.EQUIDISTANT)
    expected = find_sun(data, SunConfig(table), Meter(PIC18F45K20))
    assert (measured["X"], measured["Y"]) == (expected.x / 100, expected.y / 100)
    assert (measured["FirstX"], measured["FirstY"]) == tuple(data[:4].view("<u2"))
    assert (measured["Points"], measured["Sram"]) == (expected.pixels, sram)
    assert (measured["Radius"], measured["PixelsRead"]) == (0, 225)


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("sram", Sram)
@pytest.mark.parametrize("truth", [(0.0, 0.0), (15.0, -25.0), (-40.0, 30.0)])
def test_nadir_is_measured_from_either_memory(
    unit: Harness, sram: Sram, truth: tuple[float, float]
) -> None:
    unit.scenes[Camera.NADIR] = picture = earth(*truth)
    measured = measure(unit, Camera.NADIR, sram)
    assert outcome(measured) == (stored(Camera.NADIR, sram), DetectResult.SUCCESS)
    assert error_deg((measured["Alpha"], measured["Beta"]), truth) < 0.2
    meter, table = Meter(PIC18F45K20), reset_table(Camera.NADIR, Projection.STEREOGRAPHIC)
    edges = edges_in(picture, meter, EdgeConfig(sharp=True))
    expected = find_nadir(edges, NadirConfig(table), meter)
    assert (measured["X"], measured["Y"]) == (expected.x / 100, expected.y / 100)
    assert (measured["Points"], measured["Sram"]) == (expected.edges, sram)
    assert measured["Radius"] == pytest.approx(63.5 * 2.9, abs=0.5)
    assert (measured["FirstX"], measured["FirstY"], measured["PixelsRead"]) == (0, 0, 9920)
    assert edges_of(unit) == {(x / EDGE_UNIT, y / EDGE_UNIT) for x, y in edges.points}


@pytest.mark.parametrize(("profile", "sram"), quick(product(PROFILES, Sram), 1))
def test_dynamic_threshold_is_the_mean_of_all_pixels(profile: str, sram: Sram) -> None:
    unit = Harness(CubeSenseSwitches.of(profile, "threshold=dynamic"))
    picture = (34 + (earth(5, -20) - 34.0) / 4).astype(np.uint8)  # all below the fixed one
    unit.scenes[Camera.NADIR] = picture
    dynamic = measure(unit, Camera.NADIR, sram)
    mean = int(picture.mean())
    fixed = Harness(CubeSenseSwitches.of(profile))
    fixed.scenes[Camera.NADIR] = picture
    fixed.command("DetectionThreshold2", Threshold=mean)
    expected = measure(fixed, Camera.NADIR, sram)
    assert dynamic["Detect"] == DetectResult.SUCCESS
    for name in ("X", "Y", "Radius", "Points"):
        assert dynamic[name] == expected[name]


def test_memory_cut_off_while_the_mean_is_taken_ends_the_measurement() -> None:
    unit = Harness(CubeSenseSwitches.of("published", "threshold=dynamic"))
    unit.scenes[Camera.NADIR] = earth(0, 0)
    unit.latch_on(StrobeRead, Sram.SRAM2)
    measured = measure(unit, Camera.NADIR)
    assert outcome(measured) == (CaptureResult.SRAM_OVER_CURRENT, DetectResult.NONE_SCHEDULED)


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize(
    ("picture", "detect"),
    [
        (np.full((480, 640), 34, np.uint8), DetectResult.TOO_FEW_EDGES),
        (np.full((480, 640), 255, np.uint8), DetectResult.TOO_FEW_EDGES),
        (earth(180, 0), DetectResult.TOO_FEW_EDGES),
        (chequered(), DetectResult.TOO_MANY_EDGES),
        (RECTANGLE, DetectResult.BAD_FIT),
    ],
    ids=["dark", "bright", "behind", "chequered", "rectangle"],
)
def test_images_without_earth_report_a_detection_failure(
    unit: Harness, picture: NDArray[np.uint8], detect: DetectResult
) -> None:
    unit.scenes[Camera.NADIR] = earth(1, 2)
    measure(unit, Camera.NADIR)
    unit.scenes[Camera.NADIR] = picture
    measured = measure(unit, Camera.NADIR)
    assert outcome(measured) == (CaptureResult.STORED_OWN_SRAM, detect)
    assert (measured["Alpha"], measured["Beta"]) == (0, 0)


def test_sun_camera_image_without_sun_reports_sun_not_found(unit: Harness) -> None:
    measured = measure(unit, Camera.SUN)
    assert outcome(measured) == (CaptureResult.STORED_OWN_SRAM, DetectResult.SUN_NOT_FOUND)
    assert (measured["FirstX"], measured["FirstY"]) == (0x3FF, 0x1FF)


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("sram", Sram)
def test_dead_camera_times_out_and_schedules_no_detection(
    unit: Harness, camera: Camera, sram: Sram
) -> None:
    unit.scenes[camera] = None
    unit.cameras[camera].answers = False
    measured = measure(unit, camera, sram)
    assert outcome(measured) == (CaptureResult.CAMERA_TIMEOUT, DetectResult.NONE_SCHEDULED)
    assert 2 * FRAME_US < measured["Total"] < 75_000
    assert measured["Wait"] == measured["Total"]


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("sram", Sram)
def test_failed_camera_is_set_up_again_by_the_next_measurement(
    unit: Harness, camera: Camera, sram: Sram
) -> None:
    registers = dict(unit.cameras[camera].registers)
    other = dict(unit.cameras[Camera(1 - camera)].registers)
    scene, unit.scenes[camera] = unit.scenes[camera], None
    unit.cameras[camera].power_up()  # after a dip of its supply
    unit.cameras[camera].writes.clear()
    measure(unit, camera, sram)
    assert not unit.cameras[camera].writes
    unit.scenes[camera] = scene
    measure(unit, camera, sram)
    assert unit.cameras[camera].registers == registers
    assert unit.cameras[Camera(1 - camera)].registers == other


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("sram", Sram)
def test_latch_up_during_the_store_is_reported_as_over_current(
    unit: Harness, camera: Camera, sram: Sram
) -> None:
    unit.latch_on(SetPin(("SUNEN", "NADEN")[camera], 0), sram)
    for _ in range(2):  # the second time it is off
        measured = measure(unit, camera, sram)
        assert outcome(measured) == (CaptureResult.SRAM_OVER_CURRENT, DetectResult.NONE_SCHEDULED)
        assert unit.cut() == {sram}


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("sram", Sram)
@pytest.mark.parametrize("search", [NadirSearch.LINES, NadirSearch.AROUND_SAMPLES])
def test_latch_up_during_the_search_is_reported_as_over_current(
    camera: Camera, sram: Sram, search: NadirSearch
) -> None:
    unit = Harness(mcu_addressing=True)
    unit.command("SetNadirSearch", Search=search)
    unit.scenes[Camera.SUN], unit.scenes[Camera.NADIR] = sun_at(3, 4), earth(5, 6)
    unit.latch_on(StrobeRead, sram)
    measured = measure(unit, camera, sram)
    assert outcome(measured) == (CaptureResult.SRAM_OVER_CURRENT, DetectResult.NONE_SCHEDULED)
    unit.on_request = lambda _request: None
    unit.command("ClearOverCurrent", Selection=sram)
    assert outcome(measure(unit, camera, sram))[1] is DetectResult.SUCCESS


def test_results_are_pending_until_available(unit: Harness) -> None:
    unit.scenes[Camera.NADIR] = earth(5, 6)
    seen: list[tuple[CaptureResult, DetectResult]] = []
    assert unit.send("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM2) == 0
    unit.on_request = lambda _request: seen.append(outcome(unit.telemetry("Result2")))
    unit.run()
    assert [codes for codes, _ in groupby(seen)] == [
        (CaptureResult.PENDING, DetectResult.PENDING),
        (CaptureResult.STORED_OWN_SRAM, DetectResult.PENDING),
        (CaptureResult.STORED_OWN_SRAM, DetectResult.SUCCESS),
    ]


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("other_is_dead", [False, True])
def test_measurement_uses_the_other_memory_when_one_failed(
    unit: Harness, camera: Camera, other_is_dead: bool
) -> None:
    unit.scenes[Camera.SUN], unit.scenes[Camera.NADIR] = sun_at(-20, 10), earth(-20, 10)
    unit.latched.add(Sram(camera))
    unit.run(until_us=unit.now_us + 10_000)
    assert unit.cut() == {Sram(camera)}
    if other_is_dead:
        unit.scenes[Camera(1 - camera)] = None
    measured = measure(unit, camera, Sram(1 - camera))
    assert outcome(measured) == (CaptureResult.STORED_OTHER_SRAM, DetectResult.SUCCESS)
    assert error_deg((measured["Alpha"], measured["Beta"]), (-20, 10)) < 0.1


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("wait_us", [3_000, 17_500, 36_000])
def test_phase_times_match_the_timer(unit: Harness, camera: Camera, wait_us: int) -> None:
    unit.scenes[Camera.SUN], unit.scenes[Camera.NADIR] = sun_at(3, 4), earth(5, 6)
    unit.wait_us = wait_us
    unit.log.clear()
    measured = measure(unit, camera)
    # From the command to the FPGAs to the end of the job, nothing else takes long.
    enabled_us = next(us for us, r in unit.log if isinstance(r, SetPin) and r.pin == "SHIFT")
    assert measured["Total"] == pytest.approx(unit.now_us - enabled_us, abs=300)
    assert measured["Wait"] == pytest.approx(wait_us, abs=200)
    assert measured["Store"] == microseconds(READ_OUT_TICKS)
    assert measured["Store"] == pytest.approx(READ_OUT_US, abs=TICK_US)
    phases = [measured[name] for name in ("Wait", "Store", "Search", "Centroid")]
    assert measured["Total"] == pytest.approx(sum(phases), abs=4)
    for us in (*phases, measured["Total"]):
        assert us == int(round(us / TICK_US) * TICK_US)


@pytest.mark.parametrize("profile", ["extended"])
def test_extended_sun_and_nadir_times_are_87_and_312_ms(unit: Harness) -> None:
    """Section 7.4 measures 70.4 ms and 245.0 ms, 48 ms of it imaging.

    The robust fit takes a second fit of all edges, its uncertainty, and a look around each edge.
    """
    unit.scenes[Camera.SUN] = sun(place(0, 0, SUN_BORESIGHT), 7)
    unit.scenes[Camera.NADIR] = earth(5, -5)
    totals = {}
    for camera in Camera:
        measured = measure(unit, camera)
        assert measured["Wait"] + measured["Store"] == pytest.approx(48_000, abs=200)
        totals[camera] = measured["Total"] / 1000
    assert totals[Camera.SUN] == pytest.approx(87.4, abs=1.5)
    assert totals[Camera.NADIR] == pytest.approx(312, abs=5)


def test_measurement_time_excludes_the_exposure_settling_wait(unit: Harness) -> None:
    unit.scenes[Camera.SUN] = sun_at(3, 4)
    before = measure(unit, Camera.SUN)["Total"]
    unit.command("CameraSettings1", Exposure=5)
    start_us = unit.now_us
    after = measure(unit, Camera.SUN)["Total"]
    assert after == pytest.approx(before, abs=60)
    assert unit.now_us - start_us > after + 36_000


@pytest.mark.parametrize("profile", ["extended"])
def test_detection_threshold_telecommands_affect_measurements(unit: Harness) -> None:
    unit.scenes[Camera.SUN] = sun_at(3, 4)
    unit.scenes[Camera.NADIR] = earth(5, 6, level=80)
    unit.command("DetectionThreshold2", Threshold=200)  # a third of it, from dark on, counts
    assert measure(unit, Camera.NADIR)["Detect"] == DetectResult.TOO_FEW_EDGES
    before = measure(unit, Camera.SUN)["Points"]
    unit.command("DetectionThreshold1", Threshold=120)
    assert measure(unit, Camera.SUN)["Points"] > before


@pytest.mark.parametrize("profile", ["extended"])
def test_boresight_telecommand_shifts_the_sun_angles(unit: Harness) -> None:
    unit.scenes[Camera.SUN] = sun(np.array([369.0, 250.0]), 6)
    unit.command("Boresight1", X=359.5, Y=253.25)
    measured = measure(unit, Camera.SUN)
    table = reset_table(Camera.SUN, Projection.EQUIDISTANT)
    config = SunConfig(table, boresight=(359.5, 253.25))
    expected = find_sun(window(unit.memories[Sram.SRAM1]), config, Meter(PIC18F45K20))
    assert (measured["X"], measured["Y"]) == (expected.x / 100, expected.y / 100)
    assert measured["X"] == pytest.approx(9.5, abs=0.3)


def test_mask_hides_the_sun_and_removes_masked_limb_edges(unit: Harness) -> None:
    unit.scenes[Camera.SUN], unit.scenes[Camera.NADIR] = sun_at(3, 4), earth(5, 6)
    x, y = place(3, 4, SUN_BORESIGHT).astype(int)
    unit.command("Mask1", Area=5, XMin=x - 20, XMax=x + 20, YMin=y - 20, YMax=y + 20)
    assert measure(unit, Camera.SUN)["Detect"] == DetectResult.SUN_NOT_FOUND
    measure(unit, Camera.NADIR)
    before = edges_of(unit)
    unit.command("Mask2", Area=1, XMin=0, XMax=300, YMin=0, YMax=479)
    measured = measure(unit, Camera.NADIR)
    left = {edge for edge in before if edge[0] > 300}
    assert edges_of(unit) == left < before
    assert measured["Detect"] == DetectResult.SUCCESS


@pytest.mark.parametrize("camera", Camera)
def test_new_distortion_coefficients_rebuild_the_table_once(unit: Harness, camera: Camera) -> None:
    unit.scenes[Camera.SUN], unit.scenes[Camera.NADIR] = sun_at(40, 20), earth(20, 30)
    name = f"Distortion{camera + 1}"
    before = measure(unit, camera)
    values = dict(INTERFACE.telecommand(name).reset_values())
    values |= {"Mantissa0": 0, "Mantissa1": 9900, "Exponent1": 4}
    durations, waits, results = [], [], []
    for sent in (values, None, INTERFACE.telecommand(name).reset_values()):
        if sent is not None:
            unit.command(name, **sent)
        start_us, start_cycles = unit.now_us, unit.meter.total
        results.append(measure(unit, camera))
        durations.append(unit.now_us - start_us)
        busy_us = (unit.meter.total - start_cycles) / unit.meter.table.clock_hz * 1e6
        waits.append(durations[-1] - busy_us)
    changed, same, reset = results
    assert durations[0] - durations[1] > 300_000  # Newton's method for 227 radii, on this part
    # 227 bytes: 4 blocks of 64 erased, 8 of 32 written, 2 ms each; a camera's frame waits less.
    assert waits[0] - waits[1] == pytest.approx(12 * 2_000, abs=4_000)
    assert durations[2] == pytest.approx(durations[1], rel=0.2)  # the constant table
    assert changed["X"] > before["X"] * 1.004
    for key in ("X", "Y", "Alpha", "Beta"):
        assert changed[key] == same[key]
        assert reset[key] == before[key]


@pytest.mark.parametrize(
    ("search", "most"),
    [(NadirSearch.AROUND_SAMPLES, 250), (NadirSearch.AROUND_SAMPLES_STEPPING, 1200)],
)
def test_search_around_samples_finds_the_same_edges_as_search_by_lines(
    search: NadirSearch, most: int
) -> None:
    unit = Harness(mcu_addressing=True)
    unit.scenes[Camera.NADIR] = earth(-15, 20)
    lines = measure(unit, Camera.NADIR)
    all_edges = edges_of(unit)
    unit.command("SetNadirSearch", Search=search)
    samples = measure(unit, Camera.NADIR)
    assert edges_of(unit) == all_edges
    assert (samples["X"], samples["Y"]) == pytest.approx((lines["X"], lines["Y"]), abs=0.02)
    assert samples["PixelsRead"] < most < 9920 == lines["PixelsRead"]
    assert samples["Search"] < lines["Search"] * (0.4 if most < 1000 else 0.7)
    linked = measure(unit, Camera.NADIR, Sram.SRAM1)  # no addresses over the link
    assert linked["PixelsRead"] == 9920
    assert (linked["X"], linked["Y"]) == (lines["X"], lines["Y"])


def answered(routine: Routine[int], now_us: int) -> int:
    assert next(routine) == ReadTimer()
    with pytest.raises(StopIteration) as end:
        routine.send(now_us)
    return int(end.value.value)


@given(st.integers(0, 10**12), st.integers(0, 3_350_000))
def test_duration_is_right_to_one_tick_across_timer_overflow(start: int, us: int) -> None:
    started = answered(read_ticks(), start)
    assert 0 <= started < 65536
    measured = microseconds(answered(ticks_since(started), start + us))
    assert abs(measured - us) <= 52
    assert -measured * 5 % 256 < 5  # whole ticks, rounded down to 1 us


def test_timer_tick_is_51_2_us() -> None:
    assert (microseconds(1000), ticks_of(51_200), ticks_of(51_199)) == (51_200, 1000, 999)
