import re
from dataclasses import replace

import pytest

from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.cubestar.link import TASKS
from cubestack.firmware_model.interface.cubestar import INTERFACE, TaskStatus
from cubestack.host.emulation.emulated import open_device
from tests.system.conftest import ROOT

PAGES = {
    "protocols": ("cubestar", {131, 167, 177, 200}),
    "protocols-cubesense": ("cubesense", {131, 148, 168, 193}),
    "protocols-aramis": ("aramis", {131, 132, 134}),
}


def text_of(page: str) -> str:
    return (ROOT / "docs" / "sensors" / f"{page}.md").read_text(encoding="utf-8")


def sections(text: str, mark: str) -> dict[str, str]:
    """Text below each heading of a level, up to the next heading of that level or above."""
    parts = re.split(rf"^{mark} (.*)$", text, flags=re.MULTILINE)
    end = rf"^#{{1,{len(mark)}}} "
    return {
        head: re.split(end, body, flags=re.MULTILINE)[0].strip()
        for head, body in zip(parts[1::2], parts[2::2], strict=True)
    }


@pytest.mark.parametrize("page", PAGES)
def test_frame_tables_match_the_register_pages(page: str) -> None:
    """If they differ, copy the table from the generated register page."""
    device, frames = PAGES[page]
    declared = sections(text_of(f"registers-{device}"), "##")
    shown = sections(text_of(page), "###")
    assert shown == {head: declared[head] for head in shown}
    told = {int(number) for number in re.findall(r"Telemetry (\d+)", " ".join(shown))}
    assert told >= frames
    codes = set(re.findall(r"; see (\w+)", "".join(shown.values()))) - {"AckError"}
    assert codes <= shown.keys()


def test_task_states_match_the_program() -> None:
    part = sections(text_of("protocols"), "##")["States of a task"]
    rows = [line.strip("|").split("|") for line in part.splitlines() if line.startswith("|")][2:]
    states = [cell.strip() for row in rows for cell in row[1:] if cell.strip()]
    assert {*map(int, states)} == {*TaskStatus}
    told = {
        name: tuple(int(cell) if cell.strip() else None for cell in row[1:])
        for row in rows
        for name in re.findall(r"\d+ (\w+)", row[0])
        if name in TASKS
    }
    assert told == TASKS


def test_attitude_example_matches_the_device() -> None:
    page = text_of("protocols")
    (block,) = re.findall(r"```wire-sky\n(.*?)```", page, re.DOTALL)
    lines = [(line[:2], bytes.fromhex(line[3:])) for line in block.splitlines()]
    answers = {}
    scene = replace(SkyScene.pointing(84.0, -1.0, 20.0), mag_limit=3.8)
    with open_device("cubestar", scene, seed=4, profile="extended") as device:
        port = device.serial(timeout=0.2)
        for (_, request), (_, answer) in zip(lines[::2], lines[1::2], strict=True):
            port.write(request)
            assert port.read(100).hex(" ") == answer.hex(" "), request.hex(" ")
            answers[request[2]] = answer[2:-2]
            device.wait(1.5 if request[2] == 36 else 0.0)
    rows = re.findall(r"^\| (\d+) \| `([\w ]+)` \| (\w+) \| (\S+) \|$", page, re.MULTILINE)
    assert len(rows) >= 12
    for number, raw, name, value in rows:
        message = INTERFACE.telemetry(int(number))
        field, data = message.field(name), answers[int(number)]
        start = field.bit_offset // 8
        assert data[start : start + field.bits // 8] == bytes.fromhex(raw)
        assert float(message.unpack(data)[name]) == pytest.approx(float(value), rel=1e-6)
