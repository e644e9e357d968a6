"""Memory budget of the PIC18F45K20 on CubeSense: size and place of every buffer.

CubeSense thesis, appendix A.7 (1536 bytes of RAM, 32 kB of flash) and section 6.2 (pages of 256
bytes). Sizes are derived from the constants that the program uses. Distortion tables are in flash;
the text leaves that open, but beside the node's messages RAM has no room even for their 227 bytes.
Program code is not modelled, so flash must leave room for it. The program never searches for the
Earth and the Sun at the same time, so their buffers share memory.
"""

from cubestack.firmware_model.cubesense.download import CHUNK_BYTES
from cubestack.firmware_model.cubesense.links.bench import LETTERS
from cubestack.firmware_model.cubesense.links.registers import READ_AHEAD_BYTES
from cubestack.firmware_model.cubesense.vision.distortion import TABLE_ENTRIES, Projection
from cubestack.firmware_model.cubesense.vision.edges import MAX_EDGES
from cubestack.firmware_model.cubesense.vision.sun_centroid import window_bytes
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import FRAME_BYTES, MASK_AREAS, Camera
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION_TERMS, TELECOMMANDS
from cubestack.firmware_model.mcu.memory import Buffer, Memory, used
from cubestack.firmware_model.node.commands import QUEUE_DEPTH

__all__ = ["CAPACITY", "Buffer", "Memory", "budget", "report", "used"]

INT, FLOAT = 2, 4

STACK_BYTES = 256  #: software stack, one page: assumed, the default of C18
TASK_BYTES = 32  #: state of links and main loop between two bytes or two steps: assumed

#: Size of each memory in bytes.
CAPACITY = {Memory.RAM: 1536, Memory.FLASH: 32 * 1024}

_WINDOW = "Sun window"


def budget(switches: CubeSenseSwitches = DEFAULT_SWITCHES) -> tuple[Buffer, ...]:
    """Every buffer of the program, while it runs with ``switches``."""
    checked, cone = switches.limb == "robust", switches.distortion == "stereographic"
    places = {
        "normal equations, their inverse, right side": (9 + (9 if checked or cone else 6) + 3)
        * FLOAT
    }
    if switches.sun == "all-pixels":
        places["sums of the window"] = 2 * FLOAT + INT
    else:
        places["sums of the window's columns and of a row"] = (FULL_SIZE.window + 1) * (FLOAT + INT)
    inside, place = sorted(places, key=places.__getitem__)
    longest = 1 + max(message.length for message in TELECOMMANDS)
    answers = (message.length for message in INTERFACE.telemetries if message.name != "ImageFrame")
    ram = {
        _WINDOW: window_bytes(),
        place: places[place],
        "samples of the row above": len(FULL_SIZE.scan_columns),
        "edges": MAX_EDGES * 2 * INT,
        "telecommands, waiting and being received": (QUEUE_DEPTH + 1) * longest,
        "image frame": FRAME_BYTES,
        "answer being sent, except an image frame": max(answers),
        "image bytes read ahead for the image register": READ_AHEAD_BYTES,
        "image bytes and letters of the bench protocol": 2 * CHUNK_BYTES + LETTERS,
        "masks": len(Camera) * MASK_AREAS * 4 * INT,
        "results, settings, counters, flags": _state_bytes(),
        "state of links and main loop": TASK_BYTES,
        "software stack": STACK_BYTES,
    }
    if checked:
        ram["sides of the edges, and which are lit or used"] = MAX_EDGES
        ram["start of a bright run: line, position, edges so far"] = 2 + INT
    shared = {
        "scanned pixels": (FULL_SIZE.scan_step, _WINDOW),
        **({"edges, undistorted": (MAX_EDGES * 2 * INT, _WINDOW)} if checked else {}),
        inside: (places[inside], place),
    }
    flash = {  # for every setting of the switches, because telecommands change them
        "distortion tables of the reset values": TABLE_ENTRIES * (1 + INT * len(Projection)),
        "distortion tables of other coefficients": TABLE_ENTRIES * INT * len(Camera),
        "distortion coefficients": len(Camera) * DISTORTION_TERMS * FLOAT,
    }
    return (
        *(Buffer(name, Memory.RAM, size) for name, size in ram.items()),
        *(Buffer(name, Memory.RAM, size, inside) for name, (size, inside) in shared.items()),
        *(Buffer(name, Memory.FLASH, size) for name, size in flash.items()),
    )


def _state_bytes() -> int:
    """Bytes of state in telemetry, boresights, the cameras' written settings, and switches."""
    shown = ["CommunicationStatus", "TcmdProcessed", "Configuration", "Power"]
    for number in (camera + 1 for camera in Camera):
        shown += [f"Result{number}", f"Details{number}", f"PhaseTimes{number}", f"Quality{number}"]
    settings = INTERFACE.telemetry("Configuration").length
    boresights = sum(INTERFACE.telecommand(f"Boresight{camera + 1}").length for camera in Camera)
    switches = sum(not one.hardware for one in CubeSenseSwitches.declared().values())
    return (
        sum(INTERFACE.telemetry(name).length for name in shown) + settings + boresights + switches
    )


def report(buffers: tuple[Buffer, ...]) -> str:
    """A budget as a Markdown table, one row per buffer, with sums."""
    rows = ["| Memory | Buffer | Bytes |", "|---|---|---:|"]
    for memory, total in used(buffers).items():
        rows += [
            f"| {memory.value} | {buffer.name} | "
            + (f"({buffer.size}, in: {buffer.inside})" if buffer.inside else f"{buffer.size}")
            + " |"
            for buffer in buffers
            if buffer.memory is memory
        ]
        rows.append(f"| {memory.value} | **all, of {CAPACITY[memory]}** | **{total}** |")
    return "\n".join(rows)
