"""Every fault there is, declared once."""

from dataclasses import dataclass

from cubestack.emulator.faults.declaration import Fault, FaultError, Site, choice, number, place

_BOTH = ("both", "to-device", "to-host")
_PART = "part of the {} that it hits"
_X = "column as sent, from 0"
_Y = "line as sent, from 0"


@dataclass(frozen=True)
class UartDrop(Fault, kind="uart-drop", site=Site.UART):
    """A byte on the serial line is lost."""

    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    direction: str = choice("both", "way of the bytes", *_BOTH)


@dataclass(frozen=True)
class UartCorrupt(Fault, kind="uart-corrupt", site=Site.UART):
    """A byte on the serial line arrives with bits turned over."""

    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    direction: str = choice("both", "way of the bytes", *_BOTH)
    mask: int = number(0, "bits to turn over; 0 draws one for each byte", "", 0, 255)


@dataclass(frozen=True)
class UartDelay(Fault, kind="uart-delay", site=Site.UART):
    """A byte on the serial line is held up, and those behind it with it."""

    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    direction: str = choice("both", "way of the bytes", *_BOTH)
    delay_ms: float = number(50.0, "how long", "ms", 0, 10_000)


@dataclass(frozen=True)
class I2cNack(Fault, kind="i2c-nack", site=Site.I2C):
    """An address, or a byte that the host writes, gets no acknowledge; the target misses it."""

    rate: float = number(1.0, _PART.format("addresses or bytes"), "", 0, 1)
    on: str = choice("address", "what is not acknowledged", "address", "byte")


@dataclass(frozen=True)
class I2cStretch(Fault, kind="i2c-stretch", site=Site.I2C):
    """The clock is held low after a byte; for over 1 s the host gives up."""

    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    stretch_us: float = number(500.0, "how long", "us", 0, 10_000_000)


@dataclass(frozen=True)
class I2cStuck(Fault, kind="i2c-stuck", site=Site.I2C):
    """A line of the I2C bus is held low."""

    line: str = choice("SDA", "which one", "SDA", "SCL")


@dataclass(frozen=True)
class AckLate(Fault, kind="ack-late", site=Site.ACKNOWLEDGE):
    """The processor sees the rise of the acknowledge too late."""

    delay_us: float = number(1_000.0, "how late", "us", 0, 10_000_000)


@dataclass(frozen=True)
class AckLost(Fault, kind="ack-lost", site=Site.ACKNOWLEDGE):
    """The processor never sees the acknowledge rise."""


@dataclass(frozen=True)
class AckStuck(Fault, kind="ack-stuck", site=Site.ACKNOWLEDGE):
    """The acknowledge has one level for the processor, whatever the FPGA says."""

    level: int = number(1, "its level", "", 0, 1)


@dataclass(frozen=True)
class ControlGlitch(Fault, kind="control-glitch", site=Site.CONTROL, momentary=True):
    """A control pin of the FPGA has the other level for a moment."""

    width_ns: float = number(200.0, "how long", "ns", 1, 1_000_000)


@dataclass(frozen=True)
class ClockLost(Fault, kind="clock-lost", site=Site.CAMERA):
    """One pulse of the pixel clock in a line is missing, so a pixel is."""

    rate: float = number(1.0, _PART.format("frames"), "", 0, 1)
    row: int | None = place(_Y, 2047)
    column: int | None = place(_X, 2047)


@dataclass(frozen=True)
class ClockExtra(Fault, kind="clock-extra", site=Site.CAMERA):
    """One pulse of the pixel clock in a line comes twice, so a pixel does."""

    rate: float = number(1.0, _PART.format("frames"), "", 0, 1)
    row: int | None = place(_Y, 2047)
    column: int | None = place(_X, 2047)


@dataclass(frozen=True)
class LineMissing(Fault, kind="line-missing", site=Site.CAMERA):
    """The line pin (HSync, HREF) stays low for one line of a frame."""

    rate: float = number(1.0, _PART.format("frames"), "", 0, 1)
    row: int | None = place(_Y, 2047)


@dataclass(frozen=True)
class PixelHot(Fault, kind="pixel-hot", site=Site.CAMERA):
    """A pixel is bright without light."""

    x: int | None = place(_X, 2047)
    y: int | None = place(_Y, 2047)
    level: int = number(255, "its value", "DN", 1, 255)


