"""Declarations of all faults."""

from dataclasses import dataclass
from typing import Any

from cubestack.emulator.faults.declaration import Fault, FaultError, Site
from cubestack.firmware_model.values import choice, flag, number, text, whole


def _part(of: str) -> Any:
    return number(1.0, f"share of the {of} affected", 0, 1)


def _drawn(meaning: str, high: int) -> Any:
    return whole(None, meaning, 0, high)


_DIRECTION = choice("both", "direction of the bytes", ("both", "to-device", "to-host"))
_X = _drawn("column as sent, counted from 0", 2047)
_Y = _drawn("line as sent, counted from 0", 2047)
_ADDRESS = _drawn("byte", 2**25)
_UPSETS = number(1e-2, "mean rate per bit", 1e-15, 1e3, "/s")


@dataclass(frozen=True)
class UartDrop(Fault, kind="uart-drop", site=Site.UART):
    """A byte on the serial line is lost."""

    rate: float = _part("bytes")
    direction: str = _DIRECTION


@dataclass(frozen=True)
class UartCorrupt(Fault, kind="uart-corrupt", site=Site.UART):
    """A byte on the serial line arrives with inverted bits."""

    rate: float = _part("bytes")
    direction: str = _DIRECTION
    mask: int = whole(0, "bits to invert; 0 draws one per byte", 0, 255)


@dataclass(frozen=True)
class UartDelay(Fault, kind="uart-delay", site=Site.UART):
    """A byte on the serial line is delayed, and so are the following ones."""

    rate: float = _part("bytes")
    direction: str = _DIRECTION
    delay_ms: float = number(50.0, "delay", 0, 10_000)


@dataclass(frozen=True)
class I2cNack(Fault, kind="i2c-nack", site=Site.I2C):
    """An address, or a byte from the host, is not acknowledged, and the target misses it."""

    rate: float = _part("addresses or bytes")
    on: str = choice("address", "what is not acknowledged", ("address", "byte"))


@dataclass(frozen=True)
class I2cStretch(Fault, kind="i2c-stretch", site=Site.I2C):
    """The clock is held low after a byte; the host aborts the transfer after 1 s."""

    rate: float = _part("bytes")
    stretch_us: float = number(500.0, "duration", 0, 10_000_000)


@dataclass(frozen=True)
class I2cStuck(Fault, kind="i2c-stuck", site=Site.I2C):
    """A line of the I2C bus is held low."""

    line: str = choice("SDA", "the line", ("SDA", "SCL"))


@dataclass(frozen=True)
class AckLate(Fault, kind="ack-late", site=Site.ACKNOWLEDGE):
    """The processor sees the acknowledge rise with a delay."""

    delay_us: float = number(1_000.0, "delay", 0, 10_000_000)


@dataclass(frozen=True)
class AckLost(Fault, kind="ack-lost", site=Site.ACKNOWLEDGE):
    """The processor never sees the acknowledge rise."""


@dataclass(frozen=True)
class AckStuck(Fault, kind="ack-stuck", site=Site.ACKNOWLEDGE):
    """The processor always sees the same level of the acknowledge."""

    level: int = whole(1, "the level", 0, 1)


@dataclass(frozen=True)
class ControlGlitch(Fault, kind="control-glitch", site=Site.CONTROL, momentary=True):
    """A control pin of the FPGA has the opposite level for a short time."""

    width_ns: float = number(200.0, "duration", 1, 1_000_000)


@dataclass(frozen=True)
class ClockLost(Fault, kind="clock-lost", site=Site.CAMERA):
    """One pulse of the pixel clock in a line is missing, and with it a pixel."""

    rate: float = _part("frames")
    row: int | None = _Y
    column: int | None = _X


@dataclass(frozen=True)
class ClockExtra(Fault, kind="clock-extra", site=Site.CAMERA):
    """One pulse of the pixel clock in a line is doubled, and with it a pixel."""

    rate: float = _part("frames")
    row: int | None = _Y
    column: int | None = _X


@dataclass(frozen=True)
class LineMissing(Fault, kind="line-missing", site=Site.CAMERA):
    """The line pin (HSync, HREF) stays low for one line of a frame."""

    rate: float = _part("frames")
    row: int | None = _Y


@dataclass(frozen=True)
class PixelHot(Fault, kind="pixel-hot", site=Site.CAMERA):
    """A pixel is bright without light."""

    x: int | None = _X
    y: int | None = _Y
    level: int = whole(255, "its grey value", 1, 255, "DN")


@dataclass(frozen=True)
class PixelDead(Fault, kind="pixel-dead", site=Site.CAMERA):
    """A pixel is dark in any light."""

    x: int | None = _X
    y: int | None = _Y


