"""``leak``: a leak test of a shut vessel, from raw files to a verdict."""

from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from pneucli.cli.command import Command, How, Page

Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...",
        help="Raw files, or a pipeline file, whose [rig] then states volume, gas and ambient pressure.",
    ),
]
Volume = Annotated[str | None, typer.Option("--volume", metavar="V", help='Volume of the vessel: "2 l".')]
Limit = Annotated[
    str | None,
    typer.Option(
        "--limit",
        metavar="RATE",
        help='Largest leak that passes: "0.5 l/min", "20 Pa/s", "1 mbar l/s" or "0.01 mm^2". Exit 1 unless all pass.',
    ),
]
Drift = Annotated[
    str, typer.Option("--drift", metavar="T", help="What the wall's temperature may change by (standard uncertainty).")
]


def _leak(
    files: Files,
    volume: Volume = None,
    limit: Limit = None,
    drift: Drift = "0.1 K",
    html: Page = None,
    how: How = How(),
) -> None:
    from pneucli.stages.leak import leak_test

    answer = leak_test(files, volume=volume, limit=limit, drift=drift)
    if html is not None:
        from pneucli.io.artifacts import write_text
        from pneucli.report.recording_pages import leak_page

        write_text(html, leak_page(answer))
        answer = replace(answer, page=str(html))
    how.tell(answer, " ".join(quote(str(path)) for path in files))
    if answer.verdict in ("fail", "undecided"):
        raise typer.Exit(1)


COMMAND = Command(
    _leak,
    'pneucli leak decay.csv --volume "2 l" --limit "0.5 l/min" --html leak.html',
    "A leak test: rate of a shut vessel with interval, law, drift of temperature, pass or fail.",
    place=17,
)
