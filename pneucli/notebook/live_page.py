"""The workbench of a run, served by a thread of the notebook and shown in a frame."""

import asyncio
import html
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from threading import Thread

from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.notebook.progress import ignore_message
from pneucli.pipeline.runner import Pipeline

FRAME_HEIGHT = 900  # pixels


@dataclass(frozen=True)
class LivePage:
    """The address of a workbench that runs until :meth:`close`, or until the program ends."""

    name: str
    address: str
    close: Callable[[], None]

    def __repr__(self) -> str:
        return f"workbench of {self.name}: {self.address}"

    def _repr_html_(self) -> str:
        title, address = html.escape(f"workbench of {self.name}"), html.escape(self.address)
        frame = (
            f'<iframe src="{address}" title="{title}" width="100%" height="{FRAME_HEIGHT}" style="border:0"></iframe>'
        )
        return f'{frame}<p><a href="{address}" target="_blank" rel="noopener">in a tab of its own</a></p>'


def open_live_page(pipeline: Pipeline | None, open_pipeline: Callable[[Path, Path], Pipeline]) -> LivePage:
    """Serve the workbench of a pipeline from a thread; return its address.

    Raises InputError where there is no pipeline file, or where the extra ``workbench`` is not installed.
    """
    library_of_extra("aiohttp", "workbench", "pneucli workbench")
    if pipeline is None:
        wanted = "a run of a pipeline file: the workbench changes the file and runs its commands"
        raise InputError("workbench", "a folder of artifacts alone", wanted, "open the pipeline file", code="E090")
    from pneucli.workbench.server import HOST, listen, serve  # noqa: PLC0415 - aiohttp may be missing

    path, artifacts = pipeline.path, pipeline.artifacts
    found, begun = listen(HOST, 0), Queue[tuple[str, Callable[[], None]]]()

    def run() -> None:
        ready: Callable[[str, Callable[[], None]], None] = lambda address, end: begun.put((address, end))  # noqa: E731
        work = serve(
            *(path, artifacts, lambda: open_pipeline(path, artifacts), found),
            keep=True,
            framed=True,
            say=ignore_message,
            ready=ready,
        )
        asyncio.run(work)

    thread = Thread(target=run, name="workbench", daemon=True)
    thread.start()
    address, end = begun.get(timeout=30)

    def close() -> None:
        end()
        thread.join(timeout=30)

    return LivePage(pipeline.name, address, close)
