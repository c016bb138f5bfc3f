"""The server of one page: aiohttp on this machine."""

import asyncio
import json
import math
import os
import secrets
import socket
import struct
import sys
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from aiohttp import web

from pneucli.compare import ChannelResult, overall_error
from pneucli.errors import InputError
from pneucli.io.artifacts import atomic_path
from pneucli.pipeline.runner import Pipeline
from pneucli.report.page_elements import Panel
from pneucli.workbench.bench import DROPPED, Bench
from pneucli.workbench.commands import CommandRunner
from pneucli.workbench.lifetime import MAX_BODY, Guard, Workbench
from pneucli.workbench.live_model import Variant

MAX_SAMPLES = 40_000  # of a panel: ten times those of a wide screen
MAX_DROP = 2 * 1024**3  # bytes of a dropped recording
RECORDING_ENDINGS = (
    ".csv",
    ".txt",
    ".tsv",
    ".dat",
    ".tdms",
    ".mat",
    ".mf4",
    ".h5",
    ".hdf5",
    ".parquet",
    ".xlsx",
    ".mcap",
)


class Questions:
    """The handlers of one workbench."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._bench = workbench.bench
        self._trails = False

    def routes(self) -> list[web.RouteDef]:
        """Return the paths and their handlers."""
        get = {"/state": self._state, "/chapter/{name}": self._chapter, "/effect/{name}": self._effect}
        post = {
            "/curves": self._curves,
            "/error": self._error,
            "/quantity": self._quantity,
            "/command": self._command,
            "/cancel": self._cancel,
            "/undo": self._undo,
            "/fix": self._fix,
            "/drop": self._drop,
        }
        return [
            *(web.get(path, self._answer(work)) for path, work in get.items()),
            *(web.post(path, self._answer(work)) for path, work in post.items()),
        ]

    def _answer(
        self, work: Callable[[web.Request], Awaitable[Any]]
    ) -> Callable[[web.Request], Awaitable[web.StreamResponse]]:
        """Return a handler that answers in JSON, with errors as one line."""

        async def handler(request: web.Request) -> web.StreamResponse:
            try:
                found = await work(request)
            except InputError as error:
                return web.json_response({"error": str(error)}, status=409 if error.code == "E006" else 400)
            except web.HTTPException:
                raise
            except (ConnectionError, asyncio.CancelledError):
                raise
            except Exception as error:
                self._workbench.say(f"a fault of the program: {type(error).__name__}: {error}")
                return web.json_response({"error": f"a fault of the program: {type(error).__name__}"}, status=500)
            return found if isinstance(found, web.StreamResponse) else web.json_response(found)

        return handler

    async def _state(self, request: web.Request) -> dict[str, Any]:
        found = await self._workbench.in_other(self._bench.describe)
        if self._workbench.busy and found["command"]:  # what the command found is being read
            found["command"]["running"] = True
        return found

    async def _chapter(self, request: web.Request) -> list[dict[str, str]]:
        return await self._workbench.in_other(partial(self._bench.chapter, request.match_info["name"]))

    async def _effect(self, request: web.Request) -> dict[str, str]:
        return await self._workbench.in_other(partial(self._bench.effect, request.match_info["name"]))

    async def _curves(self, request: web.Request) -> web.Response:
        asked = await json_body(request)
        interval = interval_of(asked.get("interval"))
        earlier = asked.get("earlier")
        if earlier is not None and not isinstance(earlier, int):
            raise unreadable("earlier", "a number of the ladder")
        samples = min(max(int(number(asked.get("samples", 4000))), 100), MAX_SAMPLES)
        moving = None if asked.get("moving") is None else text_of(asked, "moving")
        wanted, focus = variant_of(asked), text_of(asked, "focus")
        work = partial(self._bench.curves, wanted, focus, interval, samples, earlier, moving)
        panels, head = await self._workbench.in_live(work)
        if head["predicted"] and not self._trails:
            self._trails = True
            self._workbench.spawn(self._trail(partial(self._bench.simulate, wanted, focus, interval)))
        return web.Response(body=pack(panels, head), content_type="application/octet-stream")

    async def _trail(self, simulate: Callable[[], None]) -> None:
        """Simulate what was predicted, behind the hand: the next prediction starts from there."""
        try:
            with suppress(InputError):  # the model has changed meanwhile
                await self._workbench.in_other(simulate)
        finally:
            self._trails = False

    async def _error(self, request: web.Request) -> dict[str, Any]:
        """Return the error over all recordings, one after the other: the hand need not wait for all of them."""
        asked = await json_body(request)
        wanted, focus = variant_of(asked), text_of(asked, "focus")
        results: list[ChannelResult] = []
        for recording in list(self._bench.require_live().experiments):
            results += await self._workbench.in_other(partial(self._bench.errors, wanted, focus, recording))
        return {use: overall_error(results, use) for use in ("train", "test")}

    async def _quantity(self, request: web.Request) -> dict[str, float]:
        asked = await json_body(request)
        return {"value": self._bench.quantity(text_of(asked, "text"), text_of(asked, "unit"))}

    async def _command(self, request: web.Request) -> dict[str, Any]:
        asked = await json_body(request)
        names = asked.get("names", [])
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise unreadable("names", "names of effects")
        action = text_of(asked, "action")
        if action in ("add", "remove", "add-named"):
            self._bench.require_version(text_of(asked, "version"))
        self._workbench.require_idle()
        self._bench.words(action, names)
        self._workbench.busy = True
        self._workbench.spawn(self._workbench.run(action, names))
        return {}

    async def _cancel(self, request: web.Request) -> dict[str, Any]:
        await self._bench.runner.cancel()
        return {}

    async def _undo(self, request: web.Request) -> dict[str, Any]:
        asked = await json_body(request)
        self._workbench.require_idle()
        self._bench.require_version(text_of(asked, "version"))
        self._bench.undo()
        self._workbench.spawn(self._workbench.run("fit", []))
        return {}

    async def _fix(self, request: web.Request) -> dict[str, Any]:
        asked = await json_body(request)
        self._workbench.require_idle()
        self._bench.require_version(text_of(asked, "version"))
        value = asked.get("value")
        self._bench.fix(text_of(asked, "name"), None if value is None else number(value), text_of(asked, "unit"))
        self._workbench.spawn(self._workbench.run("fit", []))
        return {}

    async def _drop(self, request: web.Request) -> dict[str, Any]:
        """Store a dropped recording beside the pipeline file, and look at it."""
        name = Path(request.query.get("name", "").replace("\\", "/")).name
        if not name or name.startswith((".", "-")) or not name.lower().endswith(RECORDING_ENDINGS):
            raise InputError("the file", f'"{name}"', f"a recording: {', '.join(RECORDING_ENDINGS)}", code="E040")
        self._workbench.require_idle()
        target = self._bench.file.parent / DROPPED / name
        if target.exists():
            raise InputError(str(target), "exists already", "a new name", "rename the file", code="E006")
        target.parent.mkdir(exist_ok=True)
        with atomic_path(target) as temporary:
            await _receive(request, temporary)
        self._workbench.spawn(self._workbench.look(name))
        return {"file": f"{DROPPED}/{name}"}


async def _receive(request: web.Request, target: Path) -> None:
    """Write a request's body to a file; raises InputError beyond the limit."""
    size = 0
    with target.open("wb") as file:
        async for part in request.content.iter_chunked(1 << 16):
            size += len(part)
            if size > MAX_DROP:
                raise InputError("the file", "more than 2 GB", "a smaller one", "name it in the pipeline", code="E003")
            file.write(part)


