"""Who may ask: only who knows the token, by the name of this machine, from a page of ours.

Without these any page in the user's browser could reach a port on loopback: by a name that leads
there (DNS rebinding), or by a request that it need not read the answer of.
"""

import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cubestack.host.ground.serving import loopback_name

COOKIE = "cubestack"
"""Begins its name; the port follows, as browsers give a cookie to all ports of a host."""

LARGEST_BODY = 8 << 20
"""Bytes: a picture of any of the sensors, as PNG or raw."""

POLICY = "; ".join(
    (
        *("default-src 'self'", "img-src 'self' data: blob:", "connect-src 'self'"),
        *("frame-ancestors 'none'", "base-uri 'none'", "form-action 'none'", "object-src 'none'"),
    )
)
"""What a page of ours may load: nothing from elsewhere, and no script but its files."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}

UNAUTHORISED_CLOSE = 4401
"""Of a WebSocket: the number that programs take for HTTP's 401."""


def new_token() -> str:
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Guard:
    """An ASGI application that passes on what ``app`` may see.

    Attributes:
        app: what is guarded.
        token: that requests have in ``Authorization: Bearer``, or in the cookie which a page gets
            when it is opened with ``?token=``.
        any_host: whether it is asked by other names than this machine's own.
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
        host, cookie = _asked_by(headers.get("host", ""))
        if not self.any_host and not loopback_name(host):
            return refused(f"this is not {host}", HTTPStatus.MISDIRECTED_REQUEST)
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != headers.get("host"):
            return refused(f"not from {origin}", HTTPStatus.FORBIDDEN)
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if scope["type"] == "http" and scope["method"] == "GET" and self._knows(given):
            # The page's address is seen and kept by browsers: the token goes out of it.
            answer = RedirectResponse(scope["path"], HTTPStatus.SEE_OTHER)
            answer.set_cookie(cookie, self.token, httponly=True, samesite="strict")
            return answer
        bearer = headers.get("authorization", "").partition(" ")
        cookies = cookie_parser(headers.get("cookie", ""))
        if self._knows(
            [bearer[2] if bearer[0].lower() == "bearer" else "", cookies.get(cookie, "")]
        ):
            return None
        return refused(
            "a token is needed: open the address that was printed", HTTPStatus.UNAUTHORIZED
        )

    def _knows(self, given: Iterable[str]) -> bool:
        own = self.token.encode()
        return any(secrets.compare_digest(one.encode("utf-8", "replace"), own) for one in given)


def _asked_by(host: str) -> tuple[str, str]:
    """Name of the host that a request names, and of the cookie that is for it."""
    parts = urlsplit(f"//{host}")
    try:
        return parts.hostname or "", f"{COOKIE}-{parts.port}"
    except ValueError:  # no port has such a number
        return parts.hostname or "", COOKIE


class TooLargeError(ValueError):
    """A body that nobody should send."""


class _Limited:
    """The body of a request, up to `LARGEST_BODY`."""

    def __init__(self, receive: Receive) -> None:
        self._receive, self._count = receive, 0

    async def __call__(self) -> Message:
        message = await self._receive()
        self._count += len(message.get("body", b""))
        if self._count > LARGEST_BODY:
            raise TooLargeError(f"more than {LARGEST_BODY} bytes")
        return message


def _with_headers(send: Send) -> Send:
    async def sends(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *own]}
        await send(message)

    return sends


def refused(why: str, status: HTTPStatus) -> Response:
    """An answer that tells what is wrong."""
    return JSONResponse({"error": why}, status)
