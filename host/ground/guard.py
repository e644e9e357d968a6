"""Access control: a request needs the token, this machine's name as host, and our own origin.

Otherwise any page in the user's browser could reach a port on loopback: by DNS rebinding, or by a
request whose answer it need not read.
"""

import json
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cubestack.host.errors import HostError
from cubestack.host.ground.serving import loopback_name

COOKIE = "cubestack"
"""Prefix of its name; the port follows, as browsers send a cookie to all ports of a host."""

LARGEST_BODY = 8 << 20
"""Bytes; enough for an image of any sensor, as PNG or raw."""

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
        token: required in ``Authorization: Bearer``, or in the cookie that the server sets when
            the page is opened with ``?token=``.
        any_host: accept any host name in requests.
    """

    app: ASGIApp
    token: str
    any_host: bool = False

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        refusal = self._refusal(scope, headers)
        if refusal is None:
            await self.app(scope, _Limited(receive), _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": UNAUTHORISED_CLOSE})
        else:
            await refusal(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        host, cookie = _host_and_cookie(headers.get("host", ""))
        if not self.any_host and not loopback_name(host):
            return refused(f"this server is not {host}", HTTPStatus.MISDIRECTED_REQUEST)
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != headers.get("host"):
            return refused(f"requests from {origin} are rejected", HTTPStatus.FORBIDDEN)
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if scope["type"] == "http" and scope["method"] == "GET" and self._is_token(given):
            # Browsers show and store addresses, so the token is removed from this one.
            answer = RedirectResponse(scope["path"], HTTPStatus.SEE_OTHER)
            answer.set_cookie(cookie, self.token, httponly=True, samesite="strict")
            return answer
        bearer = headers.get("authorization", "").partition(" ")
        cookies = cookie_parser(headers.get("cookie", ""))
        if self._is_token(
            [bearer[2] if bearer[0].lower() == "bearer" else "", cookies.get(cookie, "")]
        ):
            return None
        return refused("a token is needed; open the printed address", HTTPStatus.UNAUTHORIZED)

    def _is_token(self, given: Iterable[str]) -> bool:
        own = self.token.encode()
        return any(secrets.compare_digest(one.encode("utf-8", "replace"), own) for one in given)


def _host_and_cookie(host: str) -> tuple[str, str]:
    """The host name in a request, and the name of its cookie."""
    parts = urlsplit(f"//{host}")
    try:
        return parts.hostname or "", f"{COOKIE}-{parts.port}"
    except ValueError:  # the port is out of range
        return parts.hostname or "", COOKIE


class TooLargeError(ValueError):
    """A body above `LARGEST_BODY`."""


STATUS = {
    TooLargeError: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    HostError: HTTPStatus.BAD_GATEWAY,
    RuntimeError: HTTPStatus.CONFLICT,
}
"""Of the answer by the error; of others, 400."""


class _Limited:
    """Raises TooLargeError for a body above `LARGEST_BODY`."""

    def __init__(self, receive: Receive) -> None:
        self._receive, self._count = receive, 0

    async def __call__(self) -> Message:
        message = await self._receive()
        self._count += len(message.get("body", b""))
        if self._count > LARGEST_BODY:
            raise TooLargeError(f"the body must be at most {LARGEST_BODY} bytes")
        return message


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *own]}
        await send(message)

    return send_with_headers


def refusal(error: Exception) -> Response:
    """The answer to a request that raised ``error``."""
    if isinstance(error, UnicodeDecodeError | json.JSONDecodeError | RecursionError):
        return refused(f"the body is not valid JSON: {error}", HTTPStatus.BAD_REQUEST)
    for kind, status in STATUS.items():
        if isinstance(error, kind):
            return refused(str(error), status)
    return refused(str(error), HTTPStatus.BAD_REQUEST)


def refused(why: str, status: HTTPStatus) -> Response:
    """An answer with the member ``error``."""
    return JSONResponse({"error": why}, status)
