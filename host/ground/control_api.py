"""The control port's language: JSON over HTTP, and a WebSocket that tells how the emulation is.

Every call is declared once in `CALLS`; GET / lists them with what they take.
"""

import asyncio
import json
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from cubestack.host.ground.emulation import Emulation, JsonObject
from cubestack.host.ground.guard import TooLargeError, refused
from cubestack.host.ground.scenes import stars
from cubestack.host.ground.traces import Trace
from cubestack.host.pictures.images import png

T = TypeVar("T")

EVERY_S, SHORTEST_S, LONGEST_S = 0.2, 0.05, 60.0
"""Between two messages of `events`, unless the client wants another time; and its limits."""

REQUIRED = object()


@dataclass(frozen=True)
class Call:
    """Something that can be asked for.

    Attributes:
        method, path: of the request.
        meaning: one phrase.
        act: (emulation, values of path and body) -> the answer, in the emulation's thread; a
            future is waited for.
        takes: types of the body's members by name, or of the numbers behind a GET's path; each
            with its default, or `REQUIRED`.
    """

    method: str
    path: str
    meaning: str
    act: Callable[..., Any]
    takes: Mapping[str, tuple[type | tuple[type, ...], object]] = field(default_factory=dict)

    def about(self) -> JsonObject:
        return {"method": self.method, "path": self.path, "meaning": self.meaning} | (
            {"takes": list(self.takes)} if self.takes else {}
        )

    def values(self, body: object) -> JsonObject:
        """Members of a request's body; ValueError for what is missing, unknown or another type."""
        if not isinstance(body, dict):
            raise ValueError(f"the body is a JSON object with {', '.join(self.takes) or 'nothing'}")
        for name in body:
            if name not in self.takes:
                known = ", ".join(self.takes) or "nothing"
                raise ValueError(f"{name!r} means nothing to {self.path}; it takes {known}")
        found = {}
        for name, (types, default) in self.takes.items():
            if name not in body and default is REQUIRED:
                raise ValueError(f"{self.path} needs {name!r}")
            value = body.get(name, default)
            if not isinstance(value, types) or (isinstance(value, bool) and types is not bool):
                raise ValueError(f"{name!r} of {self.path} can not be {value!r}")
            found[name] = value
        return found


NUMBER = (int, float)


def _words(value: list[Any]) -> list[str]:
    if not all(isinstance(word, str) for word in value):
        raise ValueError("'words' are texts")
    return value


def _act(emulation: Emulation, device: str, words: list[Any], text: str) -> JsonObject:
    emulation.act(device, _words(words), text)
    return emulation.state()


def _done(act: Callable[[Emulation], None]) -> Callable[[Emulation], JsonObject]:
    def acts(emulation: Emulation) -> JsonObject:
        act(emulation)
        return emulation.state()

    return acts


def _pace(emulation: Emulation, pace: str, speed: float) -> JsonObject:
    if pace not in ("real", "fast"):
        raise ValueError(f"a pace is real or fast, not {pace!r}")
    emulation.set_pace(pace, speed)  # type: ignore[arg-type]
    return emulation.state()


CALLS = (
    Call("GET", "/state", "time, pace, and how each device is", Emulation.state),
    Call("POST", "/pause", "hold virtual time", _done(Emulation.pause)),
    Call("POST", "/resume", "let it go on", _done(Emulation.resume)),
    Call(
        *("POST", "/step", "let so many events happen, then hold"),
        lambda emulation, events: {"events": emulation.step(events)},
        {"events": (int, 1)},
    ),
    Call(
        *("POST", "/run", "go on to a virtual time as fast as it gets, then hold"),
        lambda emulation, to_s: emulation.run_to(to_s),
        {"to_s": (NUMBER, REQUIRED)},
    ),
    Call(
        *("POST", "/snapshot", "remember now by a name, to go back to"),
        lambda emulation, name: _done(lambda one: one.snapshot(name))(emulation),
        {"name": (str, REQUIRED)},
    ),
    Call(
        *("POST", "/back", "go back to a time or a snapshot, and hold there"),
        lambda emulation, to: emulation.back(to),
        {"to": ((int, float, str), REQUIRED)},
    ),
    Call(
        *("POST", "/pace", "real: speed virtual seconds a second; fast: ahead while there is work"),
        _pace,
        {"pace": (str, "real"), "speed": (NUMBER, 1.0)},
    ),
    Call("GET", "/devices/{device}", "ports, faults and channels that it has", Emulation.about),
    Call(
        *("GET", "/devices/{device}/log", "what faults have done, from line `since` on"),
        lambda emulation, device, since: emulation.log(device, int(since)),
        {"since": (NUMBER, 0)},
    ),
    Call("GET", "/devices/{device}/pictures", "those in its memories", Emulation.pictures),
    Call("GET", "/devices/{device}/pictures/{name}", "one, as PNG", Emulation.picture),
    Call("GET", "/devices/{device}/recording", "what passed its ports", Emulation.recording),
    Call(
        *("GET", "/devices/{device}/trace", "a VCD file of a span, done again beside"),
        lambda emulation, device, from_s, to_s: emulation.trace(device, from_s, to_s),
        {"from_s": (NUMBER, REQUIRED), "to_s": (NUMBER, REQUIRED)},
    ),
    Call("GET", "/devices/{device}/scene", "what its cameras see, as a file's", Emulation.scene),
    Call("GET", "/devices/{device}/scene/keys", "keys of scene files", Emulation.scene_keys),
    Call(
        *("POST", "/devices/{device}/scene/look", "where on the sky another scene would be"),
        lambda emulation, device, table: emulation.look(device, table),
        {"table": (dict, REQUIRED)},
    ),
    Call(
        *("GET", "/stars", "stars of the catalogue, the brightest first"),
        lambda _emulation, mag_limit, epoch: stars(mag_limit, epoch),
        {"mag_limit": (NUMBER, 4.0), "epoch": (NUMBER, 2026.0)},
    ),
    Call(
        *("POST", "/devices/{device}/act", "what the shell's fault, scene and power do"),
        _act,
        {"words": (list, REQUIRED), "text": (str, "")},
    ),
)


