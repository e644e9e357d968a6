import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.devices.registry import device
from cubestack.host.errors import CommandRefusedError, NoAnswerError, TargetError
from cubestack.host.shell.language import Shell, ShellError
from cubestack.host.shell.registers import parse_value, parse_values
from cubestack.host.targets import Target

from ..conftest import LetterLine, Slave


@pytest.fixture
def shell(node, uart) -> Shell:
    client = NodeClient(uart, CUBESTAR)
    return Shell(Target("fake", CUBESTAR, client, uart, device=device("cubestar")))


def test_shell_reads_every_telemetry(shell):
    for message in CUBESTAR.telemetries:
        if message.supported:
            result = shell.execute(f"read {message.name}")
            assert [name for name, _ in result.rows] == [f.name for f in message.fields]
            assert list(result.data["values"]) == [f.name for f in message.fields]


def test_values_have_units(sense, sense_shell):
    sense.values["Power"]["Current3V3"] = 21.5
    assert sense_shell.execute("read power current3v3").rows == [("Current3V3", "21.5 mA")]


@pytest.mark.parametrize(
    "line", ["write setDetectionThresholds 0x10 StarThreshold=9", "write 21 0x10 9"]
)
def test_shell_writes_a_telecommand_by_name_or_number(node, shell, line):
    shell.execute(line)
    assert node.log == [("setDetectionThresholds", {"DetectionThreshold": 16, "StarThreshold": 9})]


def test_shell_accepts_message_numbers(shell, sense_shell):
    assert shell.execute("read 128").data == shell.execute("read Identification").data
    assert shell.execute("read 0x80 NodeType").rows == [("NodeType", "0")]
    assert shell.execute("watch 128 2 0").data["name"] == "Identification"
    sense_shell.execute("write @0x08 30")
    assert sense_shell.execute("read @8").data["values"] == {"NADIR_THRESHOLD": 30}


@pytest.fixture(params=[CUBESTAR, CUBESENSE, ARAMIS], ids=lambda i: i.name)
def silent_shell(request) -> Shell:
    interface = request.param
    registers = interface.registers and RegisterClient(Slave(), interface.registers)
    return Shell(Target("fake", interface, NodeClient(LetterLine(), interface), None, registers))


def test_list_shows_the_number_of_every_name(silent_shell):
    listed = silent_shell.execute("list")
    named = [(number, name) for number, name in listed.rows if number]
    assert [name for _, name in named] == listed.data["names"]
    assert len({number for number, _ in named}) == len(named)
    titles = [text for number, text in listed.rows if not number]
    assert titles == ["telemetry:", "telecommand:", "register:"][: len(titles)]
    for number, name in named:
        assert silent_shell.execute(f"list {number}").data["name"] == name


def test_shell_accepts_choices_by_name(sense, sense_shell):
    sense_shell.execute("write CaptureAndDetect nadir SRAM2")
    assert sense.log == [("CaptureAndDetect", {"Camera": 1, "Sram": 1})]


def test_client_errors_are_raised(sense_shell):
    with pytest.raises(InterfaceError, match="out of range"):
        sense_shell.execute("write SUN_AUTO 7")
    with pytest.raises(CommandRefusedError, match="BAD_PARAMETER"):
        sense_shell.execute("write Reset Target=9")


def test_dump_skips_telemetry_with_side_effects(sense, sense_shell):
    sense.execute("StartImageDownload", {"Sram": 0, "Size": 4})
    frames = sense_shell.execute("dump").data["telemetry"]
    assert set(frames) == {m.name for m in CUBESENSE.telemetries if not m.has_side_effect}
    assert sense.log == []
    assert "Result1ThenSram1" not in frames


def test_watch_command_repeats_the_reading(sense, sense_shell):
    rows = []
    sense_shell.on_row = rows.append
    result = sense_shell.execute("watch Identification 3 0.1")
    assert len(rows) == len(result.data["readings"]) == len(result.data["times_s"]) == 3
    assert [row.rows[0] for row in rows] == [
        ("", f"after {time_s:.3f} s") for time_s in result.data["times_s"]
    ]


def test_help_of_a_name_is_short(sense_shell):
    shown = sense_shell.execute("help CaptureAndDetect").rows
    assert [text for _, text in shown][1:] == ["Camera, Sram"]
    assert shown[0][1].startswith("telecommand 20, 2 bytes: ")
    assert [name for name, _ in sense_shell.execute("help watch").rows] == [
        "watch NAME [COUNT=10 [PERIOD_S=1]]"
    ]


def test_shell_image_command_saves_the_memory(node, shell, tmp_path):
    node.memory[:] = np.arange(node.memory.size) % 251
    shell.execute(f"image {tmp_path}/a.png")
    assert (np.asarray(Image.open(tmp_path / "a.png")).ravel() == node.memory).all()
    with pytest.raises(TargetError, match="sends no picture 'x'"):
        shell.execute(f"image {tmp_path}/b.png x")


