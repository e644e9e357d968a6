"""AraMiS' main program: telecommands, the loop, and the catalogue's periodic reload.

AraMiS thesis, sections 2.1 (periodic reloading), 2.2 (use cases) and 7.3. The loop is an extension,
1 Hz by default; below a second the next frame is transferred while the last one is processed. The
catalogue is reloaded in slices in idle time.
"""

from cubestack.firmware_model.aramis.camera import Camera
from cubestack.firmware_model.aramis.catalogue.flash_store import CatalogueStore
from cubestack.firmware_model.aramis.commands import Commands
from cubestack.firmware_model.aramis.hardware import AramisHardware, FrameEnd
from cubestack.firmware_model.aramis.link import AramisLink
from cubestack.firmware_model.aramis.measurement import Measuring
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.aramis.telemetry import Telemetry
from cubestack.firmware_model.interface.aramis import MeasurementMode
from cubestack.firmware_model.interface.aramis.switches import DEFAULT_SWITCHES, AramisSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Reset, Routine, Sleep

LATE_US = 10_000  #: an iteration that starts later by this is a timing error; assumed
OVERLAP_BELOW_MS = 1000
SLICE_US = 5_000  #: more than a slice of a reload takes


class AramisProgram:
    """One run of the program, from reset to reset."""

    def __init__(
        self, hardware: AramisHardware, meter: Meter, switches: AramisSwitches = DEFAULT_SWITCHES
    ) -> None:
        """Settings come from flash, ``switches`` are those of power-up."""
        #: state: the program's memory, also read by traces
        self.state = state = State(hardware.flash, switches)
        self._camera = Camera(hardware, state, meter)
        self._catalogue = CatalogueStore(hardware, meter, switches.ram)
        self._measuring = Measuring(meter, state, self._camera, self._catalogue)
        #: the telecommands
        self.commands = Commands(
            hardware, meter, state, self._camera, self._catalogue, self._measuring
        )
        telemetry = Telemetry(
            hardware, meter, state, self._camera, self._catalogue, self.commands, lambda: self.link
        )
        #: the satellite's interface; its methods are the UART and I2C interrupts
        self.link = AramisLink(hardware, meter, state, telemetry.values, self.commands.urgent)

    def frame_ended(self, end: FrameEnd) -> None:
        self._camera.frame_ended(end)

    def main(self) -> Routine[None]:
        yield from self._camera.restore()
        yield from self._camera.stop()
        while True:
            if (yield from self._serve()):
                continue
            if self.state.looping:
                yield from self._iteration()
            else:
                yield from self._idle(None)

    def _serve(self) -> Routine[bool]:
        """Execute a waiting telecommand; False if there is none."""
        if not self.link.queue:
            return False
        self.commands.running = True
        cause = yield from self.commands.execute(self.link.queue.popleft())
        if cause is not None:
            yield Pay()
            yield Reset(cause)
        return True

    def _iteration(self) -> Routine[None]:
        state = self.state
        now_us: int = yield ReadTimer()
        if now_us < state.loop_due_us:
            yield from self._idle(state.loop_due_us)
            return
        period_ms = int(state.settings.get("StartLoop", "Period"))
        if now_us > state.loop_due_us + LATE_US:
            state.raise_flag("TimingError")
            state.late += 1
            state.loop_due_us = now_us
        state.loop_due_us += 1000 * period_ms
        aided = state.settings.get("StartLoop", "Mode") == MeasurementMode.AIDED
        hint = self._measuring.latest_boresight() if aided else None
        yield from self._measuring.measure(hint, overlap=period_ms < OVERLAP_BELOW_MS)
        state.iterations += 1

    def _idle(self, deadline_us: int | None) -> Routine[None]:
        """Reload a slice of the catalogue if it is due and fits, else sleep."""
        now_us: int = yield ReadTimer()
        reload_us = self._reload_due_us()
        fits = deadline_us is None or now_us + SLICE_US <= deadline_us
        if reload_us is not None and now_us >= reload_us and fits:
            yield from self.commands.reload_step()
            return
        times = [time for time in (deadline_us, reload_us) if time is not None and time > now_us]
        yield Sleep(min(times) if times else deadline_us)

    def _reload_due_us(self) -> int | None:
        """Time of the next reload, or of the next slice of the present one; None: never."""
        if not self.state.active:
            return None
        if self._catalogue.loading:
            return 0
        period_s = int(self.state.settings.get("SetReloadPeriod", "Period"))
        if not period_s or self._catalogue.loaded_us is None:
            return None
        return self._catalogue.loaded_us + 1_000_000 * period_s
