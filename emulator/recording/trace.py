"""Writes a run as a VCD file: lines, buses, FPGA pins and firmware on one time axis.

- Serial lines: levels of both directions as an oscilloscope would show them, and each byte at its
  start.
- I2C: whether the bus is busy, the address, and a text for each transfer.
- FPGA: every input from the microcontroller and every output, after each event of the simulation.
  Changes within one event are missing: the pulses of a transfer loop, and memory cycles while an
  image is stored.
- Firmware: whether the processor is awake, and variables as a debugger would read them. For
  compiled firmware, also the current function and exception, at the exact times.

Times are rounded down to 1 ns.
"""

import heapq
from collections.abc import Callable, Iterable, Mapping
from itertools import count
from typing import IO, Any, Protocol, cast

from vcd import VCDWriter

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage, I2cTap
from cubestack.emulator.bus.uart import Uart, UartTap
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.formats.recording import TextSink

PS_PER_NS = 1000

Probes = Callable[[], Mapping[str, int | str]]
"""Returns values by name, always the same names: texts, and numbers of at most 32 bits."""


class History(Protocol):
    """Variables that are recorded with the times of their changes."""

    @property
    def variables(self) -> Mapping[str, int | None]:
        """Width in bits by name; None for a text."""

    def take(self) -> Iterable[tuple[int, str, int | str]]:
        """Changes since the last call, ordered by time: time in ps, variable and value."""