def pack(panels: Sequence[Panel], head: Mapping[str, Any]) -> bytes:
    """Return panels in binary: the length of the head, the head as JSON, then each array in single precision.

    The arrays of a panel are its time, from its start, and its curves; NaN is a gap.
    """
    described, arrays = [], []
    for panel in panels:
        start = float(panel.time[0]) if panel.time.size else 0.0
        series = [{"label": one.label, "role": one.role} for one in panel.series]
        described.append(
            {
                "title": panel.title,
                "unit": panel.unit,
                "start": start,
                "restarts": list(panel.restarts),
                "samples": int(panel.time.size),
                "series": series,
            }
        )
        arrays += [panel.time - start, *(one.values for one in panel.series)]
    text = json.dumps({**head, "panels": described}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + b"".join(np.asarray(one, dtype="<f4").tobytes() for one in arrays)


def unreadable(name: str, wanted: str) -> InputError:
    """Return the error for a part of a request that is not as the page sends it."""
    return InputError("the workbench", f"{name} cannot be read", wanted, code="E090")


async def json_body(request: web.Request) -> dict[str, Any]:
    """Return the JSON object of a request."""
    try:
        found = json.loads(await request.text(), parse_constant=lambda name: None)
    except (ValueError, UnicodeDecodeError, RecursionError) as error:
        raise unreadable("the request", "a JSON object") from error
    if not isinstance(found, dict):
        raise unreadable("the request", "a JSON object")
    return found


def text_of(asked: Mapping[str, Any], name: str) -> str:
    """Return a text of a request."""
    value = asked.get(name)
    if not isinstance(value, str):
        raise unreadable(name, "a text")
    return value


def number(value: Any) -> float:
    """Return a finite number of a request."""
    usable = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf
    if not usable or abs(value) > sys.float_info.max:
        raise unreadable("a number", "a finite number")
    return float(value)


def interval_of(value: Any) -> tuple[float, float] | None:
    """Return begin and end in s of an interval of time; None for everything."""
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise unreadable("interval", "two numbers")
    return number(value[0]), number(value[1])


def variant_of(asked: Mapping[str, Any]) -> Variant:
    """Return the model that a page asks for."""
    values, effects = asked.get("values", {}), asked.get("effects")
    if not isinstance(values, dict):
        raise unreadable("values", "numbers by name")
    if effects is not None and not (isinstance(effects, list) and all(isinstance(one, str) for one in effects)):
        raise unreadable("effects", "names of effects")
    return Variant(
        {str(name): number(value) for name, value in values.items()},
        None if effects is None else tuple(effects),
        bool(asked.get("free_run")),
        bool(asked.get("step")),
    )


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
