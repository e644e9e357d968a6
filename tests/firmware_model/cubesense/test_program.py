"""The main loop: start, jobs in their order, resets, and the watch over the memories.

A latch-up is found by looking, cut at once, and kept off until the host clears it.
"""

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.jobs import Background, JobQueue, Measure
from cubestack.firmware_model.cubesense.memory import CAPACITY, Memory, budget, report, used
from cubestack.firmware_model.cubesense.program import DRAIN_US
from cubestack.firmware_model.cubesense.supply import OFF_TIME_US, OVER_CURRENT_MA, SAMPLE_US
from cubestack.firmware_model.cubesense.vision.edges import MAX_EDGES, EdgeConfig, NadirLines
from cubestack.firmware_model.interface.codec.switches import PROFILES, Profile
from cubestack.firmware_model.interface.cubesense import codes, pins
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.mcu.requests import Pay, Request, Reset, Routine, SetPin, Sleep
from cubestack.firmware_model.node.commands import QUEUE_DEPTH

from .harness import LOST, Harness
from .scenery import chequered, earth


def test_memories_are_powered_before_cameras_within_10_ms(unit: Harness) -> None:
    switched = [r.pin for _, r in unit.log if isinstance(r, SetPin) and "POWER" in r.pin]
    assert switched == [*pins.SRAM_POWER.values(), *pins.CAMERA_POWER.values()]
    assert unit.now_us - Harness.boot_us < 10_000
    assert unit.program.idle


def test_nothing_starts_without_a_command(unit: Harness) -> None:
    unit.log.clear()
    unit.run(until_us=unit.now_us + 1_000_000)
    requests = [request for _, request in unit.log]
    assert all(isinstance(request, Sleep) for request in requests)
    assert 1_000_000 / SAMPLE_US * 0.9 < unit.meter.counts["adc_conversion"] / 2 < 220


def test_queued_captures_run_in_order(unit: Harness) -> None:
    unit.scenes[codes.Camera.NADIR] = earth(5, 5)
    for camera, sram in ((0, 1), (1, 0), (1, 1), (0, 0)):
        assert unit.send("CaptureAndDetect", Camera=camera, Sram=sram) == 0
    unit.log.clear()
    unit.run()
    levels, stores = {"SHIFT": 0, "EDGE": 0, "RNW": 0}, []
    for request in (r for _, r in unit.log if isinstance(r, SetPin)):
        if request.pin in levels:
            levels[request.pin] = request.level
        elif request in (SetPin("SUNEN", 0), SetPin("NADEN", 0)) and not levels["EDGE"]:
            stores.append((levels["SHIFT"], levels["RNW"], request.pin))
    linked_from_sun = [(1, 0, "SUNEN"), (1, 0, "NADEN")]
    linked_from_nadir = [(1, 1, "SUNEN"), (1, 1, "NADEN")]
    assert stores == [*linked_from_sun, *linked_from_nadir, (0, 0, "NADEN"), (0, 0, "SUNEN")]


def test_program_reset_restores_defaults_and_power_cycles_memories(unit: Harness) -> None:
    unit.scenes[codes.Camera.NADIR] = earth(5, 5)
    unit.command("DetectionThreshold2", Threshold=99)
    unit.command("CaptureAndDetect", Camera=codes.Camera.NADIR, Sram=codes.Sram.SRAM2)
    unit.latched.add(codes.Sram.SRAM1)
    unit.run(until_us=unit.now_us + 2 * SAMPLE_US)
    assert unit.cut() == {codes.Sram.SRAM1}
    unit.command("Reset", Target=codes.ResetTarget.MCU)
    assert unit.resets == [1]
    # Both codes are START_UP.
    assert unit.telemetry("Result2") == {"Alpha": 0, "Beta": 0, "Capture": 0, "Detect": 0}
    assert unit.telemetry("Configuration")["Threshold2"] == 70
    assert unit.cut() == set()
    assert (unit.memories[codes.Sram.SRAM2] == LOST).all()  # its switch opened
    assert unit.program.cameras.acknowledged(codes.Camera.NADIR)


@pytest.mark.parametrize("stuck", [False, True])
def test_reset_waits_a_limited_time_for_the_acknowledge_to_be_sent(
    unit: Harness, stuck: bool
) -> None:
    reset_us: list[int] = []
    start_us = unit.now_us
    unit.backlog = 5

    def send(request: Request) -> None:
        if not stuck and unit.now_us > start_us + 4_000:
            unit.backlog = 0
        if isinstance(request, Reset):
            reset_us.append(unit.now_us - start_us)

    unit.on_request = send
    unit.i2c_write(bytes([0, codes.ResetTarget.MCU]))
    unit.run()
    (waited_us,) = reset_us
    assert waited_us == pytest.approx(DRAIN_US if stuck else 4_500, abs=2_000)


