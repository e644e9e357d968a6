"""Every fault there is, declared once."""

from dataclasses import dataclass

from cubestack.emulator.faults.declaration import (
    Fault,
    FaultError,
    Site,
    choice,
    flag,
    number,
    place,
)

_BOTH = ("both", "to-device", "to-host")
_PART = "part of the {} that it hits"
_X = "column as sent, from 0"
_Y = "line as sent, from 0"


@dataclass(frozen=True)
class UartDrop(Fault):
    """A byte on the serial line is lost."""

    kind, site = "uart-drop", Site.UART
    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    direction: str = choice("both", "way of the bytes", *_BOTH)


@dataclass(frozen=True)
class UartCorrupt(Fault):
    """A byte on the serial line arrives with bits turned over."""

    kind, site = "uart-corrupt", Site.UART
    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    direction: str = choice("both", "way of the bytes", *_BOTH)
    mask: int = number(0, "bits to turn over; 0 draws one for each byte", "", 0, 255)


@dataclass(frozen=True)
class UartDelay(Fault):
    """A byte on the serial line is held up, and those behind it with it."""

    kind, site = "uart-delay", Site.UART
    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    direction: str = choice("both", "way of the bytes", *_BOTH)
    delay_ms: float = number(50.0, "how long", "ms", 0, 10_000)


@dataclass(frozen=True)
class I2cNack(Fault):
    """An address, or a byte that the host writes, gets no acknowledge; the target misses it."""

    kind, site = "i2c-nack", Site.I2C
    rate: float = number(1.0, _PART.format("addresses or bytes"), "", 0, 1)
    on: str = choice("address", "what is not acknowledged", "address", "byte")


@dataclass(frozen=True)
class I2cStretch(Fault):
    """The clock is held low after a byte; for over 1 s the host gives up."""

    kind, site = "i2c-stretch", Site.I2C
    rate: float = number(1.0, _PART.format("bytes"), "", 0, 1)
    stretch_us: float = number(500.0, "how long", "us", 0, 10_000_000)


@dataclass(frozen=True)
class I2cStuck(Fault):
    """A line of the I2C bus is held low."""

    kind, site = "i2c-stuck", Site.I2C
    line: str = choice("SDA", "which one", "SDA", "SCL")


@dataclass(frozen=True)
class AckLate(Fault):
    """The processor sees the rise of the acknowledge too late."""

    kind, site = "ack-late", Site.ACKNOWLEDGE
    delay_us: float = number(1_000.0, "how late", "us", 0, 10_000_000)


@dataclass(frozen=True)
class AckLost(Fault):
    """The processor never sees the acknowledge rise."""

    kind, site = "ack-lost", Site.ACKNOWLEDGE


@dataclass(frozen=True)
class AckStuck(Fault):
    """The acknowledge has one level for the processor, whatever the FPGA says."""

    kind, site = "ack-stuck", Site.ACKNOWLEDGE
    level: int = number(1, "its level", "", 0, 1)


@dataclass(frozen=True)
class ControlGlitch(Fault):
    """A control pin of the FPGA has the other level for a moment."""

    kind, site, momentary = "control-glitch", Site.CONTROL, True
    width_ns: float = number(200.0, "how long", "ns", 1, 1_000_000)


@dataclass(frozen=True)
class ClockLost(Fault):
    """One pulse of the pixel clock in a line is missing, so a pixel is."""

    kind, site = "clock-lost", Site.CAMERA
    rate: float = number(1.0, _PART.format("frames"), "", 0, 1)
    row: int | None = place(_Y, 2047)
    column: int | None = place(_X, 2047)


@dataclass(frozen=True)
class ClockExtra(Fault):
    """One pulse of the pixel clock in a line comes twice, so a pixel does."""

    kind, site = "clock-extra", Site.CAMERA
    rate: float = number(1.0, _PART.format("frames"), "", 0, 1)
    row: int | None = place(_Y, 2047)
    column: int | None = place(_X, 2047)


