import errno
import sys
from pathlib import Path

from cubestack.firmware_model.aramis import telemetry as aramis
from cubestack.firmware_model.cubesense import telemetry as cubesense
from cubestack.firmware_model.cubestar import telemetry as cubestar
from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.node.state import FIRMWARE_VERSION

from ...conftest import Run
from .conftest import LATCH, needs_tools

pytestmark = needs_tools

Session = tuple[tuple[str, int, str], ...]
"""Command, its exit status, and what it prints."""


def text(data: bytes) -> str:
    return " ".join(f"{byte:#04x}" for byte in data)


def flags(*names: str) -> str:
    """What telemetry ErrorFlags reads when these are up."""
    message = CUBESTAR.telemetry("ErrorFlags")
    return text(message.pack(**message.reset_values() | dict.fromkeys(names, True)))


def thresholds(detection: int, star: int) -> str:
    message = CUBESTAR.telemetry("DetectionThresholdValues")
    return text(message.pack(DarkThreshold=0, DetectionThreshold=detection, StarThreshold=star))


def grid(*addresses: int) -> str:
    """What i2cdetect prints when these acknowledge."""
    words = [f"{column:x}" for column in range(16)]
    for row in range(0, 0x80, 0x10):
        shown = range(max(row, 0x08), min(row + 0x10, 0x78))
        words += [f"{row:02x}:", *(f"{at:02x}" if at in addresses else "--" for at in shown)]
    return " ".join(words)


GAIN = REGISTERS["SUN_GAIN"]
ERRNO = "import smbus2\ntry: smbus2.SMBus(12).read_byte(26)\nexcept OSError as e: print(e.errno)"


CUBESTAR_IDENTITY, CUBESENSE_IDENTITY, ARAMIS_IDENTITY = (
    text(bytes([node_type, interface.version, *FIRMWARE_VERSION]))
    for interface, node_type in (
        (CUBESTAR, cubestar.NODE_TYPE),
        (CUBESENSE, cubesense.NODE_TYPE),
        (ARAMIS, aramis.NODE_TYPE),
    )
)
"""What telemetry Identification reads first; its clock follows."""

FLAGS = "i2ctransfer -y 7 w1@0x1a 0x82 r10"
SESSION: Session = (
    ("i2cdetect -y 7", 0, grid(0x1A)),
    ("i2cdetect -y -q 7", 0, grid(0x1A)),
    ("i2cdetect -y -r 7", 0, grid(0x1A)),
    ("i2cdetect -F 7 | grep -c yes", 0, "15"),
    ("i2cdetect -l | grep -c 'i2c-7.*cubestack'", 0, "1"),
    ("i2cset -y 7 0x1a 0x06", 0, ""),
    (FLAGS, 0, flags()),
    ("i2cget -y 7 0x1a 0x83", 0, "0x01"),
    ("i2cset -y 7 0x1a 0x15 0x1f1f w", 0, ""),
    ("i2cget -y 7 0x1a 0x83", 0, "0x01"),
    ("i2cget -y 7 0x1a 0x92 i 3", 0, thresholds(0x1F, 0x1F)),
    ("i2cset -y 7 0x1a 0x15 0x20 0x21 i", 0, ""),
    ("i2ctransfer -y 7 w1@0x1a 0x92 r3", 0, thresholds(0x20, 0x21)),
    ("i2cget -y 7 0x1a 0x92", 0, "0x00"),
    ("i2cget -y 7 0x1a 0x92 w", 0, "0x2000"),
    ("i2cget -y 7 0x1a 0x88 w", 0, "0x0000"),
    ("i2ctransfer -y 7 w1@0x1a 0x92 r6", 0, thresholds(0x20, 0x21) + " 0xff 0xff 0xff"),
    ("i2ctransfer -y 7 w1@0x1a 0x83 r1 w1 0x92 r3", 0, "0x01 " + thresholds(0x20, 0x21)),
    ("i2cget -y 7 0x1a 0x80 i 4", 0, CUBESTAR_IDENTITY),
    ("i2ctransfer -y 7 w1@0x1a 0x8f r128 | wc -w", 0, "128"),
    ("i2cget -y 7 0x30 0x83", 2, ""),
    ("i2cset -y 7 0x30 0x06", 1, ""),
    ("i2ctransfer -y 7 w1@0x30 0x83", 1, ""),
    ("i2cget -y 8 0x1a 0x83", 1, ""),
    ("i2cset -y 7 0x1a 0x07 0x01", 0, ""),
    (FLAGS, 0, flags("I2C_TCMD_TooFewParm")),
    ("i2cset -y 7 0x1a 0x06", 0, ""),
    ("i2ctransfer -y 7 r2@0x1a", 0, "0xff 0xff"),
    (FLAGS, 0, flags("I2C_WaitForIDReadRequestError")),
    ("i2cset -y 7 0x1a 0x63", 0, ""),
    ("i2cget -y 7 0x1a 0xfe", 0, "0xff"),
    (FLAGS, 0, flags("I2C_WaitForIDReadRequestError", "TcmdIDError", "TlmIDError")),
    ("i2ctransfer -y 7 w1@0x1a 0x80 r9000", 1, ""),
    ("i2cget -y 7 0x1a 0x92 s", 2, ""),  # its first byte, 0, is no length of a block
    ("i2cdump -y -r 0x92-0x92 7 0x1a b | grep -c '^90: *00'", 0, "1"),
    ("i2cget -y 7 0x1a 0x92 i 32", 0, thresholds(0x20, 0x21) + 29 * " 0xff"),
    ("i2cget -y 7 0x1a 0x92 i 33", 1, ""),
    (f"i2cset -y 7 0x1a 0x83 {32 * '1 '} i", 0, ""),  # what follows a telemetry ID is ignored
    (f"i2cset -y 7 0x1a 0x83 {33 * '1 '} i", 1, ""),
    ("i2ctransfer -y 7 w1@0x1a 0x92 r8192 | wc -w", 0, "8192"),
    ("i2ctransfer -y 7 w1@0x1a 0x92 r8193", 1, ""),
    ("i2ctransfer -y 7 r0@0x1a", 0, ""),
    ("i2cset -y 7 0x1a 0x92 c", 0, ""),
    ("i2cget -y 7 0x1a", 0, "0x00"),
    ("i2cget -y 7 0x1a 0x92 c", 0, "0x00"),
    ("i2cset -y -a 7 0x00 0x06", 1, ""),  # the general call: nobody listens
)