def test_measurement_repeats_identically_after_a_reset(unit: Harness) -> None:
    unit.scenes[codes.Camera.NADIR] = earth(-8, 3)
    results = []
    for _ in range(2):
        unit.command("Reset", Target=codes.ResetTarget.MCU)
        unit.command("CaptureAndDetect", Camera=codes.Camera.NADIR, Sram=codes.Sram.SRAM1)
        results.append((unit.telemetry("Result2"), unit.telemetry("Details2")))
    assert results[0] == results[1]
    assert np.array_equal(unit.memories[codes.Sram.SRAM1], unit.scenes[codes.Camera.NADIR])


def over_current(unit: Harness) -> set[codes.Sram]:
    power = unit.telemetry("Power")
    return {sram for sram in codes.Sram if power[f"OverCurrent{sram + 1}"]}


@pytest.mark.parametrize("sram", codes.Sram)
def test_idle_latch_up_is_cut_within_one_sample(unit: Harness, sram: codes.Sram) -> None:
    unit.log.clear()
    unit.latched.add(sram)
    start_us = unit.now_us
    unit.run(until_us=start_us + 2 * SAMPLE_US)
    (cut_us,) = (us for us, request in unit.log if request == SetPin(pins.SRAM_POWER[sram], 0))
    assert cut_us - start_us <= SAMPLE_US + 200
    assert unit.cut() == over_current(unit) == {sram}


@pytest.mark.parametrize("target", [codes.ResetTarget.CAMERAS, codes.ResetTarget.MCU])
def test_memories_are_monitored_in_every_wait(unit: Harness, target: codes.ResetTarget) -> None:
    """A reset of the cameras waits for 100 ms; one of the program, for the UART."""
    unit.backlog = 200
    latched_us: list[int] = []

    def latch(request: Request) -> None:
        if isinstance(request, Sleep) and not request.wakeable and not latched_us:
            latched_us.append(unit.now_us)
            unit.latched.add(codes.Sram.SRAM1)

    unit.log.clear()
    unit.i2c_write(bytes([0, target]))
    unit.on_request = latch
    unit.run()
    cut_us = next(us for us, request in unit.log if request == SetPin("SRAM1_POWER", 0))
    assert cut_us - latched_us[0] <= SAMPLE_US + 200


@pytest.mark.parametrize("cleared_after_us", [20_000, 500_000])
def test_cleared_memory_stays_off_for_the_minimum_time(
    unit: Harness, cleared_after_us: int
) -> None:
    unit.log.clear()
    unit.latched.add(codes.Sram.SRAM2)
    unit.run(until_us=unit.now_us + cleared_after_us)
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.SRAM2)
    (off_us, _), (on_us, last) = ((us, r) for us, r in unit.log if isinstance(r, SetPin))
    assert last == SetPin("SRAM2_POWER", 1)
    assert on_us - off_us == pytest.approx(max(OFF_TIME_US, cleared_after_us), abs=SAMPLE_US + 1000)
    assert on_us - off_us >= OFF_TIME_US


def test_each_memory_stays_off_for_its_own_minimum_time(unit: Harness) -> None:
    unit.log.clear()
    for sram in codes.Sram:
        unit.latched.add(sram)
        unit.run(until_us=unit.now_us + OFF_TIME_US // 2)
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.BOTH)
    for sram in codes.Sram:
        pin = pins.SRAM_POWER[sram]
        off_us, on_us = (us for us, r in unit.log if isinstance(r, SetPin) and r.pin == pin)
        assert on_us - off_us >= OFF_TIME_US


def test_persistent_latch_up_is_cut_again_after_clearing(unit: Harness) -> None:
    unit.latched.add(codes.Sram.SRAM1)
    unit.latch_on(SetPin(pins.SRAM_POWER[codes.Sram.SRAM1], 1), codes.Sram.SRAM1)
    unit.run(until_us=unit.now_us + 10_000)
    unit.log.clear()
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.SRAM1)
    unit.run(until_us=unit.now_us + 10_000)
    switched = [request for _, request in unit.log if isinstance(request, SetPin)]
    assert switched == [SetPin("SRAM1_POWER", 1), SetPin("SRAM1_POWER", 0)]
    assert over_current(unit) == {codes.Sram.SRAM1}


def test_clear_over_current_does_not_touch_a_working_memory(unit: Harness) -> None:
    unit.command("CaptureOnly", Camera=codes.Camera.SUN, Sram=codes.Sram.SRAM1)
    kept = unit.memories[codes.Sram.SRAM1].copy()
    unit.log.clear()
    start_us = unit.now_us
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.BOTH)
    assert (unit.memories[codes.Sram.SRAM1] == kept).all()
    assert not any(isinstance(request, SetPin) for _, request in unit.log)
    assert unit.now_us - start_us < SAMPLE_US + 1_000


@pytest.mark.parametrize(("ma", "cut"), [(OVER_CURRENT_MA - 1, False), (OVER_CURRENT_MA + 1, True)])
def test_memory_is_cut_off_above_the_over_current_limit(
    unit: Harness, ma: float, cut: bool
) -> None:
    unit.memory_ma = ma
    unit.run(until_us=unit.now_us + 10_000)
    assert unit.cut() == (set(codes.Sram) if cut else set())


