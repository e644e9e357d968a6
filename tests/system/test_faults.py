"""What each fault does to a CubeStar's picture and wire, and what the firmware makes of it.

The reactions are those that docs/faults.md lists.
"""

import errno
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from smbus2 import i2c_msg

from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.faults.plan import parse_plan
from cubestack.emulator.sky.scene import SkyScene
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.frames import encode_frame
from cubestack.host.cubestar import CubeStar
from cubestack.host.errors import NoAnswerError, StepFailedError
from cubestack.host.i2c_client import I2cClient
from cubestack.host.node_client import NodeClient

ROWS, COLUMNS = 512, 1024
STORING_S, READING_S = 0.42, 0.6  # within the first capture after power-up
BYTE_S = 10 / INTERFACE.baud
IDENTIFICATION = INTERFACE.telemetry("Identification")


@pytest.fixture
def opened(session: Callable[..., Any]) -> Iterator[Any]:
    with session(SkyScene.pointing(84, -1), seed=4) as opened:
        yield opened


@pytest.fixture(scope="module")
def good() -> np.ndarray:
    """The picture without faults."""
    from cubestack.host.cli.session import open_session

    with open_session(SkyScene.pointing(84, -1), seed=4) as opened:
        opened.cubestar.capture_and_process()
        return stored(opened)


def stored(opened: Any) -> np.ndarray:
    """What the FPGA wrote into its memory, (512, 1024)."""
    return opened.board.engine.sram[: ROWS * COLUMNS].reshape(ROWS, COLUMNS).copy()


def transferred(opened: Any) -> np.ndarray:
    """What the processor read of it."""
    return opened.board.program._capture.image.copy()


def flags(opened: Any) -> set[str]:
    """Error flags but for the one that this rich sky raises."""
    values = opened.cubestar.client.telemetry("ErrorFlags")
    return {name for name, value in values.items() if value} - {"MaxStarsDetection"}


def capture(opened: Any, kind: str, **options: Any) -> tuple[str, set[str]]:
    """Status and flags of a capture with a fault; it is cleared before the next one."""
    opened.board.faults.inject(kind, **options)
    status = opened.cubestar.capture_and_process().name
    opened.board.faults.clear()
    assert opened.board.faults.log[0].kind == kind
    return status, flags(opened)


# --- serial line ----------------------------------------------------------------------------------


def patient(opened: Any, retries: int = 0) -> NodeClient:
    """A new client on the serial line, which gives up after 0.1 s."""
    client = NodeClient(opened.board.serial(), INTERFACE, timeout_s=0.1, retries=retries)
    opened.cubestar = CubeStar(client)
    return client


def exchange(line: Any) -> bytes:
    """Ask for telemetry Identification; all that comes back."""
    line.write(encode_frame(bytes([IDENTIFICATION.id])))
    answer = b""
    while piece := line.read(100, 0.1):
        answer += piece
    return answer


def test_a_lost_byte_to_the_device_is_an_incomplete_message(opened: Any) -> None:
    client = patient(opened)
    opened.board.faults.inject("uart-drop", direction="to-device", for_s=BYTE_S / 2)
    with pytest.raises(NoAnswerError):
        client.telemetry("Identification")
    assert [str(event).split(": ")[1] for event in opened.board.faults.log] == [
        "0x1f to-device lost"
    ]
    assert client.telemetry("Identification")["InterfaceVersion"] == INTERFACE.version
    assert flags(opened) == {"UART_ProtocolError"}


def test_a_lost_byte_to_the_host_is_asked_for_again(opened: Any) -> None:
    client = patient(opened, retries=9)
    opened.board.faults.inject("uart-drop", direction="to-host", rate=0.05)
    for _ in range(20):
        assert client.telemetry("Identification")["InterfaceVersion"] == INTERFACE.version
    assert opened.board.faults.events > 3
    opened.board.faults.clear()
    assert flags(opened) == set()


def test_a_changed_byte_arrives_changed(opened: Any) -> None:
    line = opened.board.serial()
    clean = exchange(line)
    opened.board.faults.inject("uart-corrupt", direction="to-host", mask=0x80)
    changed = exchange(line)
    assert len(changed) == len(clean)
    assert bytes(byte ^ 0x80 for byte in changed)[:4] == clean[:4]


