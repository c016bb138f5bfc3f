"""The workbench while it runs: who may ask it, its open pages, the one command, outside changes, the end."""

import asyncio
import hmac
import ipaddress
import time
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar
from urllib.parse import urlsplit

from aiohttp import WSCloseCode, web
from aiohttp.typedefs import Middleware

from pneucli.errors import InputError
from pneucli.workbench.bench import DROPPED, Bench

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


T = TypeVar("T")
WATCH_INTERVAL = 1.0  # s, between two looks whether another program changed something
LAST_PAGE_DELAY = 4.0  # s, after which a page that was closed does not come back, as one that is loaded anew does
FIRST_PAGE_DELAY = 600.0  # s, in which the first page has to come
HEARTBEAT = 20.0  # s, after which a page that does not answer counts as closed
MAX_PAGES = 16  # pages at a time


@dataclass
class Workbench:
    """The server's parts: the bench, who may ask, the pages that are open.

    Attributes:
        bench: The pipeline.
        guard: Who may ask.
        keep: Whether it goes on after the last page was closed.
        say: Takes messages for the terminal.
        pages: The websockets of the pages that are open.
        ended: Set when it is to end.
        live: The thread of what follows the hand.
        other: The thread of everything else.
        busy: Whether a command runs, or is about to.

    """

    bench: Bench
    guard: Guard
    keep: bool = False
    say: Callable[[str], None] = lambda text: None
    pages: set[web.WebSocketResponse] = field(default_factory=set)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    live: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1, "live"))
    other: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1, "other"))
    _tasks: set[asyncio.Task[Any]] = field(default_factory=set)
    busy: bool = False
    _closed_at: float = field(default_factory=lambda: time.monotonic() + FIRST_PAGE_DELAY)

    async def start(self, app: web.Application) -> None:
        """Begin to watch, and load the model."""
        self.spawn(self._watch())
        self.spawn(self._first_fit())

    async def stop(self, app: web.Application) -> None:
        """End the command that runs, and take leave of the pages."""
        await self.bench.runner.cancel()
        for page in set(self.pages):
            await page.close(code=WSCloseCode.GOING_AWAY, message=b"the workbench has ended")
        for task in (tasks := set(self._tasks)):
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        self.live.shutdown(wait=False, cancel_futures=True)
        self.other.shutdown(wait=False, cancel_futures=True)

    def spawn(self, work: Awaitable[Any]) -> None:
        """Begin a work that nobody waits for."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _first_fit(self) -> None:
        """Load the model; where it was never compared, or the file or its data have changed since, fit it then."""
        await self.in_live(self.bench.refresh)
        self.tell()
        if await self.in_other(self._is_stale):
            await self.run("fit", [])

    def _is_stale(self) -> bool:
        with suppress(InputError):
            return bool(self.bench.open_pipeline().stage_status(["compare"])["compare"].reasons)
        return False

    async def in_live(self, work: Callable[[], T]) -> T:
        """Do a work in the thread of what follows the hand."""
        return await asyncio.get_running_loop().run_in_executor(self.live, work)

    async def in_other(self, work: Callable[[], T]) -> T:
        """Do a work in the thread of everything else."""
        return await asyncio.get_running_loop().run_in_executor(self.other, work)

    # news

    def tell(self) -> None:
        """Tell every page that there is something new."""
        for page in set(self.pages):
            self.spawn(_send(page, "changed"))

    async def _watch(self) -> None:
        """Notice changes by other programs, and the end of the last page."""
        seen = self.bench.stamp()
        while not self.ended.is_set():
            await asyncio.sleep(WATCH_INTERVAL)
            stamp = self.bench.stamp()
            if stamp != seen and not self.bench.runner.running:
                seen = stamp
                await self.in_live(self.bench.refresh)
                self.tell()
            if not self.pages and not self.keep and time.monotonic() > self._closed_at + LAST_PAGE_DELAY:
                self.say("the last page was closed: the workbench ends (--keep makes it go on)")
                self.ended.set()

    async def events(self, request: web.Request) -> web.StreamResponse:
        """Serve the websocket of one page; nothing that the page sends is read."""
        if len(self.pages) >= MAX_PAGES:
            raise web.HTTPServiceUnavailable(reason=f"{MAX_PAGES} pages are open already")
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT, max_msg_size=1024)
        await socket.prepare(request)
        self.pages.add(socket)
        try:
            await _send(socket, "changed")
            async for _ in socket:
                pass
        finally:
            self.pages.discard(socket)
            self._closed_at = time.monotonic()
        return socket

    def require_idle(self) -> None:
        """Raise InputError where a command runs already."""
        if self.busy or self.bench.runner.running:
            raise InputError("the workbench", "a command runs already", mend="wait for it, or cancel it", code="E006")

    async def run(self, action: str, names: Sequence[str]) -> None:
        """Run a command to its end, and load what it found."""
        self.busy = True
        try:
            await self.bench.run(action, names)
            await self.in_live(self.bench.refresh)
        except (InputError, OSError) as error:  # the file is not what it was when the page asked
            self.bench.problem = str(error)
        finally:
            self.busy = False
            self.tell()

    async def look(self, name: str) -> None:
        """Look at a dropped recording."""
        self.busy = True
        try:
            await self.bench.runner.run(["look", f"{DROPPED}/{name}"])
        finally:
            self.busy = False
            self.tell()


async def _send(page: web.WebSocketResponse, text: str) -> None:
    with suppress(ConnectionError, RuntimeError):
        await page.send_str(text)
