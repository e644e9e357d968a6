import json
import subprocess
import sys
from enum import IntEnum
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.host.export.python_module import python_module
from tests.host.export.frames import EACH, INTERFACES, frames

CUBESTAR = INTERFACES[0]


def module(interface: Interface) -> Any:
    made = ModuleType("exported")
    sys.modules["exported"] = made  # where dataclasses look their fields' types up
    exec(compile(python_module(interface), "exported", "exec"), made.__dict__)
    return made


def test_module_needs_only_the_standard_library(tmp_path: Path) -> None:
    for interface in INTERFACES:
        (tmp_path / "exported.py").write_text(python_module(interface))
        call = [sys.executable, "-I", "-S", "-W", "error", str(tmp_path / "exported.py")]
        assert subprocess.run(call, capture_output=True, check=True).stdout == b""


@EACH
def test_every_message_round_trips(interface: Interface) -> None:
    exported = module(interface)
    for message in interface.messages:
        prefix = "Tlm" if message.kind is MessageKind.TELEMETRY else "Tc"
        cls = getattr(exported, prefix + message.name)
        assert (message.id, message.length) == (cls.MESSAGE_ID, cls.MESSAGE_LENGTH)
        assert cls().encode() == message.pack(**message.reset_values())
        for data, values in frames(message, 20):
            decoded = cls.decode(data)
            assert vars(decoded) == values
            assert decoded.encode() == message.pack(**values)
        for name, value in values.items():
            of_value = int if isinstance(value, IntEnum) else type(value)
            assert cls.__annotations__[name] is of_value, name
        with pytest.raises(ValueError, match=f"{message.name} has {message.length} bytes, not"):
            cls.decode(bytes(message.length + 1))


@EACH
def test_frames_match_the_codec(interface: Interface) -> None:
    exported = module(interface)
    for message in interface.messages:
        for data, _ in frames(message, 3):
            payload = bytes([message.id, 0x1F]) + data
            assert exported.frame(payload) == encode_frame(payload)
            assert exported.payload(encode_frame(payload)) == payload
        if message.kind is MessageKind.TELEMETRY:
            request = getattr(exported, f"Tlm{message.name}").request()
        else:
            request = getattr(exported, f"Tc{message.name}")().frame()
            payload = exported.payload(request)
            assert payload[1:] == message.pack(**message.reset_values())
        assert exported.payload(request)[0] == message.id


def test_rejects_values_that_do_not_fit() -> None:
    exported = module(CUBESTAR)
    for value in (-1, 1 << 16):
        with pytest.raises(ValueError, match=rf"^exposure: {value} does not fit$"):
            exported.TcExposure(**{next(iter(exported.TcExposure.MESSAGE_FIELDS)): value}).encode()
    with pytest.raises(ValueError, match="not a frame: 00"):
        exported.payload(b"\0")


def test_exported_python_module_decodes_choices_to_names() -> None:
    exported = module(CUBESTAR)
    message = next(one for one in CUBESTAR.messages if any(f.choices for f in one.fields))
    named = next(one for one in message.fields if one.choices)
    prefix = "Tlm" if message.kind is MessageKind.TELEMETRY else "Tc"
    data = bytearray(message.length)
    for choice in named.choices or ():
        data[named.bit_offset // 8] = int(choice)
        decoded = getattr(exported, prefix + message.name).decode(bytes(data))
        assert getattr(decoded, named.name).name == choice.name
    assert json.dumps(int(getattr(decoded, named.name)))
