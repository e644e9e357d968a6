"""The page's application: targets, what is asked of them, and what they tell, live."""

import asyncio
import base64
import json
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from cubestack.host.errors import HostError
from cubestack.host.ground import relays
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.emulators import SentFile
from cubestack.host.ground.guard import TooLargeError, refused
from cubestack.host.ground.logs import recording, results_table, said_table
from cubestack.host.ground.session import TargetSession

PAGE = Path(__file__).parent / "page"

EVERY_S, SHORTEST_S, LONGEST_S = 1.0, 0.2, 60.0
"""Between two readings of what a tab shows, unless it wants another time; and its limits."""

MOST_SHOWN = 32
"""Telemetry frames that one tab may have read again and again."""

NONSENSE = 1003
"""Closes a WebSocket whose other end sends what can not be taken."""

SHARED = ("time_s", "held", "pace", "speed", "snapshots", "goes_back")
"""Of the state of an emulation, what all its devices have in common."""


def page_app(sessions: "Sequence[Future[TargetSession]]") -> Starlette:
    """The application, without a guard; its targets may still be about to open."""

    async def page(_request: Request) -> Response:
        return FileResponse(PAGE / "index.html")

    async def targets(_request: Request) -> Response:
        return JSONResponse([(await _opened(session)).about for session in sessions])

    def of(handler: Any) -> Any:
        async def answer(request: Request) -> Response:
            number = request.path_params["number"]
            if number >= len(sessions):
                return refused(f"there is no target {number}", HTTPStatus.NOT_FOUND)
            return await _told(handler, await _opened(sessions[number]), request)

        return answer

    async def live(socket: WebSocket) -> None:
        number = socket.path_params["number"]
        if number >= len(sessions):
            await socket.close()
            return
        await _live(await _opened(sessions[number]), socket)

    return Starlette(
        routes=[
            Route("/", page),
            Route("/targets", targets),
            Route("/targets/{number:int}/pictures/{name}", of(relays.picture)),
            Route("/targets/{number:int}/recording", of(_recording)),
            Route("/targets/{number:int}/said/{kind}", of(_said)),
            Route("/targets/{number:int}/results/{kind}", of(_results)),
            Route("/targets/{number:int}/trace", of(relays.trace)),
            Route("/targets/{number:int}/found/{name}", of(_found)),
            Route("/targets/{number:int}/sensor-registers/{name}", of(_sensor_register)),
            Route("/targets/{number:int}/carried", of(_carried)),
            Route("/targets/{number:int}/download", of(_download), methods=["POST"]),
            Route("/targets/{number:int}/upload", of(_upload), methods=["POST"]),
            Route("/targets/{number:int}/transfer/{act}", of(_transfer), methods=["POST"]),
            Route("/targets/{number:int}/play", of(_play), methods=["POST"]),
            Route("/targets/{number:int}/do", of(_do), methods=["POST"]),
            Route("/targets/{number:int}/scene", of(relays.scene)),
            Route("/targets/{number:int}/scene", of(relays.show_scene), methods=["POST"]),
            Route("/targets/{number:int}/scene/keys", of(relays.scene_keys)),
            Route("/targets/{number:int}/scene/look", of(relays.look), methods=["POST"]),
            Route("/targets/{number:int}/stars", of(relays.stars)),
            Route("/targets/{number:int}/restart", of(_restart), methods=["POST"]),
            Route("/targets/{number:int}/{call:str}", of(relays.steer), methods=["POST"]),
            WebSocketRoute("/targets/{number:int}/live", live),
            Mount("/page", StaticFiles(directory=PAGE)),
        ],
        exception_handlers={HTTPException: _not_there},
    )


async def _opened(session: "Future[TargetSession]") -> TargetSession:
    return await asyncio.shield(asyncio.wrap_future(session))


