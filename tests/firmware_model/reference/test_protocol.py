"""The reference firmware's tables and frames, compiled for the host, beside the Python codec."""

import ctypes
import shutil
import struct
import subprocess
from ctypes import CDLL, CFUNCTYPE, POINTER, Structure, byref, c_bool, c_double, c_uint8, c_uint16
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.node.link import longest_command
from cubestack.firmware_model.reference.tables import generate
from cubestack.host.export.c_header import c_header
from tests.together import together

SOURCES = Path(__file__).parents[3] / "firmware_model" / "reference"
LONGEST_PAYLOAD = longest_command(INTERFACE) + 1
NO_FLAG = 255
TYPES = {"bool1": 0, "u8": 1, "enum8": 1, "u16": 2, "i16": 3, "u32": 4, "f32": 5}
Violated = CFUNCTYPE(None, c_uint8)


class CField(Structure):
    _fields_ = [("bit", c_uint16), ("type", c_uint8), ("scale", c_double)]


class Decoder(Structure):
    _fields_ = [
        ("inside", c_bool),
        ("escaped", c_bool),
        ("length", ctypes.c_int),
        ("payload", c_uint8 * LONGEST_PAYLOAD),
    ]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> CDLL:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("there is no C compiler")
    folder = tmp_path_factory.mktemp("protocol")
    generate(folder)
    (folder / "cubestar.h").write_text(c_header(INTERFACE))
    sources = [SOURCES / "tables.c", SOURCES / "link" / "frames.c", folder / "cubestar_tables.c"]
    built = folder / "protocol.so"
    flags = ["-std=gnu11", "-O1", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-lm"]
    includes = [f"-I{folder}", f"-I{SOURCES}"]
    subprocess.run([compiler, *map(str, sources), *includes, *flags, "-o", str(built)], check=True)
    loaded = CDLL(str(built))
    loaded.put.argtypes = [POINTER(c_uint8), CField, c_double]
    loaded.telecommand_of.restype = loaded.telemetry_of.restype = POINTER(c_uint8)
    loaded.parameters_allowed.restype = c_bool
    return loaded


def _values(field: Field, rng: np.random.Generator) -> list[float]:
    low, high = (-1e9, 1e9) if field.type == "f32" else field.raw_range
    edges = [low, high, low - 0.5, high + 0.49, high + 0.5, 2.0 * high, -1.0, 0.5, 1.5, -0.5]
    values = [edge / field.scale for edge in edges] + [float("nan"), float("inf"), -float("inf")]
    return values + list(rng.uniform(low, high, 50) / field.scale)


def _packed(library: CDLL, field: Field, value: float) -> int:
    data = (c_uint8 * 128)()
    library.put(data, CField(field.bit_offset, TYPES[field.type], field.scale), value)
    return int.from_bytes(bytes(data), "little") >> field.bit_offset


@together("message", INTERFACE.telemetries, ids=lambda message: message.name)
def test_c_reference_packs_telemetry_like_the_python_codec(library: CDLL, message: Message) -> None:
    rng = np.random.default_rng(message.id)
    for field in message.fields:
        if field.type.startswith("bytes"):
            continue
        for value in _values(field, rng):
            wanted = field.encode(value, saturate=True)
            found = _packed(library, field, value)
            if field.type == "f32" and np.isnan(value):
                assert np.isnan(struct.unpack("<f", found.to_bytes(4, "little"))[0])
            else:
                assert found == wanted, f"{field.name}: {value!r}"


def _parameters(message: Message, rng: np.random.Generator) -> bytes:
    data = bytearray(rng.bytes(message.length))
    values = message.reset_values()
    for field in message.fields:
        if rng.random() < 0.6 and not field.type.startswith("bytes"):
            near: Any = values[field.name]
            if field.type == "f32":
                limits = [v for v in (*field.ends, 0.0, np.nan) if v is not None]
                bits = struct.pack("<f", rng.choice([near, *limits]))
            else:
                raw = round(float(near) * field.scale) + int(rng.integers(-3, 4))
                bits = (raw & (1 << field.bits) - 1).to_bytes(field.bits // 8, "little")
            data[field.bit_offset // 8 : field.bit_offset // 8 + len(bits)] = bits
    return bytes(data)


@together("message", INTERFACE.telecommands, ids=lambda message: message.name)
def test_c_reference_refuses_the_same_parameters_as_the_table(
    library: CDLL, message: Message
) -> None:
    flags = {field.flag: field.bit_offset for field in INTERFACE.telemetry("ErrorFlags").fields}
    command = library.telecommand_of(message.id)
    assert (command[0], command[1]) == (message.id, message.length)
    rng = np.random.default_rng(message.id)
    for _ in range(400 if message.fields else 1):
        data, raised = _parameters(message, rng), set[int]()
        violated = Violated(raised.add)
        allowed = library.parameters_allowed(command, data, violated)
        refusals = message.violations(message.unpack(data))
        assert allowed == (not refusals), data.hex()
        assert raised == {flags[flag] if flag else NO_FLAG for _, flag in refusals}, data.hex()


def test_c_reference_knows_the_same_message_ids(library: CDLL) -> None:
    for identifier in range(256):
        message = INTERFACE.find(identifier)
        look_up = library.telemetry_of if identifier & 0x80 else library.telecommand_of
        found = look_up(identifier)
        assert bool(found) == (message is not None)
        if message is not None:
            assert (found[0], found[1]) == (message.id, message.length)


@together("seed", range(20))
def test_c_decoder_decodes_arbitrary_bytes_like_the_python_decoder(
    library: CDLL, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    stream = rng.choice([0x1F, 0x1F, 0x7F, 0xFF, 0x00, 0x42], 3000).astype(np.uint8)
    if seed % 2:  # long frames as well
        stream[rng.integers(0, 3000, 2950)] = 0x42
    here, there = Decoder(), FrameDecoder(longest_command(INTERFACE) + 1)
    numbers = {
        None: 0,
        FrameEvent.FRAME: 1,
        FrameEvent.TOO_LONG: 1,
        FrameEvent.INCOMPLETE: 2,
        FrameEvent.PROTOCOL_ERROR: 3,
    }
    for at, byte in enumerate(stream.tolist()):
        wanted = there.feed(byte)
        assert library.frame_feed(byref(here), byte) == numbers[wanted], f"byte {at}"
        if numbers[wanted] == 1:
            assert bytes(here.payload[: here.length]) == there.payload
        assert bool(library.frame_unfinished(byref(here))) == there.unfinished
        if rng.random() < 0.003:
            assert bool(library.frame_reset(byref(here))) == there.reset()


@pytest.mark.parametrize("length", [0, 1, 16, 128])
def test_frames_are_encoded_as_the_codec_encodes_them(library: CDLL, length: int) -> None:
    rng = np.random.default_rng(length)
    for _ in range(50):
        payload = rng.choice([0x1F, 0x7F, 0xFF, 0x55], length).astype(np.uint8).tobytes()
        frame = (c_uint8 * (2 * length + 4))()
        count = library.frame_encode(frame, payload, length)
        assert bytes(frame[:count]) == encode_frame(payload)