@dataclass(frozen=True)
class ColumnDefect(Fault, kind="column-defect", site=Site.CAMERA):
    """All pixels of a column have the same value."""

    x: int | None = _X
    level: int = whole(255, "the grey value", 0, 255, "DN")


@dataclass(frozen=True)
class Blooming(Fault, kind="blooming", site=Site.CAMERA):
    """Bright pixels saturate their neighbours in the column."""

    threshold: int = whole(250, "lowest value of a pixel that does so", 1, 255, "DN")
    length: int = whole(20, "range to either side", 1, 2047, "px")


@dataclass(frozen=True)
class CameraDead(Fault, kind="camera-dead", site=Site.CAMERA):
    """A camera stops as without supply; afterwards its registers have their reset values."""


@dataclass(frozen=True)
class MemoryFlip(Fault, kind="memory-flip", site=Site.MEMORY, momentary=True):
    """One bit of a memory is inverted."""

    address: int | None = _ADDRESS
    bit: int | None = _drawn("bit of the byte", 7)


@dataclass(frozen=True)
class MemoryUpsets(Fault, kind="memory-upsets", site=Site.MEMORY):
    """Bits of a memory are inverted at random places and times."""

    rate: float = number(1e-6, "mean rate per bit", 1e-15, 1, "/s")


@dataclass(frozen=True)
class MemoryStuck(Fault, kind="memory-stuck", site=Site.MEMORY):
    """One bit of a memory always has the same value when read."""

    address: int | None = _ADDRESS
    bit: int | None = _drawn("bit of the byte", 7)
    level: int = whole(1, "the value", 0, 1)


@dataclass(frozen=True)
class RegisterFlip(Fault, kind="register-flip", site=Site.FPGA, momentary=True):
    """One bit of a register in the FPGA is inverted; in reset it returns at once."""

    register: str | None = text(None, "path of the register in the design")
    bit: int | None = _drawn("bit of the register", 31)


@dataclass(frozen=True)
class RegisterUpsets(Fault, kind="register-upsets", site=Site.FPGA):
    """Bits of the FPGA's registers are inverted at random places and times."""

    rate: float = _UPSETS


@dataclass(frozen=True)
class FpgaDead(Fault, kind="fpga-dead", site=Site.WHOLE_FPGA):
    """One of several FPGAs does nothing, whatever the processor commands; it drives no pin."""


@dataclass(frozen=True)
class LatchUp(Fault, kind="latch-up", site=Site.SUPPLY, momentary=True):
    """A supply channel draws a higher current until it is switched off."""

    extra_ma: float = number(300.0, "additional current", 1, 5_000)
    lasting: bool = flag(False, "whether it returns each time the channel is switched on")


@dataclass(frozen=True)
class ProcessorReset(Fault, kind="processor-reset", site=Site.PROCESSOR, momentary=True):
    """The processor is reset; the target is the cause."""


@dataclass(frozen=True)
class CoreFlip(Fault, kind="core-flip", site=Site.CORE, momentary=True):
    """One bit of a register of the processor's core is inverted."""

    register: str | None = text(None, "name of the register, as in a debugger")
    bit: int | None = _drawn("bit of the register", 31)


@dataclass(frozen=True)
class CoreUpsets(Fault, kind="core-upsets", site=Site.CORE):
    """Bits of the core's registers are inverted at random places and times."""

    rate: float = _UPSETS


#: Every fault by its kind, in the order of their declarations.
FAULTS: dict[str, type[Fault]] = {fault.kind: fault for fault in Fault.__subclasses__()}


def make_fault(kind: str, /, **parameters: object) -> Fault:
    """A fault of that kind; FaultError for an unknown kind or an invalid parameter."""
    if kind not in FAULTS:
        raise FaultError(f"unknown fault {kind!r}; known: {', '.join(FAULTS)}")
    known = FAULTS[kind].declared()
    for name in parameters:
        if name not in known:
            names = ", ".join(known) or "none"
            raise FaultError(f"{kind}: unknown parameter {name!r}; known: {names}")
    return FAULTS[kind](**parameters)


def markdown_table() -> str:
    """All faults with their parameters, as the Markdown table of docs/reference/fault-kinds.md."""
    head = ("kind", "target", "effect", "parameters, with range and default")
    rows = [head, ("---",) * len(head)]
    for kind, fault in FAULTS.items():
        texts = [
            f"`{name}`: {one.meaning}, {one.limits or one.wanted} ({_default(one.default)})"
            for name, one in fault.declared().items()
        ]
        rows.append((f"`{kind}`", fault.site.value, fault.effect(), "; ".join(texts) or "none"))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _default(value: object) -> str:
    match value:
        case None:
            return "random"
        case bool():
            return str(value).lower()
        case float():
            return f"{value:g}"
    return str(value)
