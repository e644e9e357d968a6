"""CubeStar's main program: commands, and the 1 Hz pipeline.

CubeStar thesis, section 5.3.6 and figure 5.8: while the FPGA stores a new picture, the processor
works on the previous one; then the picture is transferred, and a software reset ends the iteration.
"""

from cubestack.firmware_model.costs import Meter
from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.commands import Commands
from cubestack.firmware_model.cubestar.host_link import HostLink
from cubestack.firmware_model.cubestar.phases import Phases
from cubestack.firmware_model.cubestar.processing import Processing
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.cubestar.telemetry import Telemetry
from cubestack.firmware_model.hardware import Hardware, ReadTimer, Reset, Routine
from cubestack.firmware_model.interface.cubestar_codes import ResetCause
from cubestack.firmware_model.star_catalogue import StarCatalogue

__all__ = ["ITERATION_MS", "CubeStarProgram"]

ITERATION_MS = 1000


class CubeStarProgram:
    """One life of the program, from reset to reset.

    Attributes:
        link: the satellite's interface; its methods are the UART and I2C interrupts.
        supply: supply monitor; its ``overcurrent`` is the comparators' interrupt.
    """

    def __init__(self, hardware: Hardware, meter: Meter, catalogue: StarCatalogue) -> None:
        """Reset: set up RAM from the retention registers and flash."""
        self._hardware = hardware
        self._state = State(hardware)
        self._phases = Phases(self._state.retained)
        self.supply = SupplyMonitor(hardware, self._state)
        self._capture = ImageCapture(hardware, self._state, self._phases, meter)
        self._processing = Processing(meter, self._state, self._capture, self._phases, catalogue)
        self._commands = Commands(
            hardware, meter, self._state, self._capture, self._processing, self.supply
        )
        telemetry = Telemetry(
            hardware,
            meter,
            self._state,
            self._capture,
            self._processing,
            self.supply,
            self._commands,
            lambda: bool(self.link.queue),
        )
        self.link = HostLink(hardware, meter, self._state, telemetry.values)
        if hardware.reset_cause == ResetCause.WATCHDOG:
            self._state.retained.watchdog_resets += 1

    def main(self) -> Routine[None]:
        """Run until a reset."""
        if self._hardware.reset_cause != ResetCause.SYSTEM_REQUEST or not self._state.restored:
            yield from self._capture.sensor.power_up()
        while True:
            if self.supply.cut and (yield from self.supply.power_cycle()):
                yield from self._capture.sensor.power_up()
            if self.link.queue:
                yield from self._command()
            elif self._state.retained.looping:
                yield from self._iteration()
            else:
                yield from self._phases.idle(None)

    def _command(self) -> Routine[None]:
        cause = yield from self._commands.execute(self.link.next_command())
        if cause is not None:
            yield Reset(cause)

    def _iteration(self) -> Routine[None]:
        """One turn of the loop; it starts when the last one's second is over."""
        retained = self._state.retained
        yield from self._wait_until(retained.loop_due_ms)
        if not retained.looping:
            return
        started_us: int = yield ReadTimer()
        retained.loop_due_ms = started_us // 1000 + ITERATION_MS

        previous = self._processing.process() if retained.image_present else None
        yield from self._capture.get_image(meanwhile=previous)
        retained.iterations += 1

        now_us: int = yield ReadTimer()
        retained.loop_ms = (now_us - started_us) // 1000
        retained.longest_loop_ms = max(retained.longest_loop_ms, retained.loop_ms)
        if retained.loop_ms > ITERATION_MS:
            self._state.raise_flag("TimingError")
        yield from self._wait_until(retained.loop_due_ms)
        if retained.looping and not self.link.queue:
            self._state.retain()
            yield Reset(ResetCause.SYSTEM_REQUEST)

    def _wait_until(self, due_ms: int) -> Routine[None]:
        """Idle until uptime ``due_ms``, executing commands meanwhile."""
        while True:
            if self.link.queue:
                yield from self._command()
                if not self._state.retained.looping:
                    return
            elif self.supply.cut or not (yield from self._phases.idle(due_ms * 1000)):
                return
