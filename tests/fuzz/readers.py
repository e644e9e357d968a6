"""Every reader of files and messages, each with documents of the kind that it reads."""

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.faults.plan import load_plan
from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.ports.com_port import ComPort, Settings
from cubestack.emulator.rtl.capture.read import read_capture
from cubestack.emulator.scene.orbit_file import load_orbit
from cubestack.emulator.scene.picture import load_picture
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.formats.untrusted import confined, parse_json
from cubestack.firmware_model.interface.codec.frames import FrameDecoder
from cubestack.firmware_model.reference.image import IMAGE
from cubestack.host.calibration.camera import load_camera
from cubestack.host.devices.registry import device
from cubestack.host.ground.control_api import CALLS
from cubestack.host.recording.setups import read_document
from cubestack.host.recording.transcript import transcript
from cubestack.host.studies.campaign.folder import PLAN, ROWS, Folder
from cubestack.host.studies.powerfail.scenario import Scenario
from cubestack.host.studies.star_log import load_sights
from tests.emulator.iss.gdb.fake_target import Talk

FILE = "document"
SCENARIO = Path(__file__).parents[2] / "examples" / "power_cuts" / "settings.toml"
SKY = 'kind = "sky"\nra_deg = 83.8\ndec_deg = -5.4\n'


class Reader(NamedTuple):
    """What reads a document in a folder, and valid documents."""

    read: Callable[[Path], object]
    documents: tuple[bytes, ...]


def of_bytes(read: Callable[[bytes], object]) -> Callable[[Path], object]:
    return lambda folder: read((folder / FILE).read_bytes())


def scene(name: str) -> Callable[[Path], object]:
    owner = device(name)

    def read(folder: Path) -> None:
        with confined(folder):
            owner.load_scene(folder / FILE)
            read_document(folder / FILE)

    return read


def recording(folder: Path) -> None:
    found = load_recording(folder / FILE)
    transcript(found, device("cubesense").interface)
    _ = found.until(10**9), found.end_ps, found.sent("uart", "host")


def rows(folder: Path) -> None:
    (folder / PLAN).write_text('{"version": "1", "plan": {"device": "x", "frames": 1}}')
    found = object.__new__(Folder)
    found.path = folder
    (folder / FILE).replace(folder / ROWS)
    for _ in found.rows():
        pass


def firmware(folder: Path) -> None:
    image = load_image(folder / FILE, base=None)
    symbols = Symbols(image.elf)
    _ = symbols.rows, symbols.frames, symbols.describe(0x400)


def calls(content: bytes) -> None:
    body = parse_json(content, "the body")
    for call in CALLS:
        try:
            call.values(body)
        except ValueError:
            continue


def debugger(content: bytes) -> None:
    Talk().send(content)


def telnet(content: bytes) -> None:
    form = LineFormat(57_600)
    settings = Settings(
        form_of=lambda: form,
        change=lambda _: None,
        drop_received=lambda: None,
        drop_written=lambda: None,
        send_break=lambda: None,
        line_state=lambda: 0,
        plugged_in=lambda: True,
    )
    try:
        list(ComPort(settings, lambda _: None, lambda: None).filter(content))
    except TypeError as error:  # by pyserial; the port catches it
        raise ValueError(str(error)) from None


def bus(content: bytes) -> None:
    received = bytearray(content)
    while (packet := i2c_socket.take_packet(received, 1 << 16)) is not None:
        try:
            _, _, body = i2c_socket.split_request(packet)
        except ValueError:
            continue
        for unpack in (
            i2c_socket.unpack_hello,
            i2c_socket.unpack_ioctl,
            i2c_socket.unpack_rdwr,
            i2c_socket.unpack_smbus,
            i2c_socket.unpack_read,
            i2c_socket.unpack_open,
        ):
            try:
                unpack(body)
            except ValueError:
                continue


def frames(content: bytes) -> None:
    decoder = FrameDecoder(4096)
    for byte in content:
        decoder.feed(byte)


def _lines(*objects: dict[str, Any]) -> bytes:
    return "".join(json.dumps(one) + "\n" for one in objects).encode()


def _picture(kind: str, mode: str) -> bytes:
    stream = io.BytesIO()
    pixels = np.arange(64, dtype=np.uint8).reshape(8, 8)
    Image.fromarray(pixels).convert(mode).save(stream, kind)
    return stream.getvalue()


