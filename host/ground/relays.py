"""What pages ask of the emulation itself: passed on to its control port."""

import asyncio
from urllib.parse import quote, urlencode

from starlette.responses import Response

from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.ground.desk import Desk
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.scenes import FILE, text_of

STEERING = ("pause", "resume", "step", "run", "pace", "snapshot", "back")
"""Calls of the control port that pages pass on."""


async def steer(desk: Desk, body: JsonObject, path: JsonObject) -> JsonObject:
    """A call that steers virtual time."""
    call = path["call"]
    if call not in STEERING:
        raise ValueError(f"no call {call!r}; there are {', '.join(STEERING)}")
    return await ask(desk, "POST", f"/{call}", body)


async def show_scene(desk: Desk, body: JsonObject, _path: JsonObject) -> JsonObject:
    """Show another scene: the ``text`` of its file, or the ``table`` that its file has."""
    text, table = body.get("text"), body.get("table")
    if isinstance(table, dict) and text is None:
        text = text_of(table)
    if not isinstance(text, str):
        raise ValueError("'text' is that of a scene file, 'table' what one has")
    act = {"words": ["scene", FILE], "text": text}
    return await ask(desk, "POST", f"/devices/{controls(desk).device}/act", act)


async def scene(desk: Desk, _body: JsonObject, _path: JsonObject) -> JsonObject:
    return await _of_device(desk, "GET", "scene")


async def scene_keys(desk: Desk, _body: JsonObject, _path: JsonObject) -> JsonObject:
    """What the keys of scene files are."""
    return await _of_device(desk, "GET", "scene/keys")


async def look(desk: Desk, body: JsonObject, _path: JsonObject) -> JsonObject:
    """Where on the sky another scene would be."""
    return await _of_device(desk, "POST", "scene/look", body)


async def stars(desk: Desk, _body: JsonObject, _path: JsonObject) -> JsonObject:
    return await ask(desk, "GET", "/stars")


async def picture(desk: Desk, _body: JsonObject, path: JsonObject) -> Response:
    """A picture in one of its memories."""
    content = await fetched(desk, f"pictures/{quote(path['name'])}")
    return Response(content, media_type="image/png")


async def trace(desk: Desk, body: JsonObject, _path: JsonObject) -> Response:
    """A waveform of a span of its past."""
    span = urlencode([(name, body[name]) for name in ("from_s", "to_s") if name in body])
    return Response(await fetched(desk, f"trace?{span}"), media_type="text/plain")


async def fetched(desk: Desk, what: str) -> bytes:
    """What the control port has of the device."""
    own = controls(desk)
    path = f"/devices/{own.device}/{what}"
    return await asyncio.to_thread(own.client.fetch, "GET", path)


async def ask(desk: Desk, method: str, path: str, body: object = None) -> JsonObject:
    return await asyncio.to_thread(controls(desk).client.ask, method, path, body)


def controls(desk: Desk) -> RemoteControls:
    """Those of the target's emulation; ValueError where there is none."""
    if desk.controls is None:
        raise ValueError(desk.about["missing"]["controls"])
    return desk.controls


async def _of_device(desk: Desk, method: str, what: str, body: object = None) -> JsonObject:
    return await ask(desk, method, f"/devices/{controls(desk).device}/{what}", body)
