"""Access control: a request needs the token, this machine's name as host, and our own origin.

Otherwise any page in the user's browser could reach a port on loopback: by DNS rebinding, or by a
request whose answer it need not read.
"""

import asyncio
import secrets
from collections.abc import Iterable
from dataclasses import dataclass, field
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cubestack.host.errors import HostError
from cubestack.host.ground.serving import AUTHORISED, loopback_name

COOKIE = "cubestack"
"""Prefix of its name; the port follows, as browsers send a cookie to all ports of a host."""

LARGEST_BODY = 8 << 20
"""Bytes; enough for an image of any sensor, as PNG or raw."""

BODY_S = 10.0
"""Time-out of a body, wall time in s."""

POLICY = "; ".join(
    (
        *("default-src 'self'", "img-src 'self' data: blob:", "connect-src 'self'"),
        *("frame-ancestors 'none'", "base-uri 'none'", "form-action 'none'", "object-src 'none'"),
    )
)
"""The page loads nothing from elsewhere and runs no inline script."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}

UNAUTHORISED_CLOSE = 4401
"""Close code of a WebSocket that corresponds to HTTP status 401."""


def new_token() -> str:
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Guard:
    """An ASGI application that passes authorised requests on to ``app``.

    Attributes:
        app: the guarded application.
        token: required in ``Authorization: Bearer``, or in the address of the page as ``?token=``,
            upon which the server sets a cookie for further requests.
        any_host: accept any host name in requests.
        session: value of that cookie, valid as long as the server runs. Browsers send a cookie to
            all ports of a host, so it must not be the token.
    """

    app: ASGIApp
    token: str
    any_host: bool = False
    session: str = field(default_factory=new_token)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        refusal = self._refusal(scope, headers)
        if refusal is None:
            scope[AUTHORISED] = True
            await self._pass_on(scope, receive, _Answer(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": UNAUTHORISED_CLOSE})
        else:
            # Nobody waits for the body of a request that is rejected.
            refusal.headers["Connection"] = "close"
            await refusal(scope, receive, _Answer(send))

    async def _pass_on(self, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        limited = _Limited(receive) if scope["type"] == "http" else receive
        try:
            await self.app(scope, limited, answer)
        except Exception as error:
            if scope["type"] == "websocket" or answer.begun:
                raise
            text = f"internal error: {type(error).__name__}: {error}"
            await refused(text, HTTPStatus.INTERNAL_SERVER_ERROR)(scope, receive, answer)

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        host, cookie = _host_and_cookie(headers.get("host", ""))
        if not self.any_host and not loopback_name(host):
            return refused(f"this server is not {host}", HTTPStatus.MISDIRECTED_REQUEST)
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != headers.get("host"):
            return refused(f"requests from {origin} are rejected", HTTPStatus.FORBIDDEN)
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if scope["type"] == "http" and scope["method"] == "GET" and self._is_token(given):
            # Browsers show and store addresses, so the token is removed from this one.
            path = "/" + scope["path"].lstrip("/\\")  # two slashes would begin a host's name
            answer = RedirectResponse(path, HTTPStatus.SEE_OTHER)
            answer.set_cookie(cookie, self.session, httponly=True, samesite="strict")
            return answer
        bearer = headers.get("authorization", "").partition(" ")
        cookies = cookie_parser(headers.get("cookie", ""))
        known = _is_one(self.session, [cookies.get(cookie, "")])
        if known or (bearer[0].lower() == "bearer" and self._is_token([bearer[2]])):
            return None
        return refused("a token is needed; open the printed address", HTTPStatus.UNAUTHORIZED)

    def _is_token(self, given: Iterable[str]) -> bool:
        return _is_one(self.token, given)


def _is_one(secret: str, given: Iterable[str]) -> bool:
    own = secret.encode()
    return any(secrets.compare_digest(one.encode("utf-8", "replace"), own) for one in given)


def _host_and_cookie(host: str) -> tuple[str, str]:
    """The host name in a request, and the name of its cookie; as given if it is no host."""
    try:
        parts = urlsplit(f"//{host}")
        return parts.hostname or "", f"{COOKIE}-{parts.port}"
    except ValueError:  # no address, or a port out of range
        return host, COOKIE


class TooLargeError(ValueError):
    """A body above `LARGEST_BODY`."""


class TooSlowError(ValueError):
    """A body that did not arrive within `BODY_S`."""


STATUS = {
    TooSlowError: HTTPStatus.REQUEST_TIMEOUT,
    TooLargeError: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    HostError: HTTPStatus.BAD_GATEWAY,
    RuntimeError: HTTPStatus.CONFLICT,
}
"""Of the answer by the error; of others, 400."""


class _Limited:
    """Raises TooLargeError for a body above `LARGEST_BODY`, TooSlowError after `BODY_S`."""

    def __init__(self, receive: Receive) -> None:
        self._receive, self._count = receive, 0
        self._deadline_s: float | None = asyncio.get_running_loop().time() + BODY_S

    async def __call__(self) -> Message:
        try:
            async with asyncio.timeout_at(self._deadline_s):
                message = await self._receive()
        except TimeoutError:
            raise TooSlowError(f"the body must arrive within {BODY_S:g} s") from None
        self._count += len(message.get("body", b""))
        if self._count > LARGEST_BODY:
            raise TooLargeError(f"the body must be at most {LARGEST_BODY} bytes")
        if not message.get("more_body", False):
            self._deadline_s = None  # what follows is the end of the connection
        return message


class _Answer:
    """Sends an answer with `HEADERS`."""

    def __init__(self, send: Send) -> None:
        self._send, self.begun = send, False

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.begun = True
            own = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *own]}
        await self._send(message)


def refusal(error: Exception) -> Response:
    """The answer to a request that raised ``error``."""
    for kind, status in STATUS.items():
        if isinstance(error, kind):
            answer = refused(str(error), status)
            if isinstance(error, TooSlowError | TooLargeError):
                answer.headers["Connection"] = "close"
            return answer
    return refused(str(error), HTTPStatus.BAD_REQUEST)


def refused(why: str, status: HTTPStatus) -> Response:
    """An answer with the member ``error``."""
    text = why.encode("utf-8", "backslashreplace").decode()
    return JSONResponse({"error": text}, status)
