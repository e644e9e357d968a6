"""The page's application: requests of the page to targets, and live updates on WebSockets."""

import asyncio
import base64
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

from cubestack.firmware_model.formats.untrusted import parse_json
from cubestack.host.errors import HostError
from cubestack.host.ground import relays
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.emulators import UploadedFile
from cubestack.host.ground.guard import LARGEST_BODY, refusal, refused
from cubestack.host.ground.relays import forward, recording, results_table, transcript_table
from cubestack.host.ground.session import TargetSession

PAGE = Path(__file__).parent / "page"

TARGET = "/targets/{number:int}"

EVERY_S, SHORTEST_S, LONGEST_S = 1.0, 0.2, 60.0
"""Default, lowest and highest interval between two updates of a tab."""

MOST_SHOWN = 32
"""Most telemetry frames per update of a tab."""

INVALID_MESSAGE = 1003
"""Close code of a WebSocket after an invalid message."""

SHARED = ("time_s", "held", "pace", "speed", "snapshots", "goes_back")
"""Members of the state of an emulation that its devices share."""


def page_app(sessions: "Sequence[Future[TargetSession]]") -> Starlette:
    """The application, without ``Guard``; ``sessions`` may still be opening."""

    async def page(_request: Request) -> Response:
        return FileResponse(PAGE / "index.html")

    async def targets(_request: Request) -> Response:
        return JSONResponse([(await _opened(session)).about for session in sessions])

    def of(handler: Any) -> Any:
        async def handle(request: Request) -> Response:
            number = request.path_params["number"]
            if number >= len(sessions):
                return refused(f"no target {number}", HTTPStatus.NOT_FOUND)
            return await _answer(handler, await _opened(sessions[number]), request)

        return handle

    async def live(socket: WebSocket) -> None:
        number = socket.path_params["number"]
        if number >= len(sessions):
            await socket.close()
            return
        await _live(await _opened(sessions[number]), socket)

    def post(path: str, handler: Any) -> Route:
        return Route(f"{TARGET}/{path}", of(handler), methods=["POST"])

    def get(path: str, handler: Any) -> Route:
        return Route(f"{TARGET}/{path}", of(handler))

    return Starlette(
        routes=[
            Route("/", page),
            Route("/targets", targets),
            get("pictures/{name}", relays.picture),
            get("recording", _recording),
            get("transcript/{kind}", _table(transcript_table)),
            get("results/{kind}", _table(results_table)),
            get("trace", relays.trace),
            get("detections/{name}", _detections),
            get("sensor-registers/{name}", _sensor_register),
            get("transfer/image", _image),
            post("download", _download),
            post("upload", _upload),
            post("transfer/{act}", _transfer),
            post("play", _play),
            post("shell", _shell),
            get("scene", forward("GET", "{device}/scene")),
            post("scene", relays.apply_scene),
            get("scene/keys", forward("GET", "{device}/scene/keys")),
            post("scene/look", forward("POST", "{device}/scene/look")),
            get("stars", forward("GET", "/stars")),
            post("observe", _observe),
            post("restart", _restart),
            post("{call:str}", relays.control_time),
            WebSocketRoute(f"{TARGET}/live", live),
            Mount("/page", StaticFiles(directory=PAGE)),
        ],
        exception_handlers={HTTPException: _http_error},
    )


async def _opened(session: "Future[TargetSession]") -> TargetSession:
    return await asyncio.shield(asyncio.wrap_future(session))


async def _answer(handler: Any, session: TargetSession, request: Request) -> Response:
    try:
        content = await request.body() or b"{}"
        body = parse_json(content, "the body", largest=LARGEST_BODY) or dict(request.query_params)
        if not isinstance(body, dict):
            raise ValueError("the body must be a JSON object")
        answer = await handler(session, body, request.path_params)
        return answer if isinstance(answer, Response) else JSONResponse(answer)
    except (ValueError, ArithmeticError, HostError) as error:
        return refusal(error)


