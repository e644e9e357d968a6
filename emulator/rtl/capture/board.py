"""A capture against the emulated FPGA, from the file to the results."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from cubestack.emulator.rtl.capture.capture import Capture, CaptureError
from cubestack.emulator.rtl.capture.compare import Comparison, Expected, compare, expected_outputs
from cubestack.emulator.rtl.capture.pins import Signal, signals
from cubestack.emulator.rtl.capture.replay import Emulated, Replay
from cubestack.emulator.rtl.capture.timing import Interval, Wave, captured_waves, intervals
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring

LEAST_SKEW_PS = 20_000
"""Default tolerance without a sampling rate: delays of pads and cables (assumed)."""


@dataclass(frozen=True)
class ComparedCapture:
    """A capture and the emulated FPGA with the same inputs."""

    wiring: Wiring
    capture: Capture
    captured: Mapping[str, Signal]
    emulated: Emulated
    outputs: Mapping[str, Expected]
    comparison: Comparison
    skew_ps: int

    @cached_property
    def waves(self) -> tuple[Mapping[str, Wave], Mapping[str, Wave]]:
        """Captured and emulated changes by pin; the inputs are the same."""
        found = captured_waves(self.captured)
        own = {
            name: Wave(self.emulated.times, output.levels) for name, output in self.outputs.items()
        }
        return found, {**found, **own}

    @cached_property
    def timing(self) -> dict[str, tuple[Interval | None, Interval | None]]:
        """Captured and emulated times by their names."""
        tables = [
            {one.name: one for one in intervals(self.wiring, waves, SramTiming())}
            for waves in self.waves
        ]
        return {
            name: (tables[0].get(name), tables[1].get(name)) for name in {**tables[0], **tables[1]}
        }

    @property
    def notes(self) -> list[str]:
        """What was not compared, and why; a line each."""
        lines = []
        if (since := self.emulated.since_ps) > self.emulated.times[0]:
            lines.append(
                f"compared from {since / 1000:.10g} ns on: before, the FPGA's state is not known"
            )
        for port, level in self.emulated.held.items():
            some = " in part" if port in self.captured else ""
            text = f"{port} was not captured{some}; held at {level:X}"
            if outputs := self._dependent(port):
                text += f"; {outputs} not compared where it depends on it (--hold {port}=LEVEL)"
            lines.append(text)
        sample = self.capture.sample_ps
        for camera in self.wiring.cameras:
            period = self.timing.get(f"{camera.clock} period", (None, None))[0]
            if sample and period is not None and period.found_ps.mean() < 4 * sample:
                lines.append(
                    f"{period.found_ps.mean() / sample:.3g} samples per period of {camera.clock}:"
                    " edges may be lost; 4 or more are needed"
                )
        return lines

    def _dependent(self, port: str) -> str:
        compared = {*self.outputs}
        names = []
        for name, bits in self.emulated.depends.get(port, {}).items():
            pin = name if name in compared else name.removesuffix("_I")
            if pin in compared and (hit := bits & self.captured[pin].bits):
                full = hit == (1 << self.wiring.widths[name]) - 1
                lines = [str(n) for n in range(hit.bit_length()) if hit >> n & 1]
                names.append(pin if full else f"{pin}[{','.join(lines)}]")
        return ", ".join(names)


def compare_capture(
    capture: Capture,
    wiring: Wiring,
    make: Callable[[], RtlEngine],
    *,
    mapping: Mapping[str, str] | None = None,
    held: Mapping[str, int] | None = None,
    skew_ps: int | None = None,
    powered_up: bool = False,
) -> ComparedCapture:
    """Compare ``capture`` with the engines that ``make`` creates for ``wiring``.

    Args:
        capture: changes at the pins.
        wiring: the design with its surroundings.
        make: creates an engine.
        mapping: pins by names or patterns of channels, see ``signals``.
        held: levels of inputs that were not captured.
        skew_ps: tolerance; None for two sampling periods, at least ``LEAST_SKEW_PS``.
        powered_up: the registers are those after power-up when the capture begins.

    Raises CaptureError if the capture does not fit the wiring.
    """
    captured = signals(capture, wiring.component.pins, mapping)
    held = {_input(wiring, pin): _level(wiring, pin, level) for pin, level in (held or {}).items()}
    if skew_ps is None:
        skew_ps = max(LEAST_SKEW_PS, round(2 * (capture.sample_ps or 0.0)))
    emulated = Replay(wiring, captured, held, make, powered_up=powered_up).run()
    outputs = expected_outputs(wiring, captured, emulated)
    if not outputs:
        names = ", ".join(pin for pin in wiring.component.pins if pin.direction != "input")
        raise CaptureError(f"no output of the FPGA was captured; the outputs are {names}")
    comparison = compare(captured, outputs, emulated.times, capture.end_ps, skew_ps)
    return ComparedCapture(wiring, capture, captured, emulated, outputs, comparison, skew_ps)


def _input(wiring: Wiring, name: str) -> str:
    """The input port of a pin, by its name in any case."""
    inputs = {port.upper(): port for port in (*wiring.camera_pins, *wiring.mcu_pins)}
    found = inputs.get(name.upper(), inputs.get(f"{name.upper()}_I"))
    if found is None:
        raise CaptureError(f"{name} is no input; the inputs are {', '.join(inputs.values())}")
    return found


def _level(wiring: Wiring, name: str, level: int) -> int:
    width = wiring.widths[_input(wiring, name)]
    if not 0 <= level < 1 << width:
        raise CaptureError(f"{name} has {width} bits, too few for {level:X}")
    return level
