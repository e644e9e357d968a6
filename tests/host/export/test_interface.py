import json
import re
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.switches import PROFILES, Switches
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.devices.registry import device, device_names
from cubestack.host.export.c_header import c_arrays, c_header
from cubestack.host.export.interface import FORMATS, render, render_switches

from ...conftest import Run
from .frames import EACH, INTERFACES

DOCUMENTS = Path(__file__).parents[3] / "docs" / "sensors"
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
TIMEOUT_S = 120

PROGRAM = """
#include <stdio.h>
#include "cubestar.h"

int main(void)
{
    uint8_t in[32], out[32] = {0};
    size_t size = fread(in, 1, sizeof in, stdin);
    float fx = cubestar_get_f32(in, CUBESTAR_TC_setFocalLengthComponents_Fx_OFFSET);
    int x = cubestar_get_i16(in, CUBESTAR_TLM_Quaternion_Qbar1_OFFSET);
    unsigned wide = (unsigned)cubestar_get_u32(in, 4);
    printf("%u %.9g %d %u %g\\n", (unsigned)size, (double)fx, x, wide,
           x / (double)CUBESTAR_TLM_Quaternion_Qbar1_SCALE);
    printf("%d %d %d %d\\n", CUBESTAR_TLM_AttitudeData, CUBESTAR_TLM_AttitudeData_LENGTH,
           CUBESTAR_TASK_STATUS_CALCULATED,
           !!(in[CUBESTAR_TLM_ErrorFlags_UART_ProtocolError_OFFSET]
              & CUBESTAR_TLM_ErrorFlags_UART_ProtocolError_MASK));
    cubestar_put_u8(out, 0, cubestar_get_u8(in, 0));
    cubestar_put_i16(out, 1, cubestar_get_i16(in, 1));
    cubestar_put_u32(out, 3, cubestar_get_u32(in, 3));
    cubestar_put_f32(out, 7, cubestar_get_f32(in, 7));
    for (size_t i = 0; i < 11; i++)
        printf("%02x", (unsigned)out[i]);
    return 0;
}
"""


SENSE_PROGRAM = """
#include <stdio.h>
#include "cubesense.h"

int main(void)
{
    const uint8_t in[6] = {0xd2, 0x04, 0xc9, 0xfd, 2, 7};
    printf("%d %d %d\\n", cubesense_get_i16(in, CUBESENSE_TLM_Result1_Alpha_OFFSET),
           cubesense_get_i16(in, CUBESENSE_TLM_Result1_Beta_OFFSET),
           in[CUBESENSE_TLM_Result1_Detect_OFFSET] == CUBESENSE_DETECT_RESULT_SUCCESS);
    printf("%x %x %d %c %d\\n", CUBESENSE_REGISTER_I2C_ADDRESS, CUBESENSE_REGISTER_NADIR_X,
           CUBESENSE_REGISTER_NADIR_X_SCALE, CUBESENSE_BENCH_TAKE_NADIR,
           CUBESENSE_BENCH_SEND_SUN_LENGTH);
    return 0;
}
"""


def compile_and_run(folder: Path, program: str, data: bytes = b"") -> bytes:
    for interface in INTERFACES:
        (folder / f"{interface.name.lower()}.h").write_text(c_header(interface))
    (folder / "main.c").write_text(program)
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    command = [str(COMPILER), *flags, "main.c", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True, timeout=TIMEOUT_S)
    return subprocess.run(
        [folder / "main"], input=data, stdout=subprocess.PIPE, check=True, timeout=TIMEOUT_S
    ).stdout


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_c_header_compiles_and_agrees_with_the_tables(tmp_path: Path) -> None:
    data = bytes.fromhex("0102 f0c2 8090a0b0 0000c03f 99aabbcc")
    first, second, copied = compile_and_run(tmp_path, PROGRAM, data).decode().splitlines()
    fx = struct.unpack("<f", data[:4])[0]
    assert first.split() == [str(len(data)), f"{fx:.9g}", "-15632", str(0xB0A09080), "-1.5632"]
    assert second == "177 18 29 0"
    assert copied == data[:11].hex()


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_c_header_of_a_device_with_registers_and_letters(tmp_path: Path) -> None:
    assert compile_and_run(tmp_path, SENSE_PROGRAM) == b"1234 -567 1\n1c 48 100 a 307200\n"


@EACH
def test_c_header_defines_every_name_once_and_has_every_message(interface: Interface) -> None:
    upper = interface.name.upper()
    pattern = rf"(?:#define|^   ) ({upper}_\w+)"
    names = re.findall(pattern, c_header(interface), re.MULTILINE)
    assert len(names) == len(set(names))
    for message in interface.messages:
        name = f"{upper}_{'TLM' if message.id & 0x80 else 'TC'}_{message.name}"
        assert {name, *(f"{name}_{field.name}_OFFSET" for field in message.fields)} <= set(names)
    for register in interface.registers or ():
        assert f"{upper}_REGISTER_{register.name}" in names


@EACH
def test_register_page_is_up_to_date(interface: Interface) -> None:
    device = interface.name.lower()
    text = (DOCUMENTS / f"registers-{device}.md").read_text(encoding="utf-8")
    assert text == render(interface, "markdown"), (
        f"docs/registers-{device}.md is stale: "
        f"cubestack registers {device} --format markdown > docs/registers-{device}.md"
    )


@EACH
@pytest.mark.parametrize("form", ["table", "markdown", "json"])
def test_every_format_names_every_message_and_field(interface: Interface, form: str) -> None:
    words = set(re.findall(r"\w+", render(interface, form)))
    for message in interface.messages:
        assert {message.name, *(field.name for field in message.fields)} <= words


