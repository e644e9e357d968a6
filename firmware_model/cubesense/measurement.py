"""One measurement: capture an image, find the Earth's or the Sun's centre, record the times.

CubeSense thesis, sections 6.5, 6.6 and 7.4. An image is examined in its memory, where it stays
until the next one is stored.

Times are those of the part's timer behind its prescaler of 256, from the command to the FPGAs on:
time = ticks x 256 / 5 MHz, so a tick is 51.2 us and 16 bits hold 3.4 s. The FPGA signals only the
end of an image, so the time of the first row is that of ACK less the time in which a camera sends
480 rows.
"""

from functools import cache

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.camera_control import CameraControl
from cubestack.firmware_model.cubesense.state import CameraResult, CameraSettings, State
from cubestack.firmware_model.cubesense.vision import distortion, sun_centroid
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig, EdgeList, NadirLines
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig, find_nadir
from cubestack.firmware_model.cubesense.vision.sample_search import Between, around_samples
from cubestack.firmware_model.interface.cameras.ov7620 import CLOCKS_PER_LINE, PIXEL_CLOCK_HZ
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import CLOCKS, PIC18F45K20
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine, pause

PRESCALER = 256

#: Of the timer, in the formula. With switch `clock` at ``oscillator`` the timer is finer than a
#: processor of that speed could have it, so that times remain comparable.
_CYCLES_PER_US = CLOCKS["instructions"] // 1_000_000


def ticks_of(us: int) -> int:
    return us * _CYCLES_PER_US // PRESCALER


def microseconds(ticks: int) -> int:
    """Duration of ``ticks``, rounded down."""
    return ticks * PRESCALER // _CYCLES_PER_US


def read_ticks() -> Routine[int]:
    now_us: int = yield ReadTimer()
    return ticks_of(now_us) & 0xFFFF


def ticks_since(started: int) -> Routine[int]:
    """Ticks since the timer showed ``started``, valid for up to 3.35 s."""
    now = yield from read_ticks()
    return now - started & 0xFFFF


