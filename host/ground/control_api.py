"""The control port: JSON over HTTP, and a WebSocket with the state of the emulation.

`CALLS` declares all calls with their arguments; ``GET /`` lists them.
"""

import asyncio
import math
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

from cubestack.firmware_model.formats.setup import files_of
from cubestack.firmware_model.formats.untrusted import parse_json
from cubestack.firmware_model.versions import CONTROL
from cubestack.host.ground import scenes
from cubestack.host.ground.emulation import Emulation, JsonObject
from cubestack.host.ground.guard import refusal, refused
from cubestack.host.ground.traces import Trace
from cubestack.host.pictures.images import png

T = TypeVar("T")

EVERY_S, SHORTEST_S, LONGEST_S = 0.2, 0.05, 60.0
"""Default, lowest and highest interval between two messages of ``/events``."""

REQUIRED = object()


@dataclass(frozen=True)
class Call:
    """A call of the control port.

    Attributes:
        method, path: of the request.
        meaning: one phrase.
        act: (emulation, arguments) -> the answer, or a future; runs in the emulation's thread.
        takes: type and default, or `REQUIRED`, of each member of the body or number in the query.
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
        """Arguments from a request's body; raises ValueError for an invalid one."""
        if not isinstance(body, dict):
            raise ValueError(
                f"the body must be a JSON object with {', '.join(self.takes) or 'nothing'}"
            )
        for name in body:
            if name not in self.takes:
                known = ", ".join(self.takes) or "none"
                raise ValueError(f"{self.path} has no member {name!r}; known: {known}")
        values = {}
        for name, (types, default) in self.takes.items():
            if name not in body and default is REQUIRED:
                raise ValueError(f"{self.path} needs {name!r}")
            value = body.get(name, default)
            if not isinstance(value, types) or (isinstance(value, bool) and types is not bool):
                raise ValueError(f"{name!r} of {self.path} must be {KINDS[types]}, not {value!r}")
            values[name] = value
        return values


NUMBER = (int, float)

TIME_OR_NAME = (int, float, str)

KINDS: Mapping[type | tuple[type, ...], str] = {
    **{int: "an integer", NUMBER: "a number", TIME_OR_NAME: "a number or a text"},
    **{str: "a text", list: "a list", dict: "an object"},
}


def _words(value: list[Any]) -> list[str]:
    if not all(isinstance(word, str) for word in value):
        raise ValueError("'words' must be texts")
    return value


def _act(
    emulation: Emulation, device: str, words: list[Any], text: str, files: JsonObject
) -> JsonObject:
    emulation.act(device, _words(words), text, files_of({"files": files}))
    return emulation.state()


def _then_state(act: Callable[..., None]) -> Callable[..., JsonObject]:
    def call(emulation: Emulation, **arguments: Any) -> JsonObject:
        act(emulation, **arguments)
        return emulation.state()

    return call


def _pace(emulation: Emulation, pace: str, speed: float) -> JsonObject:
    if pace not in ("real", "fast"):
        raise ValueError(f"pace must be real or fast, not {pace!r}")
    emulation.port.set_pace(pace, speed)  # type: ignore[arg-type]
    return emulation.state()


CALLS = (
    Call("GET", "/state", "time, pace, and state of each device", Emulation.state),
    Call(
        "POST", "/pause", "hold virtual time", _then_state(lambda emulation: emulation.port.pause())
    ),
    Call(
        "POST",
        "/resume",
        "resume virtual time",
        _then_state(lambda emulation: emulation.port.resume()),
    ),
    Call(
        *("POST", "/step", "run a number of events, then hold"),
        lambda emulation, events: {"events": emulation.port.step(events)},
        {"events": (int, 1)},
    ),
    Call(
        *("POST", "/run", "run to a virtual time as fast as possible, then hold"),
        Emulation.run_to,
        {"to_s": (NUMBER, REQUIRED)},
    ),
    Call(
        *("POST", "/snapshot", "save the current time under a name"),
        _then_state(Emulation.snapshot),
        {"name": (str, REQUIRED)},
    ),
    Call(
        *("POST", "/back", "go back to a time or a snapshot, then hold"),
        Emulation.back,
        {"to": (TIME_OR_NAME, REQUIRED)},
    ),
    Call(
        *("POST", "/pace", "pace: real, with a speed, or fast"),
        _pace,
        {"pace": (str, "real"), "speed": (NUMBER, 1.0)},
    ),
    Call("GET", "/devices/{device}", "its ports, faults and supply channels", Emulation.about),
    Call(
        *("GET", "/devices/{device}/log", "log of faults, from line `since` on"),
        lambda emulation, device, since: emulation.log(device, int(since)),
        {"since": (NUMBER, 0)},
    ),
    Call("GET", "/devices/{device}/pictures", "images in its memories", Emulation.pictures),
    Call("GET", "/devices/{device}/pictures/{name}", "an image, as PNG", Emulation.picture),
    Call("GET", "/devices/{device}/pins", "levels at the pins of a bare part", Emulation.pins),
    Call("GET", "/devices/{device}/recording", "recording of its ports", Emulation.recording),
    Call(
        *("GET", "/devices/{device}/trace", "VCD file of a past time span"),
        Emulation.trace,
        {"from_s": (NUMBER, REQUIRED), "to_s": (NUMBER, REQUIRED)},
    ),
    Call(
        *("GET", "/devices/{device}/scene", "current scene, as a table"),
        lambda emulation, device: scenes.present(emulation.of(device)),
    ),
    Call(
        *("GET", "/devices/{device}/scene/keys", "keys of scene files"),
        lambda emulation, device: scenes.keys(emulation.of(device).device),
    ),
    Call(
        *("POST", "/devices/{device}/scene/look", "position of another scene on the sky"),
        lambda emulation, device, table: scenes.look(emulation.of(device), table),
        {"table": (dict, REQUIRED)},
    ),
    Call(
        *("GET", "/stars", "stars of the catalogue, brightest first"),
        lambda _emulation, mag_limit, epoch: scenes.stars(mag_limit, epoch),
        {"mag_limit": (NUMBER, 4.0), "epoch": (NUMBER, 2026.0)},
    ),
    Call(
        *("POST", "/devices/{device}/act", "the shell's commands fault, scene, point, power, pin"),
        _act,
        {"words": (list, REQUIRED), "text": (str, ""), "files": (dict, {})},
    ),
)


