import numpy as np
import pytest
from scipy import integrate

from cubestack.firmware_model.aramis.camera import Camera
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.hardware import FrameEnd
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.firmware_model.mcu.requests import CameraTransfer
from cubestack.host.studies.aramis.sky import meter, project, within

from .harness import Harness

ROW_US = 31.75


class Desk:
    """A camera whose frame ends after ``frame_us`` of sleep; None: never."""

    def __init__(self) -> None:
        self.unit = Harness()
        self.state = State(self.unit.flash)
        self.camera = Camera(self.unit, self.state, self.unit.meter)
        self.frame_us: int | None = 50_000
        self.end = FrameEnd.STORED
        self.unit.on_sleep = self.frame_comes

    def frame_comes(self) -> None:
        if self.frame_us is not None:
            self.unit.now_us += self.frame_us
            self.camera.frame_ended(self.end)

    def start(self) -> Reason | None:
        return self.unit.perform(self.camera.start())

    def take(self) -> Reason | None:
        return self.unit.perform(self.camera.take())


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_camera_set_up_writes_changed_settings_once(desk: Desk) -> None:
    desk.state.settings.put("SetExposure", {"Rows": 2000})
    desk.state.settings.put("SetGain", {"Gain": 4.0})
    assert desk.start() is None
    registers = desk.unit.registers
    assert (registers[0x09], registers[0x35], registers[0x07]) == (2000, 0x20, 2)
    registers[0x09] = 7
    assert desk.start() is None  # nothing changed, so nothing is written
    assert registers[0x09] == 7
    desk.state.settings.put("SetGain", {"Gain": 8.0})
    assert desk.start() is None
    assert (registers[0x09], registers[0x35]) == (2000, 0x60)
    desk.camera.forget_set_up()
    registers[0x35] = 1
    desk.start()
    assert registers[0x35] == 0x60


def test_silent_or_unknown_camera_raises_camera_silent(desk: Desk) -> None:
    registers, desk.unit.registers = desk.unit.registers, None
    assert desk.start() is Reason.CAMERA_SILENT
    desk.unit.registers = registers
    registers[0x00] = 0x8421  # the colour version
    assert desk.start() is Reason.CAMERA_SILENT
    assert desk.state.flags == {"CameraSilent"}


def test_camera_that_refuses_writes_is_reported_silent(desk: Desk) -> None:
    def read_only(request: CameraTransfer) -> bytes | None:
        return transfer(request) if len(request.data) == 1 else None

    desk.state.settings.put("SetExposure", {"Rows": 2000})
    transfer, desk.unit.transfer = desk.unit.transfer, read_only  # type: ignore[method-assign]
    assert desk.start() is Reason.CAMERA_SILENT
    assert desk.state.flags == {"CameraSilent"}
    desk.unit.transfer = transfer  # type: ignore[method-assign]
    assert desk.start() is None
    assert desk.unit.registers is not None
    assert desk.unit.registers[0x09] == 2000  # what was not taken then is written now


def test_captures_alternate_between_two_buffers(desk: Desk) -> None:
    desk.start()
    for number in range(1, 5):
        assert desk.take() is None
        assert (desk.state.frames, desk.camera.latest) == (number, (number - 1) % 2)
    one, two = desk.unit.captures[:2]
    assert one.shape == two.shape == (1024, 1280)
    assert not np.shares_memory(one, two)
    assert np.shares_memory(one, desk.camera.picture(0))


@pytest.mark.parametrize(("place", "start"), [(0, 0), (1, 0x20_0000)])
def test_images_begin_at_whole_rows_of_the_sdram(desk: Desk, place: int, start: int) -> None:
    """The first one at its very beginning; a row of the MT48LC16M16 has 512 words of 16 bits."""
    desk.camera.picture(place)[0, :3] = 1, 2, 3
    assert np.flatnonzero(desk.unit.sdram).tolist() == [start, start + 1, start + 2]


def test_image_time_is_mid_exposure_of_the_middle_row(desk: Desk) -> None:
    desk.state.settings.put("SetExposure", {"Rows": 3000})
    desk.start()
    desk.take()
    age_us = (511.5 + 1500) * ROW_US + 1280 / 48
    assert desk.unit.now_us - desk.camera.image_us() == pytest.approx(age_us, abs=2)


def test_camera_times_out_after_three_frame_times(desk: Desk) -> None:
    desk.start()
    desk.frame_us = None
    before = desk.unit.now_us
    assert desk.take() is Reason.CAMERA_TIMEOUT
    assert desk.unit.now_us - before == pytest.approx(3 * 6300 * ROW_US + 20_000, rel=1e-3)
    assert (desk.state.flags, desk.state.frames) == ({"CameraTimeout"}, 0)
    desk.frame_us = 10
    assert (desk.start(), desk.take()) == (None, None)