def test_telemetry_currents_are_right_within_one_adc_step(unit: Harness) -> None:
    power = unit.telemetry("Power")
    for monitor in pins.Monitor:
        ma = power[f"Current{monitor.replace('SRAM', 'Sram')}"]
        assert ma == pytest.approx(unit.supply_ma.get(monitor, unit.memory_ma), abs=0.16)
    unit.latched.add(codes.Sram.SRAM1)
    unit.run(until_us=unit.now_us + 10_000)
    assert unit.telemetry("Power")["CurrentSram1"] == 0


def nothing() -> Routine[None]:
    yield Pay()


def measure(number: int) -> Measure:
    return Measure(Camera(number % 2), Sram(number // 2 % 2), detect=True)


def test_jobs_come_in_order_and_before_streams() -> None:
    queue = JobQueue()
    one, two = Background(nothing), Background(nothing)
    queue.request(one)
    assert queue.put(measure(0))
    queue.request(two)
    assert queue.put(measure(1))
    assert not queue.request(one)  # waits already
    assert len(queue) == 4
    assert [queue.pop() for _ in range(4)] == [measure(0), measure(1), one, two]
    assert not queue
    with pytest.raises(IndexError):
        queue.pop()


def test_background_job_with_next_turn_runs_before_others() -> None:
    queue = JobQueue()
    one, two = Background(nothing), Background(nothing)
    queue.request(one)
    queue.request(two, next_turn=True)
    assert [queue.pop(), queue.pop()] == [two, one]


def test_queue_holds_four_jobs_besides_background_streams() -> None:
    queue = JobQueue()
    queue.request(Background(nothing))
    accepted = [queue.put(measure(number)) for number in range(QUEUE_DEPTH + 1)]
    assert accepted == [True] * QUEUE_DEPTH + [False]
    assert queue.full
    assert queue.pop() == measure(0)
    assert not queue.full


EXTENDED = CubeSenseSwitches.of("extended")


def sizes() -> dict[str, int]:
    return {buffer.name: buffer.size for buffer in budget(EXTENDED)}


@pytest.mark.parametrize("profile", PROFILES)
def test_memory_budget_fits_the_pic_and_leaves_flash_for_a_program(profile: Profile) -> None:
    total = used(budget(CubeSenseSwitches.of(profile)))
    assert total[Memory.RAM] <= CAPACITY[Memory.RAM] == 1536
    assert total[Memory.FLASH] < CAPACITY[Memory.FLASH] / 8


def test_memory_budget_sizes_follow_from_the_stored_data() -> None:
    size = sizes()
    assert size["scanned pixels"] == 64
    assert size["edges"] == 4 * MAX_EDGES
    assert size["Sun window"] == 4 + 15 * 15
    assert size["distortion tables of the reset values"] == 227 + 2 * 2 * 227
    assert len(size) == len(budget(EXTENDED))


def test_published_profile_takes_less_ram_and_the_same_flash() -> None:
    ours, printed = (used(budget(CubeSenseSwitches.of(profile))) for profile in PROFILES[::-1])
    assert ours[Memory.FLASH] == printed[Memory.FLASH]  # telecommands change the kind of table
    # The 3 x 3 matrix, two rows of its inverse and its right side, in place of the sums of chords;
    # a byte for each edge, and where a bright run began.
    assert ours[Memory.RAM] - printed[Memory.RAM] == 16 * (4 + 2) - 18 * 4 + 40 + 4
    assert 0 < CAPACITY[Memory.RAM] - printed[Memory.RAM] < 227


@pytest.mark.parametrize("profile", PROFILES)
def test_overlaid_buffers_fit_their_shared_memory(profile: Profile) -> None:
    buffers = budget(CubeSenseSwitches.of(profile))
    size = {buffer.name: buffer.size for buffer in buffers}
    for name in {buffer.inside for buffer in buffers} - {""}:
        assert sum(buffer.size for buffer in buffers if buffer.inside == name) <= size[name]


@pytest.mark.parametrize("profile", ["extended"])
def test_program_buffers_have_the_budgeted_sizes(unit: Harness) -> None:
    size = sizes()
    acquisition = unit.program.acquisition
    scanned, window = acquisition.buffers
    assert scanned.nbytes == size["scanned pixels"]
    assert window.nbytes == size["Sun window"]
    assert np.shares_memory(scanned, window)
    assert unit.program.commands.download.data.nbytes == size["image frame"]
    lines = NadirLines(EdgeConfig(), unit.meter, buffer=scanned)
    assert np.shares_memory(lines.space, scanned)
    unit.memories[Sram.SRAM2] = chequered()
    unit.perform(acquisition.scan(Sram.SRAM2, lines))
    assert lines.edges.full
    assert lines.edges.points.nbytes == size["edges"]


def test_memory_report_lists_every_buffer_and_the_sums() -> None:
    text = report(budget())
    assert all(buffer.name in text for buffer in budget())
    assert f"**{used(budget())[Memory.RAM]}**" in text