def _fits(bits: int) -> bytes:
    sizes = {"BITPIX": bits, "NAXIS": 2, "NAXIS1": 8, "NAXIS2": 8, "BZERO": 32768}
    cards = ["SIMPLE  =                    T"]
    cards += [f"{name:<8}= {value:>20}" for name, value in sizes.items()]
    head = "".join(card.ljust(80) for card in (*cards, "END")).ljust(2880).encode()
    return head + bytes(64 * abs(bits) // 8).ljust(2880, b"\0")


def _hex(data: bytes, address: int) -> bytes:
    records = [b"\x00" * 0]
    for at in range(0, len(data), 16):
        part = data[at : at + 16]
        record = bytes([len(part)]) + struct.pack(">H", address + at) + b"\0" + part
        records.append(record + bytes([-sum(record) & 0xFF]))
    text = "".join(f":{one.hex()}\n" for one in records[1:]) + ":00000001FF\n"
    return text.encode()


HEADER = {
    "recording": 1,
    "device": "cubesense",
    "lines": {"uart": 57_600},
    "setup": {
        "version": "0.2.0",
        "seed": 1,
        "scene": {"name": "/etc/passwd", "text": SKY, "files": {"a.png": "AAAA"}},
        "faults": {"name": "x", "text": "seed = 1"},
        "options": {"profile": "published", "firmware": "/dev/zero"},
    },
}
EVENTS = (
    {"ps": 0, "port": "uart", "from": "host", "data": "1f7f801fff", "byte_ps": 173_611_111},
    {"ps": 10, "port": "uart", "from": "device", "data": "1f7f0501021fff", "byte_ps": 173_611_111},
    {"ps": 20, "port": "uart", "error": "framing"},
    {"ps": 30, "port": "i2c", "end_ps": 40, "messages": [{"address": 27, "write": "80"}]},
    {"ps": 50, "control": ["scene", "x"], "text": SKY, "files": {}},
)
ROW = {
    **{"block": 0, "row": 0, "seed": 1, "after": 0, "swept": {"a": 1.5}, "outcome": "right"},
    **{"reason": "", "result": {"x": [1, 2.5, None, "y"]}},
}
VECTORS = struct.pack("<2I", 0x2000_8000, 0x401).ljust(0x404, b"\xff")

READERS: dict[str, Reader] = {
    "scene of cubestar": Reader(
        scene("cubestar"),
        (
            SKY.encode(),
            f"{SKY}[optics]\nk1 = 0.1\n[hazards.moon]\ndirection = [9, 1]\n".encode(),
            f"{SKY}[[poses]]\nra_deg = 1.0\ndec_deg = 2.0\nat_s = 1.0\n".encode(),
            b'kind = "picture"\nfile = "/etc/passwd"\ncrop = [1, 2]\n',
        ),
    ),
    "scene of cubesense": Reader(
        scene("cubesense"), (b'kind = "earth-sun"\naltitude_km = 500.0\n',)
    ),
    "scene of aramis": Reader(scene("aramis"), (SKY.encode(),)),
    "orbit": Reader(
        lambda folder: load_orbit(folder / FILE),
        (
            b"start = 2026-11-24T12:00:00Z\n[circular]\naltitude_km = 600.0\n"
            b'inclination_deg = 97.8\n[attitude]\nkind = "nadir"\n[mountings.star]\n'
            b"boresight = [0, -1, 0]\nright = [1, 0, 0]\n",
            b"start = 2026-11-24T12:00:00Z\ntle = ["
            b'"1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927",\n'
            b'"2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537"]\n',
        ),
    ),
    "plan of faults": Reader(
        lambda folder: load_plan(folder / FILE),
        (b'seed = 7\n[[fault]]\nkind = "uart-corrupt"\nat_s = 2.0\nfor_s = 0.5\nrate = 0.01\n',),
    ),
    "scenario": Reader(lambda folder: Scenario.read(folder / FILE), (SCENARIO.read_bytes(),)),
    "recording": Reader(recording, (_lines(HEADER, *EVENTS),)),
    "rows": Reader(rows, (_lines(ROW, ROW),)),
    "camera": Reader(
        lambda folder: load_camera(folder / FILE),
        (b'{"camera": {"f_px": 1000.0, "cx_px": 512, "cy_px": 256.5, "k1": 0.1}}',),
    ),
    "stars": Reader(
        lambda folder: load_sights(folder / FILE),
        (b"[[32349, 1.5, 2], [91262, 30, 40.25]]\n\n[]\n",),
    ),
    "firmware": Reader(
        firmware, (_hex(VECTORS, 0), VECTORS, IMAGE.read_bytes()[:20_000], IMAGE.read_bytes())
    ),
    "picture": Reader(
        lambda folder: load_picture(folder / FILE),
        (_picture("PNG", "L"), _picture("JPEG", "RGB"), _picture("TIFF", "L")),
    ),
    "FITS": Reader(
        lambda folder: load_picture(folder / FILE),
        (_fits(16), _fits(-64), _fits(8)[:2880] + _fits(8)),
    ),
    "capture": Reader(
        lambda folder: read_capture(folder / FILE),
        (
            b"$timescale 1ns $end\n$var wire 1 ! ACK $end\n$enddefinitions $end\n#0\n0!\n#5\n1!\n",
            b"Time [ns],ACK,ENABLE\n0,0,1\n10,1,1\n20,1,0\n",
        ),
    ),
    "control port": Reader(
        of_bytes(calls),
        (
            b'{"to_s": 1.5}',
            b'{"words": ["scene", "x"], "text": "a", "files": {}}',
            b'{"events": 1}',
        ),
    ),
    "gdb": Reader(
        of_bytes(debugger),
        tuple(
            b"$%b#%02x" % (body, sum(body) & 0xFF)
            for body in (
                *(b"qSupported", b"m20000000,10", b"M20000000,2:abcd", b"Z0,100,2", b"vCont;c"),
                *(b"X20000000,1:}x", b"vFlashWrite:0:abc", b"qXfer:memory-map:read::0,40", b"g"),
            )
        ),
    ),
    "RFC 2217": Reader(
        of_bytes(telnet),
        (bytes((255, 251, 44, 255, 250, 44, 1, 0, 0, 0xE1, 0, 255, 240)) + b"abc\xff\xff",),
    ),
    "I2C socket": Reader(
        of_bytes(bus),
        (i2c_socket.packet(i2c_socket.request(1, i2c_socket.Call.READ, i2c_socket.pack_read(4))),),
    ),
    "node frames": Reader(of_bytes(frames), (bytes.fromhex("1f7f801fff1f7f0501021fff"),)),
}
