"""A user's design as a component with a device's pins."""

from collections.abc import Iterable
from pathlib import Path

from amaranth.hdl import Module

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.blocks.pinned import PinnedComponent, RtlilComponent, Stride, connect_ports
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.user.classes import make_component
from cubestack.hdl.user.ports import UNCONNECTED
from cubestack.hdl.user.source import ClassName, GatewareError, parse_source
from cubestack.hdl.user.stored import converted
from cubestack.hdl.user.verilog import Parameters


class Gateware(RtlilComponent):
    """A user's design.

    Attributes:
        notices: what a user must know of it, one line each.
        is_verilog: only the compiled engine runs it.
    """

    def __init__(
        self,
        pins: Iterable[Pin],
        title: str,
        *,
        rtlil: str = "",
        component: PinnedComponent | None = None,
        notices: tuple[str, ...] = (),
    ) -> None:
        super().__init__(pins)
        self.notices = notices
        self._strides: tuple[Stride, ...] = ()
        self._title, self._rtlil, self._component = title, rtlil, component

    @property
    def title(self) -> str:
        return self._title

    @property
    def is_verilog(self) -> bool:
        return self._component is None

    @property
    def strides(self) -> tuple[Stride, ...]:
        return self._strides

    def use_strides(self, proved: Iterable[Stride]) -> None:
        """Declare strides, which must be proved of this design."""
        self._strides = tuple(proved)

    def rtlil(self, name: str) -> str:
        """Its RTLIL, with the module ``name`` as the top."""
        if self._component is not None:
            return rtlil_text(self._component, name)
        return self._rtlil.replace("module \\top\n", f"module \\{name}\n", 1)

    def elaborate(self, platform: object) -> Module:
        """For Amaranth's simulator; raises GatewareError for a design in Verilog."""
        if self._component is None:
            raise GatewareError(
                f"{self.title} is Verilog, which the engine 'python' does not run; "
                "use the compiled one"
            )
        m = Module()
        m.submodules.design = self._component
        ports = [(port.name, port.name) for pin in self.pins for port in pin.ports]
        connect_ports(m, self._component, self, ports)
        return m


def load_gateware(
    text: str,
    pins: Iterable[Pin],
    parameters: Parameters | None = None,
    folder: Path | None = None,
    *,
    cache: Path | None = None,
) -> Gateware:
    """The design that ``text`` names, with the device's ``pins``.

    Args:
        text: FILE[:TOP], FILE,FILE...[:TOP], FOLDER[:TOP], LIST.f[:TOP] or MODULE:CLASS.
        pins: the pin table, with the widths of the device; a further output leads nowhere.
        parameters: parameters of the top module, or keyword arguments of the class.
        folder: where relative paths start, and where a class's module may lie; by default the
            current folder.
        cache: folder where converted designs are kept; None for none.

    Raises:
        GatewareError: the design can not be used; one line for each reason.
        ToolMissingError: Verilog, and no whole Yosys.
    """
    pins, parameters = tuple(pins), dict(parameters or {})
    source = parse_source(text, folder)
    if isinstance(source, ClassName):
        component = make_component(source, pins, parameters, folder)
        known = {port.name for pin in pins for port in pin.ports}
        further = tuple(
            Pin(name, "output", UNCONNECTED, len(getattr(component, name)))
            for name in component.signature.members
            if name not in known
        )
        notices = _unconnected(source.name, further)
        return Gateware((*pins, *further), source.name, component=component, notices=notices)
    found = converted(source, pins, parameters, cache)
    notices = found.notices + _unconnected(source.name, found.pins[len(pins) :])
    return Gateware(found.pins, source.name, rtlil=found.rtlil, notices=notices)


def _unconnected(title: str, further: Iterable[Pin]) -> tuple[str, ...]:
    return tuple(f"{title}: pin {pin} {UNCONNECTED}; traces show it" for pin in further)