def control_app(emulation: Emulation) -> Starlette:
    routes = [
        Route(call.path, partial(_answer, emulation, call), methods=[call.method]) for call in CALLS
    ]

    async def about(_request: Request) -> Response:
        told = {"cubestack": version("cubestack"), "calls": [call.about() for call in CALLS]}
        told["devices"] = [one.device.name for one in emulation.emulated]
        return JSONResponse(told)

    async def events(socket: WebSocket) -> None:
        await _events(emulation, socket)

    return Starlette(
        routes=[Route("/", about), *routes, WebSocketRoute("/events", events)],
        exception_handlers={HTTPException: _not_there, Exception: _broken},
    )


async def _answer(emulation: Emulation, call: Call, request: Request) -> Response:
    try:
        body = await request.body()
        given = json.loads(body) if body else _query(request, call)
        values = call.values(given) | request.path_params
        found = await _asked(emulation, partial(call.act, emulation, **values))
        if isinstance(found, Future):
            await asyncio.wrap_future(found)
            found = await _asked(emulation, emulation.state)
        if isinstance(found, np.ndarray):
            return Response(await asyncio.to_thread(png, found), media_type="image/png")
        if isinstance(found, Trace):
            return Response(await asyncio.to_thread(found.make), media_type="text/plain")
        if isinstance(found, tuple):
            return Response(await asyncio.to_thread(_start_of, *found), media_type="text/plain")
        return JSONResponse(found)
    except TooLargeError as error:
        return refused(str(error), HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        return refused(f"the body is no JSON: {error}", HTTPStatus.BAD_REQUEST)
    except ValueError as error:
        return refused(str(error), HTTPStatus.BAD_REQUEST)
    except RuntimeError as error:
        return refused(str(error), HTTPStatus.CONFLICT)


def _query(request: Request, call: Call) -> JsonObject:
    """What a GET has behind its path: numbers; ValueError for what is none."""
    given = request.query_params if call.method == "GET" else {}
    return {name: float(value) for name, value in given.items() if name in call.takes}


def _start_of(path: Path, count: int) -> bytes:
    """The first ``count`` bytes of a file that gets longer."""
    with path.open("rb") as stream:
        return stream.read(count)


async def _asked(emulation: Emulation, act: Callable[[], T]) -> T:
    return await asyncio.wrap_future(emulation.port.call(act))


async def _events(emulation: Emulation, socket: WebSocket) -> None:
    """Tell how it is, again and again, and what faults have done since."""
    try:
        every_s = float(socket.query_params.get("every_s", EVERY_S))
    except ValueError:
        every_s = EVERY_S
    every_s = min(max(every_s, SHORTEST_S), LONGEST_S) if every_s == every_s else EVERY_S
    await socket.accept()
    gone = asyncio.create_task(_until_gone(socket))
    told = dict.fromkeys((one.device.name for one in emulation.emulated), 0)

    def look() -> JsonObject:
        logs = {name: emulation.log(name, since) for name, since in told.items()}
        told.update({name: log["count"] for name, log in logs.items()})
        lines = {name: log["log"] for name, log in logs.items() if log["log"]}
        return {"state": emulation.state(), **({"log": lines} if lines else {})}

    try:
        while not gone.done():
            await socket.send_json(await _asked(emulation, look))
            await asyncio.wait([gone], timeout=every_s)
    except (WebSocketDisconnect, RuntimeError):  # the client has gone, or the emulation
        pass
    finally:
        gone.cancel()


async def _until_gone(socket: WebSocket) -> None:
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


async def _broken(_request: Request, error: Exception) -> Response:
    told = f"{type(error).__name__}: {error}"
    return refused(f"this is a mistake of ours: {told}", HTTPStatus.INTERNAL_SERVER_ERROR)


async def _not_there(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    known = ", ".join(sorted({call.path for call in CALLS}))
    return refused(f"{error.detail}: there is {known}", HTTPStatus(error.status_code))