class VcdTrace:
    """Writes a VCD file while the simulation runs; attach it before the start."""

    def __init__(
        self,
        stream: TextSink,
        device: str,
        kernel: Kernel,
        uarts: Mapping[str, Uart],
        engine: RtlEngine | None = None,
        probes: Probes = dict,
        history: History | None = None,
    ) -> None:
        """Trace ``uarts``, the values of ``probes`` and the changes in ``history``, by name.

        The caller closes ``stream``.
        """
        self._kernel = kernel
        self._engine = engine
        self._device = device
        file = cast("IO[str]", stream)  # of which the writer only calls write and flush
        self._writer = VCDWriter(file, timescale="1 ns", version="cubestack", date="")
        self._probes = probes
        self._history = history
        self._variables: dict[str, Any] = {}
        self._last: dict[str, int | str] = {}
        self._pending: list[tuple[int, int, str, int | str]] = []
        self._numbers = count()
        self._written_ns = 0
        self._lag_ps = 2 * max((uart.byte_ps for uart in uarts.values()), default=0)
        for name, value in probes().items():
            self.declare(f"firmware.{name}", None if isinstance(value, str) else 32)
        for name, bits in (history.variables if history is not None else {}).items():
            self.declare(f"firmware.{name}", bits)
        self._pins: tuple[str, ...] = ()
        if engine is not None:
            engine.use_strides(False)  # the trace shows each clock
            self._pins = (*engine.wiring.mcu_pins, *engine.wiring.output_pins)
            for pin in self._pins:
                self.declare(f"fpga.{pin}", engine.wiring.widths[pin], engine.get_pin(pin))
        self._taps: list[_LineTap | _BusTap] = [
            _LineTap(self, port, uart) for port, uart in uarts.items()
        ]
        self._sample()
        # SimPy has no hook for observers but the method itself.
        self._step = kernel.step
        vars(kernel)["step"] = self._observed_step

    def listen(self, bus: I2cBus, port: str = "i2c") -> None:
        self._taps.append(_BusTap(self, bus, port))

    def put(self, time_ps: int, name: str, value: int | str) -> None:
        """Set a declared variable from ``time_ps`` on."""
        heapq.heappush(self._pending, (time_ps // PS_PER_NS, next(self._numbers), name, value))

    def declare(self, name: str, bits: int | None, init: int | str = 0) -> None:
        """Declare a variable, its scopes separated by dots; ``bits`` is None for a text."""
        *scopes, last = name.split(".")
        scope = ".".join([self._device, *scopes])
        if bits is None:
            variable = self._writer.register_var(scope, last, "string", init=str(init or ""))
        else:
            variable = self._writer.register_var(scope, last, "wire", size=bits, init=init)
        self._variables[name] = variable

    def close(self, until_ps: int | None = None) -> None:
        """Write pending changes before ``until_ps`` and detach; the stream stays open."""
        vars(self._kernel).pop("step", None)
        for tap in self._taps:
            tap.close()
        self._flush(until_ps)
        self._writer.close(max(self._written_ns, self._kernel.now // PS_PER_NS))

    def _observed_step(self) -> None:
        self._step()
        if not self._kernel.paused:  # halts by a debugger do not appear
            self._sample()
            self._flush(self._kernel.now - self._lag_ps)

    def _sample(self) -> None:
        if self._history is not None:
            for time_ps, name, value in self._history.take():
                self._change(time_ps, f"firmware.{name}", value)
        for name, value in self._probes().items():
            self._change(self._kernel.now, f"firmware.{name}", value)
        if self._engine is not None:
            # The FPGA may be ahead of the kernel; its levels have its own time.
            time_ps = max(self._engine.now_ps, 0)
            for pin in self._pins:
                self._change(time_ps, f"fpga.{pin}", self._engine.get_pin(pin))

    def _change(self, time_ps: int, name: str, value: int | str) -> None:
        if self._last.get(name) != value:
            self._last[name] = value
            self.put(time_ps, name, value)

    def _flush(self, until_ps: int | None) -> None:
        """Write changes that no earlier one can follow any more."""
        pending = self._pending
        while pending and (until_ps is None or pending[0][0] * PS_PER_NS < until_ps):
            time_ns, _, name, value = heapq.heappop(pending)
            self._written_ns = max(self._written_ns, time_ns)
            self._writer.change(self._variables[name], self._written_ns, value)


class _LineTap(UartTap):
    """A serial line in the trace."""

    def __init__(self, trace: VcdTrace, port: str, uart: Uart) -> None:
        self._trace = trace
        self._port = port
        self._form = uart.form
        for direction in ("rx", "tx"):
            trace.declare(f"{port}.{direction}", 1, 1)
            trace.declare(f"{port}.{direction}_byte", 8)
        trace.declare(f"{port}.framing_errors", 32)
        self._uart = uart
        uart.taps.append(self)

    def close(self) -> None:
        self._uart.taps.remove(self)

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        for index, byte in enumerate(data):
            self._draw("tx", byte, first_ps + (index - 1) * byte_ps)

    def device_heard(self, byte: int, start_ps: int) -> None:
        self._draw("rx", byte, start_ps)

    def framing_error(self, time_ps: int) -> None:
        self._trace.put(time_ps, f"{self._port}.framing_errors", self._uart.framing_errors)

    def _draw(self, direction: str, byte: int, start_ps: int) -> None:
        name, last = f"{self._port}.{direction}", 1
        self._trace.put(start_ps, f"{name}_byte", byte)
        for bit, level in enumerate([*self._form.levels(byte), 1]):
            if level != last:
                self._trace.put(start_ps + self._form.after_ps(bit), name, level)
                last = level


class _BusTap(I2cTap):
    """An I2C bus in the trace."""

    def __init__(self, trace: VcdTrace, bus: I2cBus, port: str) -> None:
        self._trace = trace
        self._bus = bus
        self._port = port
        trace.declare(f"{port}.busy", 1)
        trace.declare(f"{port}.address", 8)
        trace.declare(f"{port}.transfer", None, "")
        bus.taps.append(self)

    def transfer_began(self, messages: list[I2cMessage]) -> None:
        self._put("busy", 1)
        self._put("address", messages[0].address & 0xFF if messages else 0)

    def transfer_ended(
        self, messages: list[I2cMessage], began_ps: int, error: BaseException | None
    ) -> None:
        self._put("busy", 0)
        parts = (f"{'WR'[m.reading]}{m.address:02x}:{bytes(m.data).hex()}" for m in messages)
        self._put("transfer", "refused" if error else ",".join(parts))

    def close(self) -> None:
        self._bus.taps.remove(self)

    def _put(self, name: str, value: int | str) -> None:
        self._trace.put(self._bus.kernel.now, f"{self._port}.{name}", value)
