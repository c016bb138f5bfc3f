"""Who may ask the workbench: this machine's own page with the token of this start, and nobody else."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Middleware

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
TOKEN_HEADER = "X-Pneucli-Token"
MAX_BODY = 65_536  # bytes of a request of the page; recordings that are dropped have a limit of their own
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors {ancestors}"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Guard:
    """The rule of one server.

    Attributes:
        token: The random token of this start.
        host: The address that the server listens at.
        framed: Whether a page of this machine, such as a notebook, may show the workbench in a frame.

    """

    token: str
    host: str
    framed: bool = False

    def refusal(self, request: web.Request) -> str:
        """Return why a request is refused; empty where it is not."""
        host = request.headers.get("Host", "")
        if not self._is_own_host(host):
            return "this address is not that of the workbench"
        origin = request.headers.get("Origin")
        if origin is not None and origin != f"http://{host}":
            return "another page may not ask the workbench"
        if request.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin") and not self._is_page(request):
            return "another page may not ask the workbench"
        given = request.headers.get(TOKEN_HEADER) or request.query.get("token", "")
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            return "the token is missing or belongs to an earlier workbench; take the address that the terminal shows"
        return ""

    @staticmethod
    def _is_page(request: web.Request) -> bool:
        """Return whether the request is that for the page itself, to which a link of a notebook may lead."""
        return request.method == "GET" and request.path == "/"

    def _is_own_host(self, host: str) -> bool:
        """Return whether a request names this server: by name, a foreign page could lead its own name here."""
        name = urlsplit(f"//{host}").hostname or ""
        if self.host in LOOPBACK:
            return name in LOOPBACK
        if name == self.host or name in LOOPBACK:
            return True
        try:
            return ipaddress.ip_address(self.host).is_unspecified and bool(ipaddress.ip_address(name))
        except ValueError:
            return False

    def headers(self) -> dict[str, str]:
        """Return the headers of every answer."""
        ancestors = "http://localhost:* http://127.0.0.1:*" if self.framed else "'none'"
        return {name: value.format(ancestors=ancestors) for name, value in HEADERS.items()}

    def middleware(self) -> Middleware:
        """Return the middleware through which every request goes, those of the websocket as well."""

        @web.middleware
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            if why := self.refusal(request):
                return web.json_response({"error": why}, status=403, headers=self.headers())
            try:
                response = await handler(request)
            except web.HTTPException as error:
                return web.json_response({"error": error.reason}, status=error.status, headers=self.headers())
            if not response.prepared:
                for name, value in self.headers().items():
                    response.headers.setdefault(name, value)
            return response

        return guard
