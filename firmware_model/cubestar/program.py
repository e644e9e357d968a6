"""CubeStar's main program: commands, and the 1 Hz pipeline.

CubeStar thesis, section 5.3.6 and figure 5.8: while the FPGA stores a new image, the processor
works on the previous one; then the image is transferred, and a software reset ends the iteration.
With one shared memory (section 7.2) the processor works on an image as soon as it is stored.
Assumed: the reset waits until shortly before the next iteration, so that results can be read until
then, and is skipped while the host is in the middle of a message.
"""

from cubestack.firmware_model.cubestar import phases
from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.commands import Commands
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware, cause_of
from cubestack.firmware_model.cubestar.image_memory import image_memory
from cubestack.firmware_model.cubestar.image_sensor import ImageSensor
from cubestack.firmware_model.cubestar.link import CubeStarLink
from cubestack.firmware_model.cubestar.processing.chain import Processing
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.cubestar.telemetry import Telemetry
from cubestack.firmware_model.interface.cubestar.codes import ResetCause
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.interface.cubestar.switches import DEFAULT_SWITCHES, CubeStarSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Reset, Routine

RESET_LEAD_US = 10_000  #: from the reset, which takes a few milliseconds, to the next iteration
LATE_US = 10_000  #: an iteration that starts later by this is a timing error; assumed


class CubeStarProgram:
    """One run of the program, from reset to reset."""

    def __init__(
        self,
        hardware: CubeStarHardware,
        meter: Meter,
        catalogue: StarCatalogue,
        layout: Layout = Layout.COPIED,
        switches: CubeStarSwitches = DEFAULT_SWITCHES,
    ) -> None:
        """Restore RAM from the retention registers and flash; ``switches``: at power-up."""
        #: state: the program's memory, also read by traces
        self.state = state = State(hardware, meter, switches)
        state.reset_cause = cause_of(hardware.reset_causes)
        #: supply monitor; its ``overcurrent`` is the comparators' interrupt
        self.supply = SupplyMonitor(state)
        self._pictures = image_memory(layout, state, meter, self.supply)
        self._capture = ImageCapture(state, self.supply, ImageSensor(state), self._pictures)
        self._processing = Processing(meter, state, self._capture, catalogue)
        self.commands = Commands(self._processing)  #: the telecommands
        telemetry = Telemetry(self.commands, lambda: bool(self.link.queue))
        #: the satellite's interface; its methods are the UART and I2C interrupts
        self.link = CubeStarLink(meter, state, telemetry.values)

    def main(self) -> Routine[None]:
        yield from phases.start_loop(self.state)
        yield from self._pictures.start()
        retained, causes = self.state.retained, self.state.hardware.reset_causes
        retained.watchdog_resets += ResetCause.WATCHDOG in causes
        causes.clear()
        if self.state.reset_cause != ResetCause.SYSTEM_REQUEST or not retained.camera_setup:
            yield from self._capture.sensor.power_up()
        while True:
            served = yield from self._serve()
            if retained.looping:
                yield from self._iteration()
            elif not served:
                yield from phases.idle(self.state, None)

    def _serve(self) -> Routine[bool]:
        """Restore a supply and execute a waiting telecommand; False if there was neither."""
        self.supply.sample()
        waiting = bool(self.supply.cut or self.link.queue)
        if self.supply.cut and (yield from self.supply.restore()):
            yield from self._capture.sensor.power_up()
        if self.link.queue:
            cause = yield from self.commands.execute(self.link.queue.popleft())
            if cause is not None:
                yield from self._reset(cause)
        return waiting

    def _reset(self, cause: int) -> Routine[None]:
        yield Pay()  # so that nothing can happen between the next line and the reset
        self.state.retained.reset_us = yield ReadTimer()
        self.state.retain()
        yield Reset(cause)

    def _iteration(self) -> Routine[None]:
        """One turn of the loop, which starts at the end of the last turn's second."""
        retained = self.state.retained
        yield from self._wait_until(retained.loop_due_us)
        if not retained.looping:
            return
        started_us: int = yield ReadTimer()
        if started_us > retained.loop_due_us + LATE_US:
            self.state.raise_flag("TimingError")
            retained.loop_due_us = started_us
        retained.loop_due_us += self._pictures.iteration_us
        retained.delaying = 0

        if self._pictures.while_storing:
            previous = self._processing.process() if retained.image_present else None
            yield from self._capture.get_image(meanwhile=previous)
        else:
            yield from self._processing.capture_and_process()
        retained.iterations += 1
        yield from phases.end(self.state, "loop_us", started_us)
        retained.longest_loop_us = max(retained.longest_loop_us, retained.loop_us)

        yield from self._wait_until(retained.loop_due_us - RESET_LEAD_US)
        yield Pay()
        if retained.looping and self.link.idle:
            yield from self._reset(ResetCause.SYSTEM_REQUEST)

    def _wait_until(self, due_us: int) -> Routine[None]:
        """Idle until ``due_us``; serve the host and the supplies meanwhile.

        Returns at once if the loop is stopped. Telecommands precede the next iteration.
        """
        while self.state.retained.looping:
            served = yield from self._serve()
            now_us: int = yield ReadTimer()
            if now_us >= due_us and not self.link.queue:
                return
            if not served:
                yield from phases.idle(self.state, due_us)
