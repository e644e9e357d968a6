"""Every fault there is, declared once."""

from dataclasses import dataclass
from typing import Any

from cubestack.emulator.faults.declaration import Fault, FaultError, Site
from cubestack.firmware_model.values import choice, flag, number, text, whole


def _part(of: str) -> Any:
    return number(1.0, f"part of the {of} that it hits", 0, 1)


def _drawn(meaning: str, high: int) -> Any:
    return whole(None, meaning, 0, high)


_DIRECTION = choice("both", "direction of the bytes", ("both", "to-device", "to-host"))
_X = _drawn("column as sent, from 0", 2047)
_Y = _drawn("line as sent, from 0", 2047)
_ADDRESS = _drawn("byte", 2**25)
_UPSETS = number(1e-2, "mean rate of each bit", 1e-15, 1e3, "/s")


@dataclass(frozen=True)
class UartDrop(Fault, kind="uart-drop", site=Site.UART):
    """A byte on the serial line is lost."""

    rate: float = _part("bytes")
    direction: str = _DIRECTION


@dataclass(frozen=True)
class UartCorrupt(Fault, kind="uart-corrupt", site=Site.UART):
    """A byte on the serial line arrives with bits turned over."""

    rate: float = _part("bytes")
    direction: str = _DIRECTION
    mask: int = whole(0, "bits to turn over; 0 draws one for each byte", 0, 255)


@dataclass(frozen=True)
class UartDelay(Fault, kind="uart-delay", site=Site.UART):
    """A byte on the serial line is held up, and those behind it with it."""

    rate: float = _part("bytes")
    direction: str = _DIRECTION
    delay_ms: float = number(50.0, "how long", 0, 10_000)


@dataclass(frozen=True)
class I2cNack(Fault, kind="i2c-nack", site=Site.I2C):
    """An address, or a byte that the host writes, gets no acknowledge; the target misses it."""

    rate: float = _part("addresses or bytes")
    on: str = choice("address", "what is not acknowledged", ("address", "byte"))


@dataclass(frozen=True)
class I2cStretch(Fault, kind="i2c-stretch", site=Site.I2C):
    """The clock is held low after a byte; for over 1 s the host gives up."""

    rate: float = _part("bytes")
    stretch_us: float = number(500.0, "how long", 0, 10_000_000)


@dataclass(frozen=True)
class I2cStuck(Fault, kind="i2c-stuck", site=Site.I2C):
    """A line of the I2C bus is held low."""

    line: str = choice("SDA", "which one", ("SDA", "SCL"))


@dataclass(frozen=True)
class AckLate(Fault, kind="ack-late", site=Site.ACKNOWLEDGE):
    """The processor sees the rise of the acknowledge too late."""

    delay_us: float = number(1_000.0, "how late", 0, 10_000_000)


@dataclass(frozen=True)
class AckLost(Fault, kind="ack-lost", site=Site.ACKNOWLEDGE):
    """The processor never sees the acknowledge rise."""


@dataclass(frozen=True)
class AckStuck(Fault, kind="ack-stuck", site=Site.ACKNOWLEDGE):
    """The acknowledge has one level for the processor, whatever the FPGA says."""

    level: int = whole(1, "its level", 0, 1)


@dataclass(frozen=True)
class ControlGlitch(Fault, kind="control-glitch", site=Site.CONTROL, momentary=True):
    """A control pin of the FPGA has the other level for a moment."""

    width_ns: float = number(200.0, "how long", 1, 1_000_000)


@dataclass(frozen=True)
class ClockLost(Fault, kind="clock-lost", site=Site.CAMERA):
    """One pulse of the pixel clock in a line is missing, so a pixel is."""

    rate: float = _part("frames")
    row: int | None = _Y
    column: int | None = _X


@dataclass(frozen=True)
class ClockExtra(Fault, kind="clock-extra", site=Site.CAMERA):
    """One pulse of the pixel clock in a line comes twice, so a pixel does."""

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
    level: int = whole(255, "its value", 1, 255, "DN")


@dataclass(frozen=True)
class PixelDead(Fault, kind="pixel-dead", site=Site.CAMERA):
    """A pixel is dark in any light."""

    x: int | None = _X
    y: int | None = _Y


@dataclass(frozen=True)
class ColumnDefect(Fault, kind="column-defect", site=Site.CAMERA):
    """A column of pixels has one value."""

    x: int | None = _X
    level: int = whole(255, "the value", 0, 255, "DN")