SHARED_SESSION: Session = (
    ("i2cdetect -y 12", 0, grid(0x1B, 0x1C, 0x1D, 0x2B)),
    ("i2cget -y 12 0x2b 0x80 i 4", 0, CUBESTAR_IDENTITY),
    ("i2cget -y 12 0x1b 0x80 i 4", 0, CUBESENSE_IDENTITY),
    ("i2cget -y 12 0x1d 0x80 i 4", 0, ARAMIS_IDENTITY),
    (
        "i2ctransfer -y 12 w1@0x2b 0x80 r4 w1@0x1b 0x80 r4 w1@0x1d 0x80 r4",
        0,
        f"{CUBESTAR_IDENTITY} {CUBESENSE_IDENTITY} {ARAMIS_IDENTITY}",
    ),
    (f"i2cset -y 12 0x1c {GAIN.address} 3", 0, ""),
    (f"i2cget -y 12 0x1c {GAIN.address}", 0, "0x03"),
    ("i2cget -y 12 0x1a 0x83", 2, ""),
    (f"{sys.executable} -c '{ERRNO}'", 0, str(int(errno.EREMOTEIO))),
)
"""Several devices on bus 12, one of them moved, and another error where none is."""


def check(run: Run, folder: Path, session: Session, *options: object) -> None:
    """Run ``session`` as one script, with one emulation."""
    script = folder / "session.sh"
    script.write_text(
        "set -o pipefail\n"
        + "".join(f"output=$({line} 2>/dev/null); echo $?: $output\n" for line, _, _ in session)
        + "exit 42\n"
    )
    outcome = run("bash", script, options=options)
    assert outcome.code == 42
    answers = outcome.out.splitlines()
    assert len(answers) == len(session)
    for (line, code, expected), answer in zip(session, answers, strict=True):
        assert (line, answer.strip()) == (line, f"{code}: {expected}".strip())


def test_i2c_tools_session_with_one_device(run: Run, tmp_path: Path) -> None:
    assert len(SESSION) > 30
    check(run, tmp_path, SESSION, "--pace", "fast")


def test_i2c_tools_session_with_several_devices(run: Run, tmp_path: Path) -> None:
    devices = [f"--device={name}" for name in ("cubestar", "cubesense", "aramis")]
    options = ("--bus", 12, "--hz", 400_000, "--nack-errno", "EREMOTEIO")
    move = ("--i2c-addr", "cubestar=0x2b")
    check(run, tmp_path, SHARED_SESSION, *options, *devices, *move)


def test_i2c_tools_reach_a_device_by_general_call(run: Run, served: Path, tmp_path: Path) -> None:
    session = (
        ("i2cdetect -y 7", 0, grid(0x1A, LATCH)),
        ("i2cset -y -a 7 0x00 0x5a", 0, ""),
        (f"i2cget -y 7 {LATCH}", 0, "0x5a"),
        ("i2cget -y -a 7 0x00", 2, ""),
        ("i2ctransfer -y -a 7 w1@0x00 0x5b r1@0x50", 0, "0x5b"),
    )
    check(run, tmp_path, session, "--attach", served)