@dataclass(frozen=True)
class PixelDead(Fault, kind="pixel-dead", site=Site.CAMERA):
    """A pixel is dark in any light."""

    x: int | None = place(_X, 2047)
    y: int | None = place(_Y, 2047)


@dataclass(frozen=True)
class ColumnDefect(Fault, kind="column-defect", site=Site.CAMERA):
    """A column of pixels has one value."""

    x: int | None = place(_X, 2047)
    level: int = number(255, "the value", "DN", 0, 255)


@dataclass(frozen=True)
class Blooming(Fault, kind="blooming", site=Site.CAMERA):
    """Bright pixels spill over along their column."""

    threshold: int = number(250, "least value of a pixel that spills", "DN", 1, 255)
    length: int = number(20, "how far, to either side", "px", 1, 2047)


@dataclass(frozen=True)
class CameraDead(Fault, kind="camera-dead", site=Site.CAMERA):
    """A camera stops as without supply; back again, its registers have their reset values."""


@dataclass(frozen=True)
class MemoryFlip(Fault, kind="memory-flip", site=Site.MEMORY, momentary=True):
    """One bit of a memory turns over."""

    address: int | None = place("byte", 2**25)
    bit: int | None = place("bit of it", 7)


@dataclass(frozen=True)
class MemoryUpsets(Fault, kind="memory-upsets", site=Site.MEMORY):
    """Bits of a memory turn over at random places and times."""

    rate: float = number(1e-6, "mean rate of each bit", "/s", 1e-15, 1)


@dataclass(frozen=True)
class MemoryStuck(Fault, kind="memory-stuck", site=Site.MEMORY):
    """One bit of a memory always reads the same."""

    address: int | None = place("byte", 2**25)
    bit: int | None = place("bit of it", 7)
    level: int = number(1, "what it reads", "", 0, 1)


@dataclass(frozen=True)
class RegisterFlip(Fault, kind="register-flip", site=Site.FPGA, momentary=True):
    """One bit of a register in the FPGA turns over; in reset it comes back at once."""

    register: str | None = choice(None, "path of the register in the design")
    bit: int | None = place("bit of it", 31)


@dataclass(frozen=True)
class RegisterUpsets(Fault, kind="register-upsets", site=Site.FPGA):
    """Bits of the FPGA's registers turn over at random places and times."""

    rate: float = number(1e-2, "mean rate of each bit", "/s", 1e-15, 1e3)


@dataclass(frozen=True)
class LatchUp(Fault, kind="latch-up", site=Site.SUPPLY, momentary=True):
    """A supply channel draws too much until it is switched off."""

    extra_ma: float = number(300.0, "current on top", "mA", 1, 5_000)
    lasting: bool = choice(False, "whether it comes back with each switching on", "false", "true")


@dataclass(frozen=True)
class ProcessorReset(Fault, kind="processor-reset", site=Site.PROCESSOR, momentary=True):
    """The processor starts anew, for the reason that is its target."""


@dataclass(frozen=True)
class CoreFlip(Fault, kind="core-flip", site=Site.CORE, momentary=True):
    """One bit of a register of the processor's core turns over."""

    register: str | None = choice(None, "name of the register, as debuggers have it")
    bit: int | None = place("bit of it", 31)


@dataclass(frozen=True)
class CoreUpsets(Fault, kind="core-upsets", site=Site.CORE):
    """Bits of the core's registers turn over at random places and times."""

    rate: float = number(1e-2, "mean rate of each bit", "/s", 1e-15, 1e3)


#: Every fault by its kind, in the order of their declarations.
FAULTS: dict[str, type[Fault]] = {fault.kind: fault for fault in Fault.__subclasses__()}


def make_fault(kind: str, /, **parameters: object) -> Fault:
    """A fault of that kind; FaultError for an unknown kind, or for a parameter that is wrong."""
    if kind not in FAULTS:
        raise FaultError(f"no fault {kind!r}; there are {', '.join(FAULTS)}")
    known = FAULTS[kind].parameters()
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
        defaults = fault()
        texts = [
            f"`{name}`: {parameter.text}, {parameter.range.replace('any', 'any text')} "
            f"({_default(getattr(defaults, name))})"
            for name, parameter in fault.parameters().items()
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
