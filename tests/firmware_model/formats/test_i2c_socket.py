"""Messages on the socket of a bus, there and back, and the page that describes them."""

import contextlib
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.formats import i2c_socket as table
from cubestack.firmware_model.formats.linux_i2c import MessageFlag, RdwrMessage, SmbusCall

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "i2c-socket.md"
U8, U16, U32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))

messages = st.builds(RdwrMessage, U16, U16, U16, st.binary(max_size=40))


@given(st.lists(messages, max_size=5))
def test_rdwr_messages_round_trip(wanted):
    assert table.unpack_rdwr(table.pack_rdwr(wanted)) == wanted


@given(U8, U8, U32, st.none() | st.binary(min_size=34, max_size=34))
def test_smbus_calls_round_trip(direction, command, size, data):
    call = SmbusCall(direction, command, size, data)
    assert table.unpack_smbus(table.pack_smbus(call)) == call


@given(st.integers(0, 2**64 - 1), st.sampled_from(table.Call), st.binary())
def test_requests_round_trip(key, call, body):
    assert table.split_request(table.request(key, call, body)) == (key, call, body)


@given(st.integers(-(2**31), 2**31 - 1), st.binary())
def test_replies_round_trip(result, data):
    assert table.split_reply(table.reply(result, data)) == (result, data)


@given(st.binary(max_size=60))
def test_arbitrary_bytes_parse_to_a_request_or_raise_value_error(data):
    for read in (
        table.split_request,
        table.split_reply,
        table.unpack_ioctl,
        table.unpack_rdwr,
        table.unpack_smbus,
        table.unpack_read,
    ):
        with contextlib.suppress(ValueError):
            read(data)


def test_split_rdwr_assigns_reply_data_to_the_reading_messages():
    read, block = MessageFlag.READ, MessageFlag.RECEIVE_LENGTH
    wanted = [
        RdwrMessage(1, 0, 2, b"xx"),
        RdwrMessage(1, read, 3),
        RdwrMessage(1, read | block, 40, b"\2"),
        RdwrMessage(1, read, 1),
    ]
    data = b"abc" + b"\2defZ"
    assert table.split_rdwr(wanted, data) == [b"", b"abc", b"\2def", b"Z"]


def test_socket_path_is_in_a_folder_of_the_user(monkeypatch, tmp_path: Path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert table.socket_path(7) == tmp_path / "cubestack" / "i2c-7"
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "missing"))
    assert table.socket_path(7).name == "i2c-7"
    assert table.socket_path(7).parent.name.startswith("cubestack-")


@given(st.lists(st.tuples(st.text("abc-", min_size=1), st.integers(0, 0x7F))))
def test_targets_round_trip(targets):
    assert table.unpack_targets(table.pack_targets(targets)) == targets


def test_each_call_is_declared_once_and_each_field_has_its_type():
    assert [message.call for message in table.MESSAGES] == [*table.Call]
    sizes = {"u8": 1, "u16": 2, "u32": 4, "u64": 8, "34 bytes": 34}
    for message in table.MESSAGES:
        for part in (*message.fields, *table.RDWR_HEAD):
            assert struct.calcsize(f"={part.form}") == sizes[part.type]


def fields(parts) -> str:
    meanings = [f" ({part.meaning})" if part.meaning else "" for part in parts]
    words = zip(parts, meanings, strict=True)
    return ", ".join(f"{part.name} {part.type}{meaning}" for part, meaning in words)


def documented_messages() -> str:
    rows = [
        f"| {message.call} {message.call.name} | "
        f"{'; '.join(filter(None, [fields(message.fields), message.rest])) or 'nothing'} | "
        f"{message.result} | {message.data or 'none'} | {message.meaning} |"
        for message in table.MESSAGES
    ]
    head = "| call | fields; rest | result | data of the reply | meaning |"
    return "\n".join([head, "|-|-|-|-|-|", *rows])


@pytest.mark.parametrize(
    ("mark", "text"), [("MESSAGES", documented_messages()), ("RDWR_HEAD", fields(table.RDWR_HEAD))]
)
def test_page_is_generated_from_the_declaration(mark, text):
    page = PAGE.read_text(encoding="utf-8")
    source = f"<!-- generated from firmware_model/formats/i2c_socket.py {mark} -->\n"
    assert page.split(source)[1].split("\n<!-- end -->")[0] == text


def test_page_tells_version_and_limits():
    page = PAGE.read_text(encoding="utf-8")
    assert f"version {table.VERSION} of the protocol" in page
    assert f"{table.MAX_REQUEST_BYTES:,}".replace(",", " ") in page