def test_a_changed_byte_to_the_device_is_refused(opened: Any) -> None:
    client = patient(opened)
    opened.board.faults.inject("uart-corrupt", direction="to-device", mask=0xFF)
    with pytest.raises(NoAnswerError):
        client.telemetry("Identification")
    opened.board.faults.clear()
    assert client.telemetry("Identification")["InterfaceVersion"] == INTERFACE.version
    assert flags(opened) == {"UART_ProtocolError"}


def test_a_changed_parameter_in_its_range_is_believed(opened: Any) -> None:
    client = patient(opened)
    at_s = opened.board.kernel.now / 1e12 + 2.5 * BYTE_S
    opened.board.faults.inject(
        "uart-corrupt", direction="to-device", mask=0x04, at_s=at_s, for_s=BYTE_S
    )
    client.command("SetDiscardDelay", Delay=100)
    assert opened.board.program._state.settings.get("SetDiscardDelay", "Delay") != 100


def test_a_late_byte_makes_the_answer_late(opened: Any) -> None:
    line, kernel = opened.board.serial(), opened.board.kernel
    lasted = []
    for delay_ms in (0, 5, 12):
        opened.board.faults.inject("uart-delay", delay_ms=delay_ms, for_s=BYTE_S / 2)
        began = kernel.now
        exchange(line)
        lasted.append(kernel.now - began)
    assert lasted[1] - lasted[0] == 5 * 10**9
    assert lasted[2] - lasted[0] == 12 * 10**9
    patient(opened)
    assert flags(opened) == set()


def test_a_message_held_up_in_the_middle_is_given_up(opened: Any) -> None:
    client = patient(opened)
    at_s = opened.board.kernel.now / 1e12 + 2.5 * BYTE_S
    opened.board.faults.inject("uart-delay", direction="to-device", delay_ms=60, at_s=at_s)
    with pytest.raises(NoAnswerError):
        client.telemetry("Identification")
    opened.board.faults.clear()
    assert flags(opened) == {"UART_MsgIncomplete", "UART_RXTimeout", "UART_ProtocolError"}


# --- I2C ------------------------------------------------------------------------------------------


def ask(bus: Any) -> int:
    """The first byte of telemetry Identification."""
    answer = i2c_msg.read(INTERFACE.i2c_address, 1)
    bus.i2c_rdwr(i2c_msg.write(INTERFACE.i2c_address, [IDENTIFICATION.id]), answer)
    return int.from_bytes(bytes(answer))


def test_an_address_without_acknowledge_leaves_the_device_alone(opened: Any) -> None:
    bus = opened.board.i2c()
    fault = opened.board.faults.inject("i2c-nack")
    with pytest.raises(OSError, match="no I2C device answers") as failure:
        ask(bus)
    assert failure.value.errno == errno.ENXIO
    opened.board.faults.clear(fault)
    assert ask(bus) == int(opened.cubestar.client.telemetry("Identification")["NodeType"])
    assert flags(opened) == set()


def test_a_byte_without_acknowledge_cuts_a_telecommand_short(opened: Any) -> None:
    bus = opened.board.i2c()
    command = INTERFACE.telecommand("SetDiscardDelay")
    data = bytes([command.id]) + command.pack(Delay=100)
    opened.board.faults.inject("i2c-nack", on="byte", at_s=0.01)
    opened.board.kernel.advance_to(10**10 - 2 * 10 * 10**7)  # the second byte ends at 10 ms
    with pytest.raises(OSError, match="refused") as failure:
        bus.i2c_rdwr(i2c_msg.write(INTERFACE.i2c_address, data))
    assert failure.value.errno == errno.EIO
    opened.board.faults.clear()
    assert flags(opened) == {"I2C_TCMD_TooFewParm"}


def test_a_stretched_clock_takes_time(opened: Any) -> None:
    bus, kernel = opened.board.i2c(), opened.board.kernel
    began = kernel.now
    ask(bus)
    usual = kernel.now - began
    opened.board.faults.inject("i2c-stretch", stretch_us=700)
    began = kernel.now
    ask(bus)
    assert kernel.now - began == usual + 2 * 700 * 10**6
    opened.board.faults.inject("i2c-stretch", stretch_us=2e6)
    with pytest.raises(OSError, match="clock low") as failure:
        ask(bus)
    assert failure.value.errno == errno.ETIMEDOUT