async def _shell(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    line = body.get("line")
    if not isinstance(line, str):
        raise ValueError("'line' must be a line of the shell")
    return await asyncio.wrap_future(session.execute(line))


async def _observe(session: TargetSession, _body: JsonObject, _path: JsonObject) -> JsonObject:
    return await asyncio.wrap_future(session.observe())


async def _restart(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    options, files = body.get("options", {}), body.get("files", {})
    if not isinstance(options, dict) or not isinstance(files, dict):
        raise ValueError("'options' and 'files' must be objects by option name")
    uploaded = {name: _uploaded(one) for name, one in files.items()}
    return await asyncio.wrap_future(session.restart(options, uploaded))


def _uploaded(one: object) -> UploadedFile:
    parts = (
        [one.get(key, "") for key in ("name", "content", "suffix")] if isinstance(one, dict) else []
    )
    if not parts or not all(isinstance(part, str) for part in parts):
        raise ValueError("a file must have 'name', 'content' in base 64, and 'suffix'")
    name, content, suffix = parts
    return UploadedFile(name, base64.b64decode(content, validate=True), suffix)


async def _play(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    to_s, runs = body.get("to_s"), body.get("runs")
    if session.playback is None:
        raise ValueError(f"{session.target.name} is not a recording")
    if not isinstance(to_s, int | float | None) or not isinstance(runs, bool):
        raise ValueError("'to_s' must be a time in s, 'runs' true or false")
    session.playback.play(to_s, runs)
    return session.playback.state


async def _detections(session: TargetSession, _body: JsonObject, path: JsonObject) -> JsonObject:
    return await asyncio.wrap_future(session.detections(path["name"]))


async def _sensor_register(
    session: TargetSession, _body: JsonObject, path: JsonObject
) -> JsonObject:
    return await asyncio.wrap_future(session.sensor_register(path["name"]))


async def _recording(session: TargetSession, _body: JsonObject, _path: JsonObject) -> Response:
    content = await asyncio.to_thread(recording, session)
    return Response(content, media_type="text/plain", headers=_file(session, "rec"))


def _table(make: Callable[[TargetSession, str], bytes]) -> Any:
    async def handle(session: TargetSession, _body: JsonObject, path: JsonObject) -> Response:
        kind = path["kind"]
        content = await asyncio.to_thread(make, session, kind)
        media = "text/csv" if kind == "csv" else "application/vnd.apache.parquet"
        return Response(content, media_type=media, headers=_file(session, kind))

    return handle


async def _download(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    return session.start_transfer("download", body.get("source")).state


async def _upload(session: TargetSession, body: JsonObject, _path: JsonObject) -> JsonObject:
    text = body.get("picture")
    if not isinstance(text, str):
        raise ValueError("'picture' must be an image file in base 64")
    content = base64.b64decode(text, validate=True)
    return (await asyncio.to_thread(session.start_transfer, "upload", None, content)).state


async def _transfer(session: TargetSession, _body: JsonObject, path: JsonObject) -> JsonObject:
    if session.transfer is None:
        raise ValueError("no image transfer was started")
    acts = {
        "pause": session.transfer.pause,
        "resume": session.transfer.resume,
        "cancel": session.transfer.cancel,
    }
    if path["act"] not in acts:
        raise ValueError(f"no act {path['act']!r}; known: {', '.join(acts)}")
    acts[path["act"]]()
    return session.transfer.state


async def _image(session: TargetSession, _body: JsonObject, _path: JsonObject) -> Response:
    if session.transfer is None or session.transfer.picture is None:
        raise ValueError("no image was downloaded")
    return Response(session.transfer.picture, media_type="image/png", headers=_file(session, "png"))


def _file(session: TargetSession, kind: str) -> dict[str, str]:
    name = f"{session.target.interface.name.lower()}.{kind}"
    return {"content-disposition": f'attachment; filename="{name}"'}


async def _live(session: TargetSession, socket: WebSocket) -> None:
    """Send updates to a tab until it disconnects."""
    await socket.accept()
    subscription, logged, restarts = Subscription(), 0, session.restarts
    receiving = asyncio.create_task(_message(socket))
    clock = asyncio.get_running_loop().time
    try:
        while True:
            begin_s = clock()
            if receiving.done():
                subscription = _subscription(receiving.result(), session)
                receiving = asyncio.create_task(_message(socket))
            if session.restarts != restarts:
                logged, restarts = 0, session.restarts
            update: JsonObject = {"link": session.health, "restarts": restarts}
            transfer = session.transfer
            update["transfer"] = transfer.state if transfer else None
            update["playback"] = session.playback.state if session.playback else None
            if session.controls is not None:
                update |= await asyncio.to_thread(_emulation, session, logged)
                logged = update.get("logged", logged)
            held = update.get("emulation", {}).get("held", False)  # nothing would answer
            free = not held and (transfer is None or not transfer.runs)
            if subscription.show and free:
                update["values"] = await asyncio.wrap_future(session.read(subscription.show))
            if subscription.results and free:
                update["results"] = await asyncio.wrap_future(session.results())
                update["summary"] = session.summary
                session.log.add(update["results"], update.get("emulation", {}).get("truth", {}))
            update["results_logged"] = session.log.count
            await socket.send_json(update)
            rest_s = begin_s + subscription.every_s - clock()
            await asyncio.wait([receiving], timeout=max(rest_s, 0.0))
    except (WebSocketDisconnect, RuntimeError):
        pass  # the tab has disconnected
    except ValueError:
        await socket.close(INVALID_MESSAGE)
    finally:
        receiving.cancel()


async def _message(socket: WebSocket) -> Any:
    return parse_json(await socket.receive_text(), "the message")


def _emulation(session: TargetSession, logged: int) -> JsonObject:
    """State of the emulation, and lines of its fault log from ``logged`` on."""
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
    more = {"pictures": pictures, "log": log["log"], "logged": log["count"]}
    return {"emulation": emulation, **more}


@dataclass(frozen=True)
class Subscription:
    """Content of a tab's updates: telemetry by name, results; and their interval."""

    show: Sequence[str] = ()
    results: bool = False
    every_s: float = EVERY_S


def _subscription(message: object, session: TargetSession) -> Subscription:
    """Raises ValueError for an invalid message."""
    if not isinstance(message, dict):
        raise ValueError("a message must be an object")
    show, every_s = message.get("show", []), message.get("every_s", EVERY_S)
    if not isinstance(show, list) or not isinstance(every_s, int | float):
        raise ValueError("'show' must be a list of names, 'every_s' a number")
    known = {one.name for one in session.target.interface.telemetries}
    names = [name for name in show if isinstance(name, str) and name in known][:MOST_SHOWN]
    results = bool(message.get("results")) and "results" not in session.about["missing"]
    return Subscription(names, results, min(max(float(every_s), SHORTEST_S), LONGEST_S))


async def _http_error(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return refused(error.detail, HTTPStatus(error.status_code))
