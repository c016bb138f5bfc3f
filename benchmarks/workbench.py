"""How soon does the curve follow the hand? ``python -m benchmarks.workbench [SAMPLES...]``

A driven piston of the fixtures, repeated to so many samples, is compared and served. A row each: from a question for
curves to the last byte, and the bytes; then, where there is Chromium, from opening the page to its first curves, and
from the move of a slider to the drawn curve. Median and 95 %.
"""

from __future__ import annotations

import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rigs import SMALL

SOURCE = Path(__file__).parents[1] / "fixtures" / "friction_null_coulomb"
RECORDING, PARAMETER = "driven_1", "friction.coulomb"
MOVES, WIDTH = 40, 1400
HEAD = """[[recordings]]
name = "{name}"
file = "{file}"
experiment = "friction"
use = "{use}"
chamber_2 = "closed"

"""


def write_pipeline(folder: Path, samples: int) -> Path:
    """Write a pipeline of one recording with so many samples, and a short one that is held out."""
    lines = (SOURCE / f"{RECORDING}.csv").read_text(encoding="utf-8").splitlines()
    first = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    head, rows = lines[first], np.array([line.split(",") for line in lines[first + 1 :]], dtype=float)
    times = -(-samples // len(rows))
    # forth and back, so that no reading jumps where a repeat begins
    turned = np.concatenate([rows[::-1] if i % 2 else rows for i in range(times)])[:samples]
    turned[:, 0] = (rows[1, 0] - rows[0, 0]) * np.arange(samples)
    np.savetxt(folder / "long.csv", turned, delimiter=",", header=head, comments="", fmt="%.6g")
    shutil.copy(SOURCE / "driven_2.csv", folder)
    text = (SOURCE / "pipeline.toml").read_text(encoding="utf-8")
    before, _, after = text[: text.index("[[recordings]]")], "", text[text.index("[model]") :]
    tables = HEAD.format(name="long", file="long.csv", use="train")
    tables += HEAD.format(name="short", file="driven_2.csv", use="test")
    file = folder / "pipeline.toml"
    file.write_text(before + tables + after, encoding="utf-8")
    return file


@contextmanager
def served(file: Path) -> Iterator[str]:
    """Serve the workbench of a pipeline; yield its address."""
    words = [sys.executable, "-m", "pneucli", "workbench", str(file), "--no-browser", "--keep", "--quiet"]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        assert running.stdout is not None
        yield running.stdout.readline().split()[-1]
    finally:
        running.terminate()
        running.communicate(timeout=60)


def ask(address: str, path: str, content: Any = None) -> bytes:
    """Return the answer to a question of the page."""
    base, _, token = address.partition("?token=")
    data = None if content is None else json.dumps(content).encode()
    request = urllib.request.Request(base + path, data, {"X-Pneucli-Token": token})
    with urllib.request.urlopen(request, timeout=600) as answer:
        return bytes(answer.read())


def wait_for_model(address: str) -> float:
    """Wait until the model is loaded and nothing runs; return the parameter's value."""
    while True:
        state = json.loads(ask(address, "state"))
        if state["live"] and not (state["command"] or {}).get("running"):
            return float(next(one["value"] for one in state["parameters"] if one["name"] == PARAMETER))
        time.sleep(0.2)


def questions(address: str, value: float, moves: int) -> tuple[list[float], int]:
    """Return the times in ms of questions for curves whose parameter moves, and the bytes of the last answer."""
    took, size = [], 0
    for i in range(moves):
        begin = time.perf_counter()
        values = {PARAMETER: value * (1.0 + 0.01 * (i + 1))}
        size = len(ask(address, "curves", {"recording": "long", "values": values, "samples": 4 * WIDTH // 2}))
        took.append(1e3 * (time.perf_counter() - begin))
    return took, size


def in_browser(address: str, moves: int) -> tuple[float, list[float]] | None:
    """Return s to the first curves, and ms from each move of a slider to the drawn curve; None without Chromium."""
    binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (binary and driver):
        return None
    from selenium import webdriver  # noqa: PLC0415

    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.add_argument(f"--window-size={WIDTH},900")
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(executable_path=driver))
    try:
        begin = time.perf_counter()
        browser.get(address)
        drawn = "return (window.pneucliWorkbench?.latencies ?? []).length"
        while not browser.execute_script(drawn):
            time.sleep(0.02)
        first = time.perf_counter() - begin
        pick = "[...document.querySelectorAll('#recordings button')].find((b) => b.dataset.key === 'long').click()"
        browser.execute_script(pick)
        slider = f"document.querySelector(\"[data-key='slide {PARAMETER}']\")"
        time.sleep(2.0)
        for i in range(moves):
            before = browser.execute_script(drawn)
            value = 500 + 400 * i // moves
            browser.execute_script(f"{slider}.value = {value}; {slider}.dispatchEvent(new Event('input'))")
            while browser.execute_script(drawn) == before:
                time.sleep(0.005)
        return first, [
            float(one) for one in browser.execute_script("return window.pneucliWorkbench.latencies")[-moves:]
        ]
    finally:
        browser.quit()


def quantiles(took: Sequence[float]) -> str:
    """Return median and 95 % of times in ms."""
    return f"{statistics.median(took):.0f} / {np.quantile(took, 0.95):.0f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each number of samples."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    small = SMALL in given
    counts = [int(float(one)) for one in given if one != SMALL] or ([3000] if small else [10_000, 100_000, 1_000_000])
    moves = 3 if small else MOVES
    print("samples    question ms     kB    first curves s    slider to curve ms")
    for samples in counts:
        with tempfile.TemporaryDirectory() as folder:
            file = write_pipeline(Path(folder), samples)
            subprocess.run([sys.executable, "-m", "pneucli", "compare", str(file), "--quiet"], check=True, stdout=-3)
            with served(file) as address:
                took, size = questions(address, wait_for_model(address), moves)
                shown = in_browser(address, moves)
        page = "-" if shown is None else f"{shown[0]:.1f}               {quantiles(shown[1])}"
        print(f"{samples:<10} {quantiles(took):<15} {size / 1e3:<5.0f} {page}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