@pytest.mark.parametrize("line", ["SDA", "SCL"])
def test_a_stuck_line_blocks_the_bus_until_it_is_free(opened: Any, line: str) -> None:
    bus, kernel = opened.board.i2c(), opened.board.kernel
    opened.board.faults.inject("i2c-stuck", line=line, for_s=1.3)
    with pytest.raises(OSError, match=f"{line} was low") as failure:
        ask(bus)
    assert failure.value.errno == errno.EBUSY
    began = kernel.now
    client = I2cClient(bus, INTERFACE, wait=bus.wait)
    assert client.telemetry("Identification")["InterfaceVersion"] == INTERFACE.version
    assert kernel.now - began > 0.29e12
    assert flags(opened) == set()


@pytest.mark.parametrize(("line", "number"), [("SDA", errno.EAGAIN), ("SCL", errno.ETIMEDOUT)])
def test_a_line_that_sticks_in_a_transfer_breaks_it(opened: Any, line: str, number: int) -> None:
    opened.board.faults.inject("i2c-stuck", line=line, at_s=0.0001)
    with pytest.raises(OSError, match="low") as failure:
        ask(opened.board.i2c())
    assert failure.value.errno == number


# --- acknowledge and control pins -----------------------------------------------------------------


def test_a_late_acknowledge_only_delays(opened: Any, good: np.ndarray) -> None:
    plain = 383.979
    assert capture(opened, "ack-late", delay_us=300_000) == ("CALCULATED", set())
    assert abs(opened.cubestar.phase_times()["capture"] - plain - 300) < 1
    np.testing.assert_array_equal(stored(opened), good)


@pytest.mark.parametrize(
    ("kind", "options"),
    [("ack-late", {"delay_us": 3e6}), ("ack-lost", {}), ("ack-stuck", {"level": 0})],
)
def test_without_acknowledge_the_capture_fails_in_time(
    opened: Any, kind: str, options: dict[str, Any]
) -> None:
    assert capture(opened, kind, **options) == ("CAPTURE_FAILED", {"ImageCaptureError"})
    assert 2000 < opened.cubestar.phase_times()["capture"] < 2010
    assert opened.cubestar.capture_and_process().name == "CALCULATED"


def test_an_acknowledge_that_is_always_there_gives_old_pictures(
    opened: Any, good: np.ndarray
) -> None:
    status, raised = capture(opened, "ack-stuck", level=1)
    assert status == "IDENTIFICATION_FAILED"  # noise: what the memory held at power-up
    assert "ImageCaptureError" not in raised
    assert (stored(opened) != good).mean() > 0.9


@pytest.mark.parametrize("pin", ["ENABLE", "RNW"])
def test_a_glitch_while_storing_costs_a_frame(opened: Any, pin: str) -> None:
    outcome = capture(opened, "control-glitch", target=pin, at_s=STORING_S)
    assert outcome == ("CALCULATED", set())
    assert 770 < opened.cubestar.phase_times()["capture"] < 771  # two frames instead of one


@pytest.mark.parametrize("pin", ["ENABLE", "RNW"])
def test_a_glitch_while_reading_starts_over(opened: Any, good: np.ndarray, pin: str) -> None:
    capture(opened, "control-glitch", target=pin, at_s=READING_S)
    np.testing.assert_array_equal(stored(opened), good)
    picture, whole = transferred(opened).ravel(), good.ravel()
    begun = int(np.argmax(picture != whole))
    assert begun > 100_000
    starts = range(begun - 200, begun + 1)  # black pixels are the same anywhere
    assert any(np.array_equal(picture[at + 2 : at + 50_000], whole[2:50_000]) for at in starts)


# --- camera ---------------------------------------------------------------------------------------


def test_a_lost_clock_moves_the_rest_of_one_line(opened: Any, good: np.ndarray) -> None:
    outcome = capture(opened, "clock-lost", row=100, column=20)
    assert outcome == ("CALCULATED", set())
    expected = good.copy()
    expected[100, 20:-1] = good[100, 21:]
    expected[100, -1] = stored(opened)[100, -1]  # never written
    np.testing.assert_array_equal(stored(opened), expected)


