"""The workbench while it runs: the pages that are open, the one command, the changes by other programs, the end."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar

from aiohttp import WSCloseCode, web

from pneucli.errors import InputError
from pneucli.workbench.bench import DROPPED, Bench
from pneucli.workbench.guards import Guard

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
