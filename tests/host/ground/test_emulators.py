import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.reference.image import reference_image
from cubestack.host.errors import PortOpenError, TargetError
from cubestack.host.ground.emulators import Emulator, UploadedFile, words
from cubestack.host.ground.scenes import text_of
from cubestack.host.ground.serving import Serving
from cubestack.host.ground.session import TargetSession

from .conftest import TOKEN, request, serving_pages

OWN_GATEWARE = Path(__file__).parents[3] / "examples/own_gateware/frame_buffer.v"


@pytest.fixture(scope="module")
def session() -> Iterator[TargetSession]:
    emulator = Emulator("cubestar", {"seed": 7})
    opened = TargetSession(emulator.start(), emulator)
    yield opened
    opened.close()


@pytest.fixture
def served(session: TargetSession) -> Iterator[Serving]:
    with serving_pages(session) as serving:
        yield serving


def scene(session: TargetSession) -> Any:
    assert session.controls is not None
    return session.controls.client.ask("GET", "/devices/cubestar/scene")["table"]


def restart(served: Serving, body: object, token: str = TOKEN) -> tuple[int, Any]:
    headers = {"Authorization": f"Bearer {token}"}
    answer, content = request(served, "POST", "/targets/0/restart", body, headers)
    return answer.status, json.loads(content)


@pytest.mark.slow
def test_restart_changes_the_profile_and_keeps_scene_and_seed(
    session: TargetSession, served: Serving
) -> None:
    assert session.controls is not None
    shown = scene(session) | {"ra_deg": 10.0, "hazards": {"moon": [{"direction": [12.0, 0.0]}]}}
    act = {"words": ["scene", "scene"], "text": text_of(shown)}
    session.controls.client.ask("POST", "/devices/cubestar/act", act)
    before, begun = session.controls.client.url, session.restarts
    status, told = restart(served, {"options": {"profile": "extended"}})
    assert (status, told["rows"]) == (200, [["seed", "7"], ["profile", "extended"]])
    assert session.controls.client.url != before
    assert session.restarts == begun + 1
    assert "recording" not in session.about["missing"]  # the emulation records itself
    assert scene(session) == shown
    now = {row["name"]: row["now"] for row in session.about["options"]}
    assert (now["profile"], now["firmware"]) == ("extended", "")
    values = session.execute("read Identification").result()["data"]["values"]
    assert values["NodeType"] > 0


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_page_runs_and_changes_own_gateware() -> None:
    emulator = Emulator("cubestar", {"gateware": str(OWN_GATEWARE)})
    own = TargetSession(emulator.start(), emulator)
    try:
        with serving_pages(own) as served:
            own.execute("write CaptureAndProcess").result()
            values = own.execute("read Identification").result()["data"]["values"]
            assert values["NodeType"] > 0
            values = own.execute("read Identification").result()["data"]["values"]
            assert values["NodeType"] > 0
            now = {row["name"]: row["now"] for row in own.about["options"]}
            assert now["gateware"] == str(OWN_GATEWARE)
            assert restart(served, {"options": {"gateware": ""}})[0] == 200
            status, told = restart(served, {"options": {"gateware": "none.v"}})
            assert status != 200
            assert "gateware none.v does not exist" in json.dumps(told)
    finally:
        own.close()


@pytest.mark.slow
def test_restart_runs_uploaded_firmware(session: TargetSession, served: Serving) -> None:
    content = base64.b64encode(reference_image().read_bytes()).decode()
    own = {"name": "../../my <own>.elf", "content": content}
    status, told = restart(served, {"files": {"firmware": own}})
    assert status == 200, told
    assert "/my_own_.elf#" in dict(told["rows"])["firmware"]
    assert session.execute("read Identification").result()["data"]["values"]["NodeType"] > 0
    # What runs can be kept, and has no profile.
    kept = next(row["now"] for row in session.about["options"] if row["name"] == "firmware")
    status, told = restart(served, {"options": {"firmware": kept, "profile": "extended"}})
    assert status == 502
    assert told["error"].endswith("own firmware has no profile and no switches; leave them out")
    status, told = restart(served, {"options": {"firmware": kept}})
    assert (status, dict(told["rows"])["profile"]) == (200, "published")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "status", "error"),
    [
        ({"options": {"profile": "best"}}, 400, "profile of cubestar must be one of"),
        ({"options": {"profile": 3}}, 400, "profile of cubestar must be one of"),
        ({"options": {"set": "no=1"}}, 400, "no"),
        ({"options": {"set": 3}}, 400, "set of cubestar must be text, not 3"),
        ({"options": {"uart": "node"}}, 400, "uart is an option of cubesense, not of cubestar"),
        ({"options": {"scene": "/etc/passwd"}}, 400, "scene is no option of cubestar"),
        ({"options": {"firmware": "/etc/passwd"}}, 400, "firmware: upload the file itself"),
        ({"options": []}, 400, "'options' and 'files' must be objects"),
        ({"files": {"firmware": 3}}, 400, "a file must have 'name', 'content' in base 64"),
        ({"files": {"firmware": {"name": "a", "content": "%"}}}, 400, "base64"),
        (
            {"files": {"firmware": {"name": "a", "content": "", "suffix": "/../x"}}},
            400,
            "the address of a raw binary must be like @0x0",
        ),
        ({"files": {"firmware": {"name": "a.elf", "content": "AAAA"}}}, 502, "is not an ELF file"),
    ],
)
def test_failed_restart_keeps_the_old_emulation(
    session: TargetSession, served: Serving, body: object, status: int, error: str
) -> None:
    begun = session.restarts
    found, told = restart(served, body)
    assert (found, session.restarts) == (status, begun)
    assert error in told["error"]
    assert "\n" not in told["error"]
    assert session.execute("read Identification").result()["data"]["values"]["NodeType"] > 0


def test_restart_needs_the_token(session: TargetSession, served: Serving) -> None:
    begun = session.restarts
    assert restart(served, {}, "guess")[0] == 401
    assert session.restarts == begun


def test_emulation_that_does_not_start_is_reported() -> None:
    emulator = Emulator("cubestar", {"scene": "/none.toml"})
    with pytest.raises(PortOpenError, match=r"/none\.toml"):
        emulator.start()
    emulator.close()


def test_options_become_command_line_words() -> None:
    given = {"seed": 0, "set": "", "mcu_addressing": True, "semihosting": False, "scene": None}
    assert words(given) == ["--seed", "0", "--mcu-addressing"]


def test_uploaded_file_stays_in_its_folder(tmp_path: Path) -> None:
    for name in ("..", "/etc/passwd", "a/../../b", "", "\0", "é.bin"):
        path = Path(UploadedFile(name, b"x", "@0x10").save(tmp_path).removesuffix("@0x10"))
        assert path.parent == tmp_path
        assert path.read_bytes() == b"x"
    with pytest.raises(TargetError):
        Emulator("nothing", {})