def test_json_has_the_whole_declaration() -> None:
    content = json.loads(render(INTERFACE, "json"))
    assert (content["name"], content["i2c_address"], content["baud"]) == ("CubeStar", 0x1A, 57_600)
    messages = {(entry["kind"], entry["id"]): entry for entry in content["messages"]}
    assert len(messages) == len(INTERFACE.messages)
    margin = messages["telecommand", 27]["fields"][0]
    assert margin["scale"] == 10_000
    assert margin["minimum"] == pytest.approx(0.0001)
    assert messages["telemetry", 138]["supported"] is False
    assert messages["telemetry", 151]["steps"] is True
    assert messages["telecommand", 100]["extension"] is True


def test_json_has_registers_and_bench_letters() -> None:
    content = json.loads(render(CUBESENSE, "json"))
    registers = {entry["field"]["name"]: entry for entry in content["registers"]["registers"]}
    assert content["registers"]["i2c_address"] == 0x1C
    assert registers["NADIR_X"]["access"] == "ro"
    assert (registers["NADIR_X"]["length"], registers["NADIR_X"]["field"]["scale"]) == (2, 100)
    assert content["bench"]["baud"] == 115_200
    letters = {entry["letter"]: entry for entry in content["bench"]["letters"]}
    assert (letters["a"]["answer"], letters["s"]["length"]) == ("59", 307_200)
    confidences = {entry["name"]: entry["confidence"] for entry in content["messages"]}
    assert (confidences["Result1"], confidences["Details1"]) == ("MEDIUM", None)
    assert not {"registers", "bench"} & json.loads(render(INTERFACE, "json")).keys()


@pytest.mark.parametrize("form", ["table", "markdown"])
def test_listing_marks_assumed_and_extended_parts(form: str) -> None:
    text = render(CUBESENSE, form)
    assert "the registers and their addresses are assumed" in text
    assert "0x48" in text
    assert "layout only declared somewhere" in text
    assert re.search(r"\ba\b.*TAKE_NADIR.*'Y'", text)


@EACH
@pytest.mark.parametrize("form", FORMATS)
def test_command_prints_every_format(interface: Interface, form: str, run: Run) -> None:
    outcome = run("registers", interface.name.lower(), "--format", form)
    assert outcome == (0, render(interface, form), "")


def test_table_shows_ranges_resets_and_flags() -> None:
    with pytest.raises(ValueError, match="no format 'xml'; known: table, markdown, json"):
        render(INTERFACE, "xml")
    for text in (
        "declination of the boresight [rad]; -1.5708 to 1.5708; else DeclinationSetError",
        "focal length [mm]; 5 to 7; reset 6.28 mm; else FocalLengthRangeError",
        "at most, by BlockSize, 16383 for 0, 8191 for 1, 4095 for 2, 2047 for 3",
        "an extension",
    ):
        assert text in render(INTERFACE, "table")


PAGE = Path(__file__).parents[3] / "docs" / "reference" / "switches.md"
WITH_SWITCHES = [name for name in device_names() if device(name).switches.declared()]


@pytest.mark.parametrize("name", WITH_SWITCHES)
def test_page_table_is_up_to_date(name: str) -> None:
    table = render_switches(device(name).title, device(name).switches, "markdown")
    hint = f"paste `cubestack registers {name} --switches --format markdown` into {PAGE}"
    assert table in PAGE.read_text(encoding="utf-8"), hint


@pytest.mark.parametrize("name", WITH_SWITCHES)
def test_each_format_describes_each_switch(name: str, run: Run) -> None:
    declared = device(name).switches.declared()
    listed = json.loads(run("registers", name, "--switches", "--format", "json").out)
    assert list(listed) == list(declared)
    text = " ".join(run("registers", name, "--switches").out.split())
    for one, switch in declared.items():
        assert [listed[one][each] for each in PROFILES] == [switch.published, switch.extended]
        assert listed[one]["source"] == switch.source
        for part in (one, switch.meaning, switch.source, switch.reason, *switch.choices):
            assert part in text


def test_switch_export_reports_a_device_without_switches() -> None:
    assert render_switches("Glow", Switches, "table") == "Glow has no switches\n"


DUMP = """
#include <stdio.h>
#include "catalogue.c"
#define PUT(array) fwrite(array, 1, sizeof array, stdout)
int main(void)
{
    if (CATALOGUE_STAR_COUNT != 405 || CATALOGUE_PAIR_ANGLE_COUNT != CATALOGUE_PAIR_FIRST_COUNT)
        return 1;
    PUT(catalogue_star), PUT(catalogue_star_x), PUT(catalogue_star_y), PUT(catalogue_star_z);
    PUT(catalogue_pair_first), PUT(catalogue_pair_second), PUT(catalogue_pair_angle);
    return 0;
}
"""


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_compiled_arrays_equal_the_onboard_catalogue(run: Run, tmp_path: Path) -> None:
    catalogue = tmp_path / "catalogue.c"
    code, _, err = run("catalogue", "cubestar", "--pair-limit", "42.1", "--c", str(catalogue))
    assert (code, err) == (0, "")
    found = compile_and_run(tmp_path, DUMP)
    assert found == onboard_catalogue(pair_limit_deg=42.1).to_bytes()
    assert catalogue.read_text().count("const ") == 7


def test_rejects_other_arrays_and_unwritable_files(run: Run) -> None:
    for array, wrong in ((np.zeros(3), " of u2, i2, u4, f4, not float64"), (np.eye(2), "")):
        with pytest.raises(ValueError, match=f"x must be one row{wrong}"):
            c_arrays("p", {"x": array}, "about")
    code, _, err = run("catalogue", "cubestar", "--c", "/no/such/folder/x.c")
    assert code == 2
    assert "can not write /no/such/folder/x.c" in err