def test_shell_image_command_saves_a_named_memory(sense, sense_shell, tmp_path):
    sense_shell.target.device = device("cubesense")
    sense.pictures[1, 7, 9] = 77
    with pytest.raises(TargetError, match="no memory 'sram3'; known: sram1, sram2"):
        sense_shell.execute(f"image {tmp_path}/c.png sram3")
    rows = sense_shell.execute(f"image {tmp_path}/c.png SRAM2").rows
    assert rows == [("", f"{tmp_path}/c.png: 640 x 480")]
    assert np.asarray(Image.open(tmp_path / "c.png"))[7, 9] == 77
    with pytest.raises(ShellError, match="exists; choose another name"):
        sense_shell.execute(f"image {tmp_path}/c.png SRAM1")


@pytest.mark.parametrize("command", ["scene x.toml", "fault", "power", "time"])
def test_controls_need_an_emulated_device(shell, command):
    with pytest.raises(ShellError, match="fake is not emulated here: use emulated:DEVICE"):
        shell.execute(command)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("raed x", "no command 'raed'; did you mean read"),
        ("read Identifcation", "nothing is called 'Identifcation'; did you mean Identification"),
        ("read threshold", "nothing is called 'threshold'; did you mean Detection"),
        ("read zzzzz", "nothing is called 'zzzzz'; `list` lists all names"),
        ("read 250", r"no telemetry has number 250; near: \d+ \(\w+\), \d+"),
        ("read 37", "no telemetry has number 37; near: 128"),
        ("write 128", "no telecommand has number 128; near: "),
        ("list 999", "no telemetry or telecommand has number 999"),
        ("read @5", "no register at '@5'; registers are @ADDRESS, over I2C"),
        ("write Identification", "write: nothing is called 'Identification'"),
        ("read Identification NodTyp", "did you mean NodeType"),
        ("read 'x", "No closing quotation"),
        ("raw xyz", "'xyz' is not hexadecimal bytes"),
        ("bench q", "CubeStar has no bench protocol"),
        ("image a.jpg", r"a\.jpg must end in \.png"),
        ("watch Identification never", "watch: must be a number, not 'never'"),
        ("watch Identification nan", "watch: must be a number, not nan"),
        ("write setIDMode x=1", "setIDMode has no field 'x'"),
        ("write setIDMode 1 2", "setIDMode has 1 fields, not 2"),
        ("write setIDMode 1 IdMode=1", "IdMode is given twice"),
        ("write setDelayTimerTimeout many", "'many' is not a number"),
    ],
)
def test_rejects_invalid_lines(node, shell, line, text):
    with pytest.raises(ValueError, match=text) as raised:
        shell.execute(line)
    assert "\n" not in str(raised.value)
    assert node.log == []


def test_rejects_unknown_register_addresses(sense_shell):
    with pytest.raises(ShellError, match=r"near: @0x\w\w \(\w+\), @0x"):
        sense_shell.execute("read @0x99")
    with pytest.raises(ShellError, match="no register at '@x'; as in @0x05"):
        sense_shell.execute("write @x 1")


@given(st.text(max_size=40))
def test_random_lines_run_or_are_rejected(line):
    target = Target("fake", ARAMIS, NodeClient(LetterLine(), ARAMIS, retries=0), LetterLine())
    shell = Shell(target)
    with contextlib.suppress(ValueError, NoAnswerError):
        shell.execute(line)
    shell.complete(line)


def test_shell_parses_parameter_values():
    field = CUBESTAR.telecommand("setDelayTimerTimeout").fields[0]
    for text, value in (("12", 12), ("0x1f", 31), ("0b11", 3), ("1.5", 1.5), ("on", 1)):
        assert parse_value(field, text) == value
    upload = CUBESTAR.telecommand("UploadBlock")
    assert parse_values(upload, ["1", "00ff"]) == {"BlockNumber": 1, "Data": b"\0\xff"}


def test_shell_completes_every_message_and_field_name(silent_shell):
    shell, interface = silent_shell, silent_shell.target.interface
    for message in interface.telemetries:
        if message.supported:
            assert message.name in shell.complete(f"read {message.name[:3].lower()}")
            assert shell.complete(f"read {message.name} ") == [f.name for f in message.fields]
    for message in interface.telecommands:
        if message.supported:
            assert message.name in shell.complete(f"write {message.name[:3]}")
            found = {word.partition("=")[0] for word in shell.complete(f"write {message.name} ")}
            assert found == {f.name for f in message.fields}
    for register in interface.registers or ():
        assert register.name in shell.complete(f"list {register.name[:4].lower()}")


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("", ["read", "write", "watch", "dump", "list", "image", "bench", "raw", "scene", "point",
              "fault", "power", "time", "peek", "help", "quit"]),
        ("wa", ["watch"]),
        ("bench ", ["a", "q", "s", "w"]),
        ("fault ", ["latch-up", "camera", "log"]),
        ("fault latch-up ", ["SRAM1", "SRAM2", "extra_ma=", "at_s="]),
        ("fault latch-up SRAM1 extra_ma=5 ", ["at_s="]),
        ("power ", ["SRAM1", "SRAM2"]),
        ("power SRAM1 ", ["on", "off"]),
        ("write CaptureAndDetect Camera=", ["Camera=SUN", "Camera=NADIR"]),
        ("write CaptureAndDetect Camera=SUN ", ["Sram=SRAM1", "Sram=SRAM2"]),
        ("dump ", []),
    ],
)  # fmt: skip
def test_shell_completes_commands_targets_and_parameters(sense_shell, line, found):
    assert sense_shell.complete(line) == found
