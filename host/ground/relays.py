"""What pages ask of the emulation itself: passed on to its control port."""

import asyncio
from urllib.parse import quote, urlencode

from starlette.responses import Response

from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.scenes import FILE, text_of
from cubestack.host.ground.session import TargetSession

STEERING = ("pause", "resume", "step", "run", "pace", "snapshot", "back")
"""Calls of the control port that pages pass on."""


async def steer(session: TargetSession, body: JsonObject, path: JsonObject) -> JsonObject:
    """A call that steers virtual time."""
    call = path["call"]
    if call not in STEERING:
        raise ValueError(f"no call {call!r}; there are {', '.join(STEERING)}")
    return await ask(session, "POST", f"/{call}", body)


async def show_scene(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    """Show another scene: the ``text`` of its file, or the ``table`` that its file has."""
    text, table = body.get("text"), body.get("table")
    if isinstance(table, dict) and text is None:
        text = text_of(table)
    if not isinstance(text, str):
        raise ValueError("'text' is that of a scene file, 'table' what one has")
    act = {"words": ["scene", FILE], "text": text}
    return await ask(session, "POST", f"/devices/{controls(session).device}/act", act)


async def scene(session: TargetSession, _body: JsonObject, _path: JsonObject) -> JsonObject:
    return await _of_device(session, "GET", "scene")


async def scene_keys(session: TargetSession, _body: JsonObject, _path: JsonObject) -> JsonObject:
    """What the keys of scene files are."""
    return await _of_device(session, "GET", "scene/keys")


async def look(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    """Where on the sky another scene would be."""
    return await _of_device(session, "POST", "scene/look", body)


async def stars(session: TargetSession, _body: JsonObject, _path: JsonObject) -> JsonObject:
    return await ask(session, "GET", "/stars")


async def picture(session: TargetSession, _body: JsonObject, path: JsonObject) -> Response:
    """A picture in one of its memories."""
    content = await fetched(session, f"pictures/{quote(path['name'])}")
    return Response(content, media_type="image/png")


async def trace(session: TargetSession, body: JsonObject, _path: JsonObject) -> Response:
    """A waveform of a span of its past."""
    span = urlencode([(name, body[name]) for name in ("from_s", "to_s") if name in body])
    return Response(await fetched(session, f"trace?{span}"), media_type="text/plain")


async def fetched(session: TargetSession, what: str) -> bytes:
    """What the control port has of the device."""
    own = controls(session)
    path = f"/devices/{own.device}/{what}"
    return await asyncio.to_thread(own.client.fetch, "GET", path)


async def ask(session: TargetSession, method: str, path: str, body: object = None) -> JsonObject:
    return await asyncio.to_thread(controls(session).client.ask, method, path, body)


def controls(session: TargetSession) -> RemoteControls:
    """Those of the target's emulation; ValueError where there is none."""
    if session.controls is None:
        raise ValueError(session.about["missing"]["controls"])
    return session.controls


async def _of_device(
    session: TargetSession, method: str, what: str, body: object = None
) -> JsonObject:
    return await ask(session, method, f"/devices/{controls(session).device}/{what}", body)