def test_an_extra_clock_moves_the_rest_of_one_line(opened: Any, good: np.ndarray) -> None:
    assert capture(opened, "clock-extra", row=100, column=20) == ("CALCULATED", set())
    expected = good.copy()
    expected[100, 21:] = good[100, 20:-1]
    np.testing.assert_array_equal(stored(opened), expected)
    assert not opened.board.engine.violations


def test_a_missing_line_leaves_the_fpga_waiting(opened: Any) -> None:
    assert capture(opened, "line-missing", row=100) == ("CAPTURE_FAILED", {"ImageCaptureError"})
    assert opened.cubestar.capture_and_process().name == "CALCULATED"


def test_a_missing_line_in_one_frame_costs_a_second_one(opened: Any) -> None:
    opened.board.faults.inject("line-missing", row=100, for_s=0.5)
    opened.cubestar.capture_and_process()
    assert 770 < opened.cubestar.phase_times()["capture"] < 771
    assert flags(opened) == set()


@pytest.mark.parametrize(("kind", "value"), [("pixel-hot", 255), ("pixel-dead", 0)])
def test_a_bad_pixel_is_one_pixel(opened: Any, good: np.ndarray, kind: str, value: int) -> None:
    assert capture(opened, kind, x=700, y=30) == ("CALCULATED", set())
    expected = good.copy()
    expected[30, 700] = value
    np.testing.assert_array_equal(stored(opened), expected)


def test_a_bad_column_is_no_star(opened: Any, good: np.ndarray) -> None:
    assert capture(opened, "column-defect", x=500, level=200) == ("CALCULATED", set())
    expected = good.copy()
    expected[:, 500] = 200
    np.testing.assert_array_equal(stored(opened), expected)


def test_blooming_spoils_the_brightest_stars(opened: Any, good: np.ndarray) -> None:
    status, raised = capture(opened, "blooming", threshold=100, length=20)
    assert (status, raised) == ("IDENTIFICATION_FAILED", {"LessThanThreeStarsID"})
    changed = np.argwhere(stored(opened) != good)
    assert {int(x) for _, x in changed} <= {int(x) for _, x in np.argwhere(good >= 100)}


def test_a_defect_for_a_while_hits_the_lines_of_that_time(opened: Any, good: np.ndarray) -> None:
    opened.board.faults.inject("column-defect", x=3, at_s=STORING_S, for_s=0.01)
    opened.cubestar.capture_and_process()
    lines = np.flatnonzero(stored(opened)[:, 3] == 255)
    assert 0 < len(lines) < ROWS
    assert np.all(np.diff(lines) == 1)


def test_a_dead_camera_is_noticed_at_its_control_bus(opened: Any) -> None:
    assert capture(opened, "camera-dead") == ("CAPTURE_FAILED", {"ISSetupError"})


def test_a_camera_that_dies_while_storing_is_not_set_up_again(opened: Any) -> None:
    outcome = capture(opened, "camera-dead", at_s=STORING_S)
    assert outcome == ("CAPTURE_FAILED", {"ImageCaptureError", "ISDisableError"})
    # The firmware believes the registers to be as it left them.
    registers = opened.board.camera._registers
    opened.cubestar.capture_and_process()
    assert registers.active("FRAMES_PER_SECOND") != opened.board.program._state.settings.get(
        "SetFrameRate", "FrameRate"
    )


# --- memory, registers, supply --------------------------------------------------------------------


def test_a_flipped_bit_is_one_bit(opened: Any, good: np.ndarray) -> None:
    outcome = capture(opened, "memory-flip", address=70_000, bit=7, at_s=0.47)
    assert outcome == ("CALCULATED", set())
    expected = good.copy().ravel()
    expected[70_000] ^= 0x80
    np.testing.assert_array_equal(transferred(opened).ravel(), expected)


def test_upsets_come_at_their_rate(opened: Any) -> None:
    capture(opened, "memory-upsets", rate=1e-4)
    elapsed_s = opened.board.kernel.now / 1e12
    expected = 1e-4 * 8 * opened.board.engine.sram.size * elapsed_s
    assert abs(opened.board.faults.events - expected) < 5 * np.sqrt(expected)


def test_a_stuck_bit_is_the_same_in_every_picture(opened: Any) -> None:
    assert capture(opened, "memory-stuck", address=70_000, bit=7)[0] == "CALCULATED"
    assert transferred(opened).ravel()[70_000] & 0x80


