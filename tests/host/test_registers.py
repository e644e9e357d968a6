import json
import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.registers import FORMATS, render

DOCUMENT = Path(__file__).parents[2] / "docs" / "registers-cubestar.md"
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")

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


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_c_header_compiles_and_agrees_with_the_tables(tmp_path: Path) -> None:
    (tmp_path / "cubestar.h").write_text(render(INTERFACE, "c"))
    (tmp_path / "main.c").write_text(PROGRAM)
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    command = [str(COMPILER), *flags, "main.c", "-o", "main"]
    subprocess.run(command, cwd=tmp_path, check=True)
    data = bytes.fromhex("0102 f0c2 8090a0b0 0000c03f 99aabbcc")
    run = subprocess.run([tmp_path / "main"], input=data, stdout=subprocess.PIPE, check=True)
    first, second, copied = run.stdout.decode().splitlines()
    fx = struct.unpack("<f", data[:4])[0]
    assert first.split() == [str(len(data)), f"{fx:.9g}", "-15632", str(0xB0A09080), "-1.5632"]
    assert second == "177 18 29 0"
    assert copied == data[:11].hex()


def test_c_header_defines_every_name_once_and_has_every_message() -> None:
    names = re.findall(r"(?:#define|^   ) (CUBESTAR_\w+)", render(INTERFACE, "c"), re.MULTILINE)
    assert len(names) == len(set(names))
    for message in INTERFACE.messages:
        kind = "TLM" if message.id & 0x80 else "TC"
        assert f"CUBESTAR_{kind}_{message.name}" in names
        assert all(
            f"CUBESTAR_{kind}_{message.name}_{f.name}_OFFSET" in names for f in message.fields
        )


def test_the_document_is_the_generated_one() -> None:
    assert DOCUMENT.read_text(encoding="utf-8") == render(INTERFACE, "markdown"), (
        "docs/registers-cubestar.md is stale: "
        "cubestack registers cubestar --format markdown > docs/registers-cubestar.md"
    )


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_names_every_message_and_field(form: str) -> None:
    words = set(re.findall(r"\w+", render(INTERFACE, form).replace("CUBESTAR_", " ")))
    for message in INTERFACE.messages:
        if form == "c":
            kind = "TLM" if message.id & 0x80 else "TC"
            assert {f"{kind}_{message.name}_{f.name}_OFFSET" for f in message.fields} <= words
        else:
            assert {message.name, *(field.name for field in message.fields)} <= words


def test_json_carries_the_whole_declaration() -> None:
    content = json.loads(render(INTERFACE, "json"))
    assert (content["name"], content["i2c_address"], content["baud"]) == ("CubeStar", 0x1A, 57_600)
    messages = {(entry["kind"], entry["id"]): entry for entry in content["messages"]}
    assert len(messages) == len(INTERFACE.messages)
    margin = messages["telecommand", 27]["fields"][0]
    assert margin["scale"] == 10_000
    assert margin["minimum"] == pytest.approx(0.0001)
    assert messages["telemetry", 138]["supported"] is False
    assert messages["telemetry", 151]["steps"] is True
    assert messages["telecommand", 100]["ours"] is True


def test_table_tells_ranges_resets_and_flags() -> None:
    text = render(INTERFACE, "table")
    assert "declination of the boresight [rad]; -1.5708 to 1.5708; else DeclinationSetError" in text
    assert "focal length [mm]; 1 to 100; reset 6.28 mm; else FocalLengthRangeError" in text
    assert "at most, by BlockSize, 16383 for 0, 8191 for 1, 4095 for 2, 2047 for 3" in text
    assert "our extension" in text


def test_an_unknown_format_is_told() -> None:
    with pytest.raises(ValueError, match="no format 'xml'; known: table, markdown, c, json"):
        render(INTERFACE, "xml")