@pytest.mark.parametrize("end", [FrameEnd.TOO_SHORT, FrameEnd.WRONG_LINES])
def test_frame_of_unexpected_size_raises_camera_frame_error(desk: Desk, end: FrameEnd) -> None:
    desk.start()
    desk.end = end
    assert (desk.take(), desk.state.flags) == (Reason.CAMERA_FRAME, {"CameraFrameError"})
    assert desk.camera.latest is None


def test_waits_for_frame_requested_before(desk: Desk) -> None:
    desk.start()
    desk.camera.expose()
    desk.camera.frame_ended(FrameEnd.STORED)
    assert desk.take() is None
    assert len(desk.unit.captures) == 1
    desk.camera.expose()
    desk.state.settings.put("SetExposure", {"Rows": 100})
    stopped = desk.unit.stopped
    desk.start()  # the frame under way has the old exposure
    assert desk.unit.stopped == stopped + 1
    assert desk.take() is None
    assert len(desk.unit.captures) == 3


def test_cutting_the_camera_supply_ends_the_frame_wait(desk: Desk) -> None:
    desk.start()
    desk.unit.on_sleep = desk.camera.cut
    stopped = desk.unit.stopped
    assert desk.take() is Reason.CAMERA_OFF
    assert desk.unit.stopped == stopped + 1  # the transfer is not left waiting for ever
    assert not desk.unit.camera_on
    assert desk.start() is Reason.CAMERA_OFF
    assert desk.state.flags == {"CameraOff"}
    before = desk.unit.now_us
    desk.unit.perform(desk.camera.restore())
    assert desk.unit.now_us - before >= 2_000
    assert desk.unit.camera_on
    desk.unit.on_sleep = desk.frame_comes
    assert (desk.start(), desk.take()) == (None, None)


def test_camera_register_is_written_and_selected_by_address(desk: Desk) -> None:
    assert desk.unit.perform(desk.camera.write(0x35, 0x21))
    desk.unit.perform(desk.camera.select(0x35))
    assert desk.camera.selected_register == (0x35, 0x21)
    desk.unit.registers = None
    desk.unit.perform(desk.camera.select(0x35))
    assert desk.camera.selected_register == (0x35, None)
    assert not desk.unit.perform(desk.camera.write(0x35, 0x21))


OBLONG = CameraField(13.7, 752, 580, 0.0086, 0.0083, round=False)
FIELDS = pytest.mark.parametrize("field", [CameraField(), CameraField(fov_deg=18), OBLONG])


@FIELDS
def test_camera_field_directions_project_back_to_the_pixels(field: CameraField) -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 1, (500, 2)) * (field.columns - 1, field.rows - 1)
    directions = field.directions(points.astype(np.float32), meter())
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=2e-7)
    np.testing.assert_allclose(project(directions.astype(np.float64), field), points, atol=2e-3)


def test_shorter_image_side_spans_the_field_of_view() -> None:
    field = CameraField()
    edge = np.array([[639.5, -0.5], [639.5, 1023.5]], dtype=np.float32)
    top, bottom = field.directions(edge, meter()).astype(np.float64)
    assert np.degrees(np.arccos(top @ bottom)) == pytest.approx(21.53464, abs=1e-4)
    assert field.focal_length_mm == pytest.approx(14.0, abs=0.01)


@FIELDS
def test_inside_contains_and_mask_agree_on_the_field(field: CameraField) -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.2, 1.2, (2000, 2)) * (field.columns, field.rows)
    points = points[np.abs(np.hypot(*(points - field.centre).T) - 512) > 0.1]
    directions = field.directions(points.astype(np.float32), meter())
    expected = within(points, field)
    np.testing.assert_array_equal(field.inside(points.astype(np.float32), meter()), expected)
    np.testing.assert_array_equal(field.contains(directions, meter()), expected)
    assert not field.contains(-directions, meter()).any()


@FIELDS
def test_field_mask_contains_exactly_the_pixels_inside(field: CameraField) -> None:
    y, x = np.nonzero(field.mask)
    points = np.stack([x, y], axis=1).astype(np.float32)
    assert field.inside(points, meter()).all()
    assert field.pixels == len(points)
    assert not field.mask.flags.writeable


def test_camera_field_solid_angle_matches_integration() -> None:
    x, y = np.array([OBLONG.columns, OBLONG.rows]) / 2 * OBLONG.scale
    exact = integrate.dblquad(lambda y, x: (1 + x * x + y * y) ** -1.5, -x, x, -y, y)[0]
    assert OBLONG.solid_angle_sr == pytest.approx(exact, rel=0.06)
    half = np.radians(21.53464 / 2)
    assert CameraField().solid_angle_sr == pytest.approx(2 * np.pi * (1 - np.cos(half)), rel=1e-4)
