"""Requests of pages that the server forwards to the control port, and files that a page saves."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote, urlencode

from starlette.responses import Response

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.results import FORMS
from cubestack.host.ground.scenes import FILE, text_of
from cubestack.host.ground.session import TargetSession
from cubestack.host.recording.transcript import TABLES, transcript

TIME_CALLS = ("pause", "resume", "step", "run", "pace", "snapshot", "back")
"""Calls of the control port about virtual time."""

Handler = Callable[[TargetSession, JsonObject, JsonObject], Awaitable[JsonObject]]


def forward(method: str, path: str) -> Handler:
    """A handler that forwards requests to ``path``; ``{device}`` is the path of the device."""

    async def handle(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
        place = path.format(device=f"/devices/{controls(session).device}")
        return await ask(session, method, place, body if method == "POST" else None)

    return handle


async def control_time(session: TargetSession, body: JsonObject, path: JsonObject) -> JsonObject:
    call = path["call"]
    if call not in TIME_CALLS:
        raise ValueError(f"no call {call!r}; known: {', '.join(TIME_CALLS)}")
    return await ask(session, "POST", f"/{call}", body)


async def apply_scene(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    """Apply a scene: the ``text`` of its file, or its ``table``."""
    text, table = body.get("text"), body.get("table")
    if isinstance(table, dict) and text is None:
        text = text_of(table)
    if not isinstance(text, str):
        raise ValueError("'text' must be the text of a scene file, or 'table' its content")
    act = {"words": ["scene", FILE], "text": text}
    return await ask(session, "POST", f"/devices/{controls(session).device}/act", act)


async def picture(session: TargetSession, _body: JsonObject, path: JsonObject) -> Response:
    content = await _fetch(session, f"pictures/{quote(path['name'])}")
    return Response(content, media_type="image/png")


async def trace(session: TargetSession, body: JsonObject, _path: JsonObject) -> Response:
    span = urlencode([(name, body[name]) for name in ("from_s", "to_s") if name in body])
    return Response(await _fetch(session, f"trace?{span}"), media_type="text/plain")


async def ask(session: TargetSession, method: str, path: str, body: object = None) -> JsonObject:
    return await asyncio.to_thread(controls(session).client.ask, method, path, body)


def controls(session: TargetSession) -> RemoteControls:
    """Controls of the target's emulation; raises ValueError if it has none."""
    if session.controls is None:
        raise ValueError(session.about["missing"]["controls"])
    return session.controls


async def _fetch(session: TargetSession, what: str) -> bytes:
    own = controls(session)
    return await asyncio.to_thread(own.client.fetch, "GET", f"/devices/{own.device}/{what}")


def recording(session: TargetSession) -> bytes:
    """The recording up to now, in whole lines.

    Raises ValueError if nothing is recorded, and the errors of its control port.
    """
    if session.controls is not None:
        return session.controls.client.fetch("GET", f"/devices/{session.controls.device}/recording")
    if session.target.recorded is None:
        raise ValueError(session.about["missing"]["recording"])
    content = session.target.recorded.read_bytes()
    return content[: content.rfind(b"\n") + 1]


def transcript_table(session: TargetSession, kind: str) -> bytes:
    """The table of `cubestack decode` as "csv" or "parquet".

    Raises as ``recording`` does, and ValueError for another kind or without pyarrow.
    """
    make: Callable[..., bytes] | None = TABLES.get(kind)
    if make is None:
        raise ValueError(f"no table {kind!r}; known: {', '.join(TABLES)}")
    content = recording(session)
    with TemporaryDirectory(prefix="cubestack-") as folder:
        path = Path(folder) / "session.rec"
        path.write_bytes(content)
        return make(transcript(load_recording(path), session.target.interface))


def results_table(session: TargetSession, kind: str) -> bytes:
    """The log of results as "csv" or "parquet"; raises as ``transcript_table`` does."""
    if kind not in FORMS:
        raise ValueError(f"no table {kind!r}; known: {', '.join(FORMS)}")
    return FORMS[kind](session.log)