#: From an image's first row to its end: 30.5 ms.
READ_OUT_TICKS = ticks_of(codes.ROWS * CLOCKS_PER_LINE * 1_000_000 // PIXEL_CLOCK_HZ)

BETWEEN = {
    codes.NadirSearch.AROUND_SAMPLES: Between.BINARY,
    codes.NadirSearch.AROUND_SAMPLES_STEPPING: Between.SEQUENTIAL,
}

SCANNED_PIXELS = FULL_SIZE.scan_clocks - 2  #: two clocks present no pixel

#: Blocks in which the part erases and writes its flash; it stops for each: 2 ms, assumed.
FLASH_ERASE_BYTES, FLASH_WRITE_BYTES, FLASH_STEP_US = 64, 32, 2_000


def projection_of(camera: codes.Camera, switches: CubeSenseSwitches) -> distortion.Projection:
    if camera is codes.Camera.NADIR and switches.distortion == "stereographic":
        return distortion.Projection.STEREOGRAPHIC
    return distortion.Projection.EQUIDISTANT


def make_table(
    camera: codes.Camera, switches: CubeSenseSwitches, factors: tuple[float, ...], meter: Meter
) -> distortion.RadiusTable:
    """The distortion table of ``camera`` for ``factors``; raises DistortionError if impossible."""
    if switches.distortion == "byte-table":
        return distortion.byte_table(meter, factors)
    return distortion.fine_table(meter, projection_of(camera, switches), factors)


@cache
def _constant_table(camera: codes.Camera, switches: CubeSenseSwitches) -> distortion.RadiusTable:
    """Table of the reset values, which the compiler computes."""
    factors = CameraSettings.at_reset(camera).distortion
    return make_table(camera, switches, factors, Meter(PIC18F45K20))


#: Source of a table: factors, and value of switch ``distortion``.
_Origin = tuple[tuple[float, ...], str]


class Measurement:
    """Measures with either camera and the settings in ``state``, into ``State.results``."""

    def __init__(
        self, meter: Meter, state: State, cameras: CameraControl, acquisition: Acquisition
    ) -> None:
        self._meter = meter
        self._state = state
        self._cameras = cameras
        self._acquisition = acquisition
        self._tables: dict[codes.Camera, tuple[_Origin, distortion.RadiusTable]] = {}

    def measure(self, camera: codes.Camera, sram: codes.Sram, *, detect: bool) -> Routine[None]:
        """Store an image of ``camera`` in ``sram`` and, with ``detect``, measure in it."""
        result = self._state.results[camera] = CameraResult()
        self._state.schedule(camera, sram, detect=detect)
        if detect:
            yield from self._update_table(camera)
        yield from self._cameras.prepare(camera)
        started = yield from read_ticks()
        capture = yield from self._acquisition.store(camera, sram)
        if capture is codes.CaptureResult.CAMERA_TIMEOUT:
            self._cameras.forget_set_up(camera)
        ticks = yield from ticks_since(started)
        reading = min(READ_OUT_TICKS, ticks) if capture.stored else 0
        result.wait_us = microseconds(ticks - reading)
        result.store_us = microseconds(reading)
        result.total_us = microseconds(ticks)
        result.capture = capture
        if not capture.stored:
            result.detect = codes.DetectResult.NONE_SCHEDULED
        elif detect:
            measured = self._measure_nadir if camera == codes.Camera.NADIR else self._measure_sun
            found = yield from measured(result, started)
            if not found:  # the memory was cut off during the search
                result.capture = codes.CaptureResult.SRAM_OVER_CURRENT
                result.detect = codes.DetectResult.NONE_SCHEDULED

    def _measure_nadir(self, result: CameraResult, started: int) -> Routine[bool]:
        """The Earth's direction; False if the memory was cut off."""
        settings, switches = self._state.cameras[codes.Camera.NADIR], self._state.switches.now
        threshold = yield from self._threshold(settings, result.sram)
        if threshold is None:
            return False
        config = EdgeConfig(
            threshold,
            settings.boresight,
            masks=tuple(settings.masks),
            sub_pixel=switches.edges == "sub-pixel",
            listing=switches.edges == "listing",
            sharp=switches.limb == "robust",
        )
        stored = yield from read_ticks()
        edges = yield from self._find_edges(result, config)
        if edges is None:
            return False
        searched = yield from read_ticks()
        result.search_us = microseconds((yield from ticks_since(stored)))
        judged = NadirConfig(
            self._tables[codes.Camera.NADIR][1],
            projection_of(codes.Camera.NADIR, switches),
            checked=switches.limb == "robust",
        )
        found = find_nadir(edges, judged, self._meter)
        if judged.checked:
            self._meter.charge(f32_mul=1, f32_convert=1)
        result.centroid_us = microseconds((yield from ticks_since(searched)))
        result.total_us = microseconds((yield from ticks_since(started)))
        result.alpha, result.beta, result.x, result.y = found.alpha, found.beta, found.x, found.y
        result.radius = round(found.radius_deg * codes.PIXELS_PER_DEGREE * 100)
        result.points = found.edges
        result.sigma = found.sigma_alpha, found.sigma_beta
        result.rms, result.found = round(100 * found.rms_px), len(edges)
        result.reason = found.reason
        result.edges = edges.points
        result.detect = found.detect
        return True

    def _threshold(self, settings: CameraSettings, sram: codes.Sram) -> Routine[int | None]:
        """The threshold of bright pixels; None if the memory was cut off."""
        if self._state.switches.now.threshold == "fixed":
            return settings.threshold
        return (yield from self._acquisition.mean(sram))

    def _find_edges(self, result: CameraResult, config: EdgeConfig) -> Routine[EdgeList | None]:
        acquisition, sram = self._acquisition, result.sram
        between = BETWEEN.get(self._state.nadir_search)
        if between is not None and acquisition.can_address(codes.Camera.NADIR, sram):
            search = around_samples(config, self._meter, between)
            answer = yield from acquisition.answer(sram, search)
            if answer is None:
                return None
            edges, result.pixels_read = answer
            return edges
        read_out = acquisition.edge_data(codes.Camera.NADIR, sram)
        lines = NadirLines(config, self._meter, read_out, acquisition.buffers[0])
        if not (yield from acquisition.scan(sram, lines)):
            return None
        result.pixels_read = SCANNED_PIXELS
        return lines.edges

    def _measure_sun(self, result: CameraResult, started: int) -> Routine[bool]:
        """The Sun's direction; False if the memory was cut off."""
        settings = self._state.cameras[codes.Camera.SUN]
        threshold = yield from self._threshold(settings, result.sram)
        if threshold is None:
            return False
        stored = yield from read_ticks()
        data = yield from self._acquisition.window(result.sram)
        if data is None:
            return False
        searched = yield from read_ticks()
        result.search_us = microseconds((yield from ticks_since(stored)))
        _, table = self._tables[codes.Camera.SUN]
        config = sun_centroid.SunConfig(
            table,
            threshold,
            settings.boresight,
            masks=tuple(settings.masks),
            printed=self._state.switches.now.sun == "all-pixels",
        )
        read_out = self._acquisition.edge_data(codes.Camera.SUN, result.sram)
        found = sun_centroid.find_sun(data, config, self._meter, read_out)
        result.centroid_us = microseconds((yield from ticks_since(searched)))
        result.total_us = microseconds((yield from ticks_since(started)))
        x_low, x_high, y_low, y_high = (int(byte) for byte in data[: sun_centroid.COORDINATE_BYTES])
        result.first = (x_low + 256 * x_high, y_low + 256 * y_high)
        result.pixels_read = len(data) - sun_centroid.COORDINATE_BYTES
        result.alpha, result.beta, result.x, result.y = found.alpha, found.beta, found.x, found.y
        result.points = result.found = found.pixels
        result.sigma = found.sigma_alpha, found.sigma_beta
        result.reason = found.reason
        result.detect = found.detect
        return True

    def _update_table(self, camera: codes.Camera) -> Routine[None]:
        """Compute the distortion table again, in flash, if its coefficients or its kind changed.

        The tables of the reset values are in flash already, one of each kind.
        """
        factors, switches = self._state.cameras[camera].distortion, self._state.switches.now
        origin = factors, switches.distortion
        if camera in self._tables and self._tables[camera][0] == origin:
            return
        if factors == CameraSettings.at_reset(camera).distortion:
            table = _constant_table(camera, switches)
        else:
            table = make_table(camera, switches, factors, self._meter)
            yield Pay()
            blocks = -(-table.size // FLASH_ERASE_BYTES) + -(-table.size // FLASH_WRITE_BYTES)
            yield from pause(blocks * FLASH_STEP_US)
        self._tables[camera] = origin, table
