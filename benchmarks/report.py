"""Size, time and printed pages of reports: ``python -m benchmarks.report PIPELINE... [--out DIR]``.

Brings each pipeline up to date, removes its report, and times ``pneucli report``, which then only draws the page. The
page is printed with Chromium where that is installed.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from benchmarks import small

PAGE = re.compile(rb"/Type\s*/Page\b")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def report(pipeline: Path, out: Path) -> float:
    """Write the report of a pipeline; return the seconds that it took."""
    start = perf_counter()
    command = [sys.executable, "-m", "pneucli", "report", str(pipeline), "--out", str(out), "--quiet"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return perf_counter() - start


def printed_pages(page: Path) -> int | None:
    """Return on how many sheets of A4 a page is printed; None without a browser."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        return None
    with tempfile.TemporaryDirectory() as name:
        pdf = Path(name) / "page.pdf"
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer", f"--print-to-pdf={pdf}"]
        subprocess.run([browser, *options, page.resolve().as_uri()], check=True, capture_output=True)
        return len(PAGE.findall(pdf.read_bytes()))


def row(pipeline: Path, out: Path) -> str:
    """Return a row of the table for one pipeline."""
    report(pipeline, out)
    shutil.rmtree(out / "report")
    seconds = report(pipeline, out)
    page = out / "report" / "report.html"
    pages = printed_pages(page)
    return f"| {pipeline.stem} | {page.stat().st_size / 1e6:.2f} | {seconds:.1f} | {'–' if pages is None else pages} |"


def main(arguments: list[str]) -> None:
    """Print a row for each pipeline."""
    kept = Path(arguments.pop(arguments.index("--out") + 1)) if "--out" in arguments else None
    with tempfile.TemporaryDirectory() as name:
        paths = [Path(a) for a in arguments if not a.startswith("--")]
        if small.SMALL in arguments:
            paths = [small.exam(Path(name)) / "case-001" / "pipeline.toml"]
        print("| pipeline | report.html, MB | seconds | pages of A4 |\n| --- | --- | --- | --- |")
        for i, path in enumerate(paths):
            print(row(path, kept or Path(name) / f"out-{i}"), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
