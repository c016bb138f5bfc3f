"""The server of one page: aiohttp on this machine."""

from __future__ import annotations

import asyncio
import os
import secrets
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib.resources import files
from pathlib import Path

from aiohttp import web

from pneucli.errors import InputError
from pneucli.pipeline.runner import Pipeline
from pneucli.workbench.bench import Bench
from pneucli.workbench.commands import CommandRunner
from pneucli.workbench.guards import MAX_BODY, Guard
from pneucli.workbench.lifetime import Workbench
from pneucli.workbench.questions import Questions

HOST = "127.0.0.1"
ASSETS = {
    "uPlot.min.js": ("pneucli.report", "uPlot.iife.min.js", "text/javascript"),
    "plots.js": ("pneucli.report", "plots.js", "text/javascript"),
    "workbench.js": ("pneucli.workbench", "workbench.js", "text/javascript"),
    "uPlot.css": ("pneucli.report", "uPlot.min.css", "text/css"),
    "page.css": ("pneucli.report", "page.css", "text/css"),
    "workbench.css": ("pneucli.workbench", "workbench.css", "text/css"),
}


def application(workbench: Workbench) -> web.Application:
    """Return the application: a page, its files, what it asks and changes, and news."""
    app = web.Application(middlewares=[workbench.guard.middleware()], client_max_size=MAX_BODY)
    app.add_routes(
        [
            web.get("/", partial(_page, workbench.guard.token)),
            web.get("/assets/{name}", _asset),
            web.get("/report", partial(_report, workbench.bench)),
            web.get("/events", workbench.events),
            *Questions(workbench).routes(),
        ]
    )
    app.on_startup.append(workbench.start)
    app.on_shutdown.append(workbench.stop)
    return app


async def _page(token: str, request: web.Request) -> web.Response:
    """Return the page; its files carry the token, too."""
    text = (files("pneucli.workbench") / "assets" / "workbench.html").read_text(encoding="utf-8")
    return web.Response(text=text.replace("{token}", token), content_type="text/html")


async def _asset(request: web.Request) -> web.Response:
    """Return one of the page's own files."""
    try:
        package, name, kind = ASSETS[request.match_info["name"]]
    except KeyError as error:
        raise web.HTTPNotFound(reason="no such file") from error
    text = (files(package) / "assets" / name).read_text(encoding="utf-8")
    return web.Response(text=text, content_type=kind)


async def _report(bench: Bench, request: web.Request) -> web.Response:
    """Return the report as the command wrote it, under its own policy."""
    path = bench.artifacts / "report" / "report.html"
    if not path.is_file():
        raise web.HTTPNotFound(reason="there is no report yet: press Write report")
    own = {"Content-Security-Policy": "frame-ancestors 'none'"}  # the rest stands in the file
    return web.Response(body=path.read_bytes(), content_type="text/html", charset="utf-8", headers=own)


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens; raises InputError where the port is taken or the address is not this machine's."""
    found: socket.socket | None = None
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        found = socket.socket(family, socket.SOCK_STREAM)
        if os.name == "posix":
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((host, port))
    except (OSError, OverflowError) as error:
        if found is not None:
            found.close()
        reason = getattr(error, "strerror", None) or str(error)
        mend = "leave out --port, and a free one is taken" if port else "give an address of this machine"
        raise InputError(f"{host}:{port}", f"cannot listen there: {reason}", "", mend, code="E005") from error
    return found


async def serve(
    file: Path,
    out: Path | None,
    open_pipeline: Callable[[], Pipeline],
    found: socket.socket,
    *,
    host: str = HOST,
    keep: bool = False,
    framed: bool = False,
    say: Callable[[str], None] = lambda text: None,
    ready: Callable[[str, Callable[[], None]], None] = lambda address, end: None,
) -> None:
    """Serve the workbench until its last page is closed.

    Args:
        file: The pipeline file.
        out: The folder of the artifacts; None: the usual one.
        open_pipeline: Opens the file, as its text is at that moment.
        found: The socket of :func:`listen`.
        host: The address that it listens at.
        keep: Go on after the last page was closed.
        framed: Whether a page of this machine may show it in a frame.
        say: Takes messages for the terminal.
        ready: Called once with the address and with what ends the server.

    """
    token = secrets.token_urlsafe(24)
    runner = CommandRunner(file.parent)
    bench = Bench(file, out, open_pipeline, runner)
    workbench = Workbench(bench, Guard(token, host, framed), keep, say)
    runner.changed = workbench.tell
    served = web.AppRunner(application(workbench), access_log=None, handle_signals=False, shutdown_timeout=1.0)
    await served.setup()
    try:
        await web.SockSite(served, found).start()
        shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        shown = f"[{shown}]" if ":" in shown else shown
        loop = asyncio.get_running_loop()
        ready(
            f"http://{shown}:{found.getsockname()[1]}/?token={token}",
            partial(_end, loop, workbench.ended),
        )
        await workbench.ended.wait()
    finally:
        await served.cleanup()


def _end(loop: asyncio.AbstractEventLoop, ended: asyncio.Event) -> None:
    """End the server from another thread; nothing where it has ended already."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(ended.set)