@dataclass(frozen=True)
class Blooming(Fault, kind="blooming", site=Site.CAMERA):
    """Bright pixels spill over along their column."""

    threshold: int = whole(250, "least value of a pixel that spills", 1, 255, "DN")
    length: int = whole(20, "how far, to either side", 1, 2047, "px")


@dataclass(frozen=True)
class CameraDead(Fault, kind="camera-dead", site=Site.CAMERA):
    """A camera stops as without supply; back again, its registers have their reset values."""


@dataclass(frozen=True)
class MemoryFlip(Fault, kind="memory-flip", site=Site.MEMORY, momentary=True):
    """One bit of a memory turns over."""

    address: int | None = _ADDRESS
    bit: int | None = _drawn("bit of it", 7)


@dataclass(frozen=True)
class MemoryUpsets(Fault, kind="memory-upsets", site=Site.MEMORY):
    """Bits of a memory turn over at random places and times."""

    rate: float = number(1e-6, "mean rate of each bit", 1e-15, 1, "/s")


@dataclass(frozen=True)
class MemoryStuck(Fault, kind="memory-stuck", site=Site.MEMORY):
    """One bit of a memory always reads the same."""

    address: int | None = _ADDRESS
    bit: int | None = _drawn("bit of it", 7)
    level: int = whole(1, "what it reads", 0, 1)


@dataclass(frozen=True)
class RegisterFlip(Fault, kind="register-flip", site=Site.FPGA, momentary=True):
    """One bit of a register in the FPGA turns over; in reset it comes back at once."""

    register: str | None = text(None, "path of the register in the design")
    bit: int | None = _drawn("bit of it", 31)


@dataclass(frozen=True)
class RegisterUpsets(Fault, kind="register-upsets", site=Site.FPGA):
    """Bits of the FPGA's registers turn over at random places and times."""

    rate: float = _UPSETS


@dataclass(frozen=True)
class LatchUp(Fault, kind="latch-up", site=Site.SUPPLY, momentary=True):
    """A supply channel draws too much until it is switched off."""

    extra_ma: float = number(300.0, "current on top", 1, 5_000)
    lasting: bool = flag(False, "whether it comes back with each switching on")


@dataclass(frozen=True)
class ProcessorReset(Fault, kind="processor-reset", site=Site.PROCESSOR, momentary=True):
    """The processor starts anew, for the reason that is its target."""


@dataclass(frozen=True)
class CoreFlip(Fault, kind="core-flip", site=Site.CORE, momentary=True):
    """One bit of a register of the processor's core turns over."""

    register: str | None = text(None, "name of the register, as debuggers have it")
    bit: int | None = _drawn("bit of it", 31)


@dataclass(frozen=True)
class CoreUpsets(Fault, kind="core-upsets", site=Site.CORE):
    """Bits of the core's registers turn over at random places and times."""

    rate: float = _UPSETS


#: Every fault by its kind, in the order of their declarations.
FAULTS: dict[str, type[Fault]] = {fault.kind: fault for fault in Fault.__subclasses__()}


def make_fault(kind: str, /, **parameters: object) -> Fault:
    """A fault of that kind; FaultError for an unknown kind, or for a parameter that is wrong."""
    if kind not in FAULTS:
        raise FaultError(f"no fault {kind!r}; there are {', '.join(FAULTS)}")
    known = FAULTS[kind].declared()
    for name in parameters:
        if name not in known:
            has = f"has {', '.join(known)}" if known else "has no parameters"
            raise FaultError(f"{kind}: no parameter {name!r}; it {has}")
    return FAULTS[kind](**parameters)


def markdown_table() -> str:
    """Every fault with its parameters, as a Markdown table: docs/fault-kinds.md holds it."""
    head = ("kind", "hits a", "what it does", "parameters, with range and default")
    rows = [head, ("---",) * len(head)]
    for kind, fault in FAULTS.items():
        texts = [
            f"`{name}`: {one.meaning}, {one.allowed} ({_default(one.default)})"
            for name, one in fault.declared().items()
        ]
        rows.append((f"`{kind}`", fault.site.value, fault.effect(), "; ".join(texts) or "none"))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _default(value: object) -> str:
    match value:
        case None:
            return "drawn"
        case bool():
            return str(value).lower()
        case float():
            return f"{value:g}"
    return str(value)