@dataclass(frozen=True)
class LineMissing(Fault):
    """The line pin (HSync, HREF) stays low for one line of a frame."""

    kind, site = "line-missing", Site.CAMERA
    rate: float = number(1.0, _PART.format("frames"), "", 0, 1)
    row: int | None = place(_Y, 2047)


@dataclass(frozen=True)
class PixelHot(Fault):
    """A pixel is bright without light."""

    kind, site = "pixel-hot", Site.CAMERA
    x: int | None = place(_X, 2047)
    y: int | None = place(_Y, 2047)
    level: int = number(255, "its value", "DN", 1, 255)


@dataclass(frozen=True)
class PixelDead(Fault):
    """A pixel is dark in any light."""

    kind, site = "pixel-dead", Site.CAMERA
    x: int | None = place(_X, 2047)
    y: int | None = place(_Y, 2047)


@dataclass(frozen=True)
class ColumnDefect(Fault):
    """A column of pixels has one value."""

    kind, site = "column-defect", Site.CAMERA
    x: int | None = place(_X, 2047)
    level: int = number(255, "the value", "DN", 0, 255)


@dataclass(frozen=True)
class Blooming(Fault):
    """Bright pixels spill over along their column."""

    kind, site = "blooming", Site.CAMERA
    threshold: int = number(250, "least value of a pixel that spills", "DN", 1, 255)
    length: int = number(20, "how far, to either side", "px", 1, 2047)


@dataclass(frozen=True)
class CameraDead(Fault):
    """A camera stops as without supply; back again, its registers have their reset values."""

    kind, site = "camera-dead", Site.CAMERA


@dataclass(frozen=True)
class MemoryFlip(Fault):
    """One bit of a memory turns over."""

    kind, site, momentary = "memory-flip", Site.MEMORY, True
    address: int | None = place("byte", 2**25)
    bit: int | None = place("bit of it", 7)


@dataclass(frozen=True)
class MemoryUpsets(Fault):
    """Bits of a memory turn over at random places and times."""

    kind, site = "memory-upsets", Site.MEMORY
    rate: float = number(1e-6, "mean rate of each bit", "/s", 1e-15, 1)


@dataclass(frozen=True)
class MemoryStuck(Fault):
    """One bit of a memory always reads the same."""

    kind, site = "memory-stuck", Site.MEMORY
    address: int | None = place("byte", 2**25)
    bit: int | None = place("bit of it", 7)
    level: int = number(1, "what it reads", "", 0, 1)


@dataclass(frozen=True)
class RegisterFlip(Fault):
    """One bit of a register in the FPGA turns over; in reset it comes back at once."""

    kind, site, momentary = "register-flip", Site.FPGA, True
    register: str | None = choice(None, "path of the register in the design")
    bit: int | None = place("bit of it", 31)


@dataclass(frozen=True)
class RegisterUpsets(Fault):
    """Bits of the FPGA's registers turn over at random places and times."""

    kind, site = "register-upsets", Site.FPGA
    rate: float = number(1e-2, "mean rate of each bit", "/s", 1e-15, 1e3)


@dataclass(frozen=True)
class LatchUp(Fault):
    """A supply channel draws too much until it is switched off."""

    kind, site, momentary = "latch-up", Site.SUPPLY, True
    extra_ma: float = number(300.0, "current on top", "mA", 1, 5_000)
    lasting: bool = flag(False, "whether it comes back with each switching on")


#: Every fault by its kind, in the order of their declarations.
FAULTS: dict[str, type[Fault]] = {fault.kind: fault for fault in Fault.__subclasses__()}


def make_fault(kind: str, **parameters: object) -> Fault:
    """A fault of that kind; FaultError for an unknown kind, or for a parameter that is wrong."""
    if kind not in FAULTS:
        raise FaultError(f"no fault {kind!r}; there are {', '.join(FAULTS)}")
    known = FAULTS[kind].parameters()
    for name in parameters:
        if name not in known:
            has = f"has {', '.join(known)}" if known else "has no parameters"
            raise FaultError(f"{kind}: no parameter {name!r}; it {has}")
    return FAULTS[kind](**parameters)