def control_app(emulation: Emulation) -> Starlette:
    routes = [
        Route(call.path, partial(_answer, emulation, call), methods=[call.method]) for call in CALLS
    ]

    async def about(_request: Request) -> Response:
        content: JsonObject = {"cubestack": version("cubestack"), "version": CONTROL.current}
        content |= {"calls": [call.about() for call in CALLS]}
        content["devices"] = [one.device.name for one in emulation.emulated]
        return JSONResponse(content)

    async def events(socket: WebSocket) -> None:
        await _events(emulation, socket)

    return Starlette(
        routes=[Route("/", about), *routes, WebSocketRoute("/events", events)],
        exception_handlers={HTTPException: _http_error, Exception: _internal_error},
    )


async def _answer(emulation: Emulation, call: Call, request: Request) -> Response:
    try:
        body = await request.body()
        given = parse_json(body, "the body") if body else _query(request, call)
        values = call.values(given) | request.path_params
        answer = await _in_emulation(emulation, partial(call.act, emulation, **values))
        if isinstance(answer, Future):
            await asyncio.wrap_future(answer)
            answer = await _in_emulation(emulation, emulation.state)
        if isinstance(answer, np.ndarray):
            return Response(await asyncio.to_thread(png, answer), media_type="image/png")
        if isinstance(answer, Trace):
            return Response(await asyncio.to_thread(answer.render), media_type="text/plain")
        if isinstance(answer, tuple):
            return Response(await asyncio.to_thread(_start_of, *answer), media_type="text/plain")
        return JSONResponse(answer)
    except (ValueError, RuntimeError, ArithmeticError) as error:
        return refusal(error)


def _query(request: Request, call: Call) -> JsonObject:
    """Numbers in the query of a GET; raises ValueError for other values."""
    given = request.query_params if call.method == "GET" else {}
    numbers = {name: float(value) for name, value in given.items() if name in call.takes}
    for name, value in numbers.items():
        if not math.isfinite(value):
            raise ValueError(f"{name!r} of {call.path} must be a finite number, not {value}")
    return numbers


def _start_of(path: Path, count: int) -> bytes:
    with path.open("rb") as stream:
        return stream.read(count)


async def _in_emulation(emulation: Emulation, act: Callable[[], T]) -> T:
    return await asyncio.wrap_future(emulation.port.call(act))


async def _events(emulation: Emulation, socket: WebSocket) -> None:
    """Send the state and new lines of the fault logs until the client disconnects."""
    try:
        every_s = float(socket.query_params.get("every_s", EVERY_S))
    except ValueError:
        every_s = EVERY_S
    every_s = min(max(every_s, SHORTEST_S), LONGEST_S) if math.isfinite(every_s) else EVERY_S
    await socket.accept()
    closed = asyncio.create_task(_until_closed(socket))
    sent = dict.fromkeys((one.device.name for one in emulation.emulated), 0)

    def look() -> JsonObject:
        logs = {name: emulation.log(name, since) for name, since in sent.items()}
        sent.update({name: log["count"] for name, log in logs.items()})
        lines = {name: log["log"] for name, log in logs.items() if log["log"]}
        return {"state": emulation.state(), **({"log": lines} if lines else {})}

    try:
        while not closed.done():
            await socket.send_json(await _in_emulation(emulation, look))
            await asyncio.wait([closed], timeout=every_s)
    except (WebSocketDisconnect, RuntimeError):  # the client disconnected, or the emulation ended
        pass
    finally:
        closed.cancel()


async def _until_closed(socket: WebSocket) -> None:
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


async def _internal_error(_request: Request, error: Exception) -> Response:
    text = f"internal error: {type(error).__name__}: {error}"
    return refused(text, HTTPStatus.INTERNAL_SERVER_ERROR)


async def _http_error(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    known = ", ".join(sorted({call.path for call in CALLS}))
    return refused(f"{error.detail}; known: {known}", HTTPStatus(error.status_code))