async def _told(handler: Any, session: TargetSession, request: Request) -> Response:
    """The answer of a handler, or what is wrong in words."""
    try:
        body = json.loads(await request.body() or b"{}") or dict(request.query_params)
        if not isinstance(body, dict):
            raise ValueError("the body is a JSON object")
        found = await handler(session, body, request.path_params)
        return found if isinstance(found, Response) else JSONResponse(found)
    except TooLargeError as error:
        return refused(str(error), HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        return refused(f"the body is no JSON: {error}", HTTPStatus.BAD_REQUEST)
    except HostError as error:
        return refused(str(error), HTTPStatus.BAD_GATEWAY)
    except ValueError as error:
        return refused(str(error), HTTPStatus.BAD_REQUEST)


async def _do(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    line = body.get("line")
    if not isinstance(line, str):
        raise ValueError("'line' is a line of the shell")
    return await asyncio.wrap_future(session.do(line))


async def _restart(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    options, files = body.get("options", {}), body.get("files", {})
    if not isinstance(options, dict) or not isinstance(files, dict):
        raise ValueError("'options' and 'files' are objects by the options' names")
    sent = {name: _sent(one) for name, one in files.items()}
    return await asyncio.wrap_future(session.restart(options, sent))


def _sent(one: object) -> SentFile:
    parts = (
        [one.get(key, "") for key in ("name", "content", "suffix")] if isinstance(one, dict) else []
    )
    if not parts or not all(isinstance(part, str) for part in parts):
        raise ValueError("a file has 'name', 'content' in base 64, and 'suffix'")
    name, content, suffix = parts
    return SentFile(name, base64.b64decode(content, validate=True), suffix)


async def _play(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    to_s, runs = body.get("to_s"), body.get("runs")
    if session.played is None:
        raise ValueError(f"{session.target.name} is no recording")
    if not isinstance(to_s, int | float | None) or not isinstance(runs, bool):
        raise ValueError("'to_s' is a time in s, 'runs' true or false")
    session.played.play(to_s, runs)
    return session.played.state


async def _found(session: TargetSession, _body: JsonObject, path: JsonObject) -> JsonObject:
    return await asyncio.wrap_future(session.found(path["name"]))


async def _sensor_register(
    session: TargetSession, _body: JsonObject, path: JsonObject
) -> JsonObject:
    return await asyncio.wrap_future(session.sensor_register(path["name"]))


async def _recording(session: TargetSession, _body: JsonObject, _path: JsonObject) -> Response:
    content = await asyncio.to_thread(recording, session)
    return Response(content, media_type="text/plain", headers=_file(session, "rec"))


async def _said(session: TargetSession, _body: JsonObject, path: JsonObject) -> Response:
    return await _table(session, said_table, path["kind"])


async def _results(session: TargetSession, _body: JsonObject, path: JsonObject) -> Response:
    return await _table(session, results_table, path["kind"])


async def _table(
    session: TargetSession, make: Callable[[TargetSession, str], bytes], kind: str
) -> Response:
    content = await asyncio.to_thread(make, session, kind)
    media = "text/csv" if kind == "csv" else "application/vnd.apache.parquet"
    return Response(content, media_type=media, headers=_file(session, kind))


async def _download(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    return session.transfer("download", body.get("source")).state


async def _upload(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    text = body.get("picture")
    if not isinstance(text, str):
        raise ValueError("'picture' is a picture file in base 64")
    content = base64.b64decode(text, validate=True)
    return (await asyncio.to_thread(session.transfer, "upload", None, content)).state


async def _transfer(session: TargetSession, _body: JsonObject, path: JsonObject) -> JsonObject:
    if session.carried is None:
        raise ValueError("no picture is on its way")
    acts = {
        "hold": session.carried.hold,
        "go-on": session.carried.go_on,
        "give-up": session.carried.give_up,
    }
    if path["act"] not in acts:
        raise ValueError(f"no act {path['act']!r}; there are {', '.join(acts)}")
    acts[path["act"]]()
    return session.carried.state


async def _carried(session: TargetSession, _body: JsonObject, _path: JsonObject) -> Response:
    if session.carried is None or session.carried.picture is None:
        raise ValueError("no picture has come over the wire")
    return Response(session.carried.picture, media_type="image/png", headers=_file(session, "png"))


def _file(session: TargetSession, kind: str) -> dict[str, str]:
    name = f"{session.target.interface.name.lower()}.{kind}"
    return {"content-disposition": f'attachment; filename="{name}"'}


async def _live(session: TargetSession, socket: WebSocket) -> None:
    """Tell a tab again and again what it shows, until it is gone."""
    await socket.accept()
    wanted, logged, begun = Wanted(), 0, session.begun
    hears = asyncio.create_task(socket.receive_json())
    clock = asyncio.get_running_loop().time
    try:
        while True:
            begin_s = clock()
            if hears.done():
                wanted = _wanted(hears.result(), session)
                hears = asyncio.create_task(socket.receive_json())
            if session.begun != begun:
                logged, begun = 0, session.begun
            told: JsonObject = {"link": session.health, "begun": begun}
            carried = session.carried
            told["carried"] = carried.state if carried else None
            told["played"] = session.played.state if session.played else None
            if session.controls is not None:
                told |= await asyncio.to_thread(_emulation, session, logged)
                logged = told.get("logged", logged)
            held = told.get("emulation", {}).get("held", False)  # nobody would answer
            free = not held and (carried is None or not carried.runs)
            if wanted.show and free:
                told["values"] = await asyncio.wrap_future(session.read(wanted.show))
            if wanted.results and free:
                told["results"] = await asyncio.wrap_future(session.results())
                session.log.add(told["results"], told.get("emulation", {}).get("truth", {}))
            told["kept"] = session.log.count
            await socket.send_json(told)
            rest_s = begin_s + wanted.every_s - clock()
            await asyncio.wait([hears], timeout=max(rest_s, 0.0))
    except (WebSocketDisconnect, RuntimeError):
        pass  # it is gone
    except ValueError:
        await socket.close(NONSENSE)
    finally:
        hears.cancel()


def _emulation(session: TargetSession, logged: int) -> JsonObject:
    """How the emulation is, and what its faults have done since line ``logged``."""
    assert session.controls is not None
    client, device = session.controls.client, session.controls.device
    try:
        state = client.ask("GET", "/state")
        log = client.ask("GET", f"/devices/{device}/log?since={logged}")
        pictures = client.ask("GET", f"/devices/{device}/pictures")["pictures"]
    except (HostError, ValueError) as error:
        return {"emulation": {"error": str(error)}}
    own = state["devices"][device]
    emulation = {name: state[name] for name in SHARED} | own
    seen = {"pictures": pictures, "log": log["log"], "logged": log["count"]}
    return {"emulation": emulation, **seen}


@dataclass(frozen=True)
class Wanted:
    """What a tab wants to be told: telemetry by name, results, and how often."""

    show: Sequence[str] = ()
    results: bool = False
    every_s: float = EVERY_S


def _wanted(message: object, session: TargetSession) -> Wanted:
    """What a tab says that it wants; ValueError for nonsense."""
    if not isinstance(message, dict):
        raise ValueError("a tab sends objects")
    show, every_s = message.get("show", []), message.get("every_s", EVERY_S)
    if not isinstance(show, list) or not isinstance(every_s, int | float):
        raise ValueError("'show' is a list of names, 'every_s' a number")
    known = {one.name for one in session.target.interface.telemetries}
    names = [name for name in show if name in known][:MOST_SHOWN]
    results = bool(message.get("results")) and "results" not in session.about["missing"]
    return Wanted(names, results, min(max(float(every_s), SHORTEST_S), LONGEST_S))


async def _not_there(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return refused(error.detail, HTTPStatus(error.status_code))
