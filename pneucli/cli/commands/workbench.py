"""``workbench``: the live page of a pipeline, on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, File, HowToRun, open_pipeline_file

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Pipeline

HELP = "The live page: curves that follow the hand, effects to add and remove, the error as it falls."
MAX_PORT = 65_535


def _workbench(
    pipeline: File,
    port: Annotated[
        int, typer.Option("--port", min=0, max=MAX_PORT, help="The port; 0: any that is free.", show_default=False)
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the browser, or only print the address.")
    ] = True,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Listen at this address, for others on the network.")
    ] = "127.0.0.1",
    keep: Annotated[bool, typer.Option("--keep", help="Go on after the last page was closed.")] = False,
    how: HowToRun = HowToRun(),
) -> None:
    import asyncio
    import sys
    import webbrowser
    from collections.abc import Callable

    from pneucli.imports import library_of_extra

    library_of_extra("aiohttp", "workbench", "pneucli workbench")
    from pneucli.workbench.lifetime import LOOPBACK
    from pneucli.workbench.server import listen, serve

    file: Path = pipeline.absolute()
    opened = how.open(file)
    found = listen(host, port)
    if host not in LOOPBACK:
        how.say(f"whoever has the address below can change {pipeline.name}; it is not encrypted")

    def ready(address: str, end: Callable[[], None]) -> None:
        if how.json:
            console.print_json({"schema": "pneucli/workbench/1", "pipeline": opened.name, "address": address})
        else:
            console.print_text(f"workbench  {address}")
        sys.stdout.flush()
        if browser and not webbrowser.open(address):
            how.say("no browser was found: open the address above in one")
        how.say("Ctrl+C ends it")

    def open_again() -> Pipeline:
        return open_pipeline_file(file, how.out)

    try:
        asyncio.run(
            serve(
                file, how.out and how.out.absolute(), open_again, found, host=host, keep=keep, say=how.say, ready=ready
            )
        )
    except KeyboardInterrupt:
        how.say("the workbench has ended")


COMMAND = Command(_workbench, "pneucli workbench axis-7/pipeline.toml", HELP, place=175)