def test_a_register_that_flips_moves_the_picture(opened: Any, good: np.ndarray) -> None:
    capture(opened, "register-flip", register="writer.counter.row", bit=8, at_s=STORING_S)
    assert (stored(opened) != good).mean() > 0.1


def test_registers_in_reset_can_not_flip(opened: Any, good: np.ndarray) -> None:
    for number in range(20):
        opened.board.faults.inject("register-flip", at_s=0.001 + number * 1e-5)
    opened.cubestar.capture_and_process()
    opened.cubestar.capture_and_process()
    assert flags(opened) == set()
    assert opened.board.faults.events == 20


def test_register_upsets_break_memory_timing(opened: Any) -> None:
    capture(opened, "register-upsets", rate=10)
    assert opened.cubestar.capture_and_process().name == "CALCULATED"


@pytest.mark.parametrize("channel", ["imager", "memory"])
def test_a_latch_up_is_cut_and_restored(opened: Any, channel: str) -> None:
    outcome = capture(opened, "latch-up", target=channel)
    assert outcome == ("CALCULATED", {"OverCurrent"})
    assert opened.board.power.current_ma(channel) < 100


def test_a_lasting_latch_up_keeps_the_imager_off(opened: Any) -> None:
    status, raised = capture(opened, "latch-up", target="imager", lasting=True)
    assert (status, raised) == ("CAPTURE_FAILED", {"OverCurrent", "ISSetupError"})
    assert opened.cubestar.client.telemetry("Identification")


# --- plans ----------------------------------------------------------------------------------------

PLAN = """
seed = {seed}

[[fault]]
kind = "uart-corrupt"
direction = "to-host"
rate = 0.02

[[fault]]
kind = "clock-lost"

[[fault]]
kind = "memory-upsets"
rate = 1e-6

[[fault]]
kind = "latch-up"
at = 0.3
"""


def replay(session: Callable[..., Any], seed: int) -> tuple[list[Any], list[str]]:
    with session(SkyScene.pointing(84, -1), seed=4) as opened:
        wire: list[Any] = []
        opened.board.faults.load(parse_plan(PLAN.format(seed=seed)))
        deliver = opened.board.uart.line

        def listen(data: bytes, first_ps: int, byte_ps: int) -> None:
            wire.append((bytes(data), first_ps, byte_ps))
            deliver(data, first_ps, byte_ps)

        opened.board.uart.line = listen
        client = NodeClient(opened.board.serial(), INTERFACE, retries=9)
        opened.board.uart.line, deliver = listen, opened.board.uart.line
        for _ in range(3):
            try:
                CubeStar(client).capture()
            except (OSError, StepFailedError) as error:
                wire.append(str(error))
        return wire, [str(event) for event in opened.board.faults.log]


def test_a_plan_repeats_to_the_byte(session: Callable[..., Any]) -> None:
    first = replay(session, 7)
    kinds = {line.split()[2] for line in first[1]}
    assert kinds == {"uart-corrupt", "clock-lost", "memory-upsets", "latch-up"}
    assert replay(session, 7) == first
    assert replay(session, 8)[1] != first[1]


def test_refusals_name_what_would_be_right(opened: Any) -> None:
    faults = opened.board.faults
    cases: list[tuple[dict[str, Any], str]] = [
        ({"fault": "pixel-hat"}, "no fault 'pixel-hat'; there are uart-drop"),
        ({"fault": "pixel-hot", "target": "sun"}, "no camera 'sun'; there are imager"),
        ({"fault": "uart-drop", "rate": 2.0}, "rate must be 0 to 1, not 2.0"),
        ({"fault": "uart-drop", "chance": 1}, "no parameter 'chance'; it has rate, direction"),
        ({"fault": "latch-up", "for_s": 1.0}, "it has no duration"),
        ({"fault": "uart-drop", "at_s": -1.0}, "can not begin at -1 s"),
        ({"fault": "register-flip", "register": "writer.ack", "bit": 3}, r"writer\.ack\[3\]"),
    ]
    for arguments, message in cases:
        with pytest.raises(ValueError, match=message):
            faults.inject(**arguments)
    assert issubclass(FaultError, ValueError)
    assert opened.cubestar.capture_and_process().name == "CALCULATED"
    assert faults.events == 0
