"""Is the live page quick, and does it last? ``python -m benchmarks.workbench TABLE``; all but ``hours`` use Chromium.

- ``speed [SAMPLES...]``: a driven piston of the fixtures, repeated to so many samples: from a question for simulated
  curves to the last byte, the server's processor time, the bytes; first paint, first curves and all bytes of the page;
  from a move of a slider to the curve on the screen (the first move, median and 95 % of all), with the whole recording
  in view, how many of the curves were predicted, and from the last move to the simulated one; the server's memory.
- ``walk [FOLDER]``: a pipeline (by default ``cases/case-09`` of ``../shared``, else the demo) in the page alone: it
  fails, is diagnosed, gets what was named, its error falls; clicks and seconds, and whether the answers are those of
  the commands.
- ``clicks [NUMBER]``: random clicks, drags and moves of sliders on a small run, the pipeline file loaded after each.
- ``hours [HOURS]``: a page that stays open, its clock sped up: heartbeats and looks at the files of so many hours; then
  thousands of questions to a server of its own, a connection each, and its memory.
- ``picture FILE``: the moving picture of the README, from the demo.
"""

import asyncio
import json
import os
import random
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases import shared_folder
from benchmarks.rigs import print_tables
from pneucli.config import load
from pneucli.pipeline.manifest import read_manifest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "fixtures" / "friction_null_coulomb"
RECORDING, PARAMETER = "driven_1", "friction.coulomb"
MOVES, WIDTH = 100, 1400
CLICKS, SEED = 400, 7
SPED_UP = 200  # times: a heartbeat of 20 s every 100 ms
QUESTIONS = 5000
HEAD = """[[recordings]]
name = "{name}"
file = "{file}"
experiment = "friction"
use = "{use}"
chamber_2 = "closed"

"""
STATE = "return window.pneucliWorkbench.state()"
DRAWN = "return window.pneucliWorkbench?.drawn() ?? 0"
IDLE = "const s = window.pneucliWorkbench?.state(); return Boolean(s && !s.command?.running)"
LIVE = "return Boolean(window.pneucliWorkbench?.state()?.live && document.querySelector('.plots canvas'))"


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


def copy_small(folder: Path) -> Path:
    """Copy the small run of the fixtures, and compare it; return its pipeline file."""
    shutil.copytree(SOURCE, folder / "bench", ignore=shutil.ignore_patterns("artifacts"))
    return compared(folder / "bench" / "pipeline.toml")


def copy_demo(folder: Path) -> Path:
    """Write the demo's pipeline file into a folder."""
    text = (ROOT / "pipelines" / "demo.toml").read_text(encoding="utf-8")
    file = folder / "pipeline.toml"
    file.write_text(text.replace("../fixtures", (ROOT / "fixtures").as_posix()), encoding="utf-8")
    return file


def pneucli(*words: str) -> None:
    """Run a command of the program."""
    subprocess.run([sys.executable, "-m", "pneucli", *words, "--quiet"], check=False, stdout=subprocess.DEVNULL)


def compared(file: Path) -> Path:
    """Compare a pipeline; return its file."""
    pneucli("compare", str(file))
    return file


# the server


@contextmanager
def served(file: Path) -> Iterator[tuple[str, int]]:
    """Serve the workbench of a pipeline; yield its address and the number of its process."""
    words = [sys.executable, "-m", "pneucli", "workbench", str(file), "--no-browser", "--keep", "--quiet"]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        assert running.stdout is not None
        yield running.stdout.readline().split()[-1], running.pid
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


def wait_for_model(address: str) -> dict[str, Any]:
    """Wait until the model is loaded and nothing runs; return what the page shows."""
    while True:
        state: dict[str, Any] = json.loads(ask(address, "state"))
        if state["live"] and not (state["command"] or {}).get("running"):
            return state
        time.sleep(0.2)


def memory(process: int | str = "self", line: str = "VmRSS") -> float:
    """Return the memory of a process in MB; NaN where the system does not say."""
    status = Path(f"/proc/{process}/status")
    text = status.read_text(encoding="utf-8") if status.exists() else ""
    found = re.search(rf"{line}:\s+(\d+) kB", text)
    return float(found[1]) / 1e3 if found else float("nan")


def processor_time(process: int) -> float:
    """Return the processor time of a process in s; NaN where the system does not say."""
    stat = Path(f"/proc/{process}/stat")
    if not stat.exists():
        return float("nan")
    words = stat.read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def questions(address: str, process: int, moves: int, recording: str) -> tuple[list[float], float, int]:
    """Return the times in ms of questions for curves whose parameter moves, the processor's in ms, and the bytes."""
    state = wait_for_model(address)
    value = next(one["value"] for one in state["parameters"] if one["name"] == PARAMETER)
    place = next(one["place"] for one in state["recordings"] if one["name"] == recording)
    asked = {"focus": recording, "interval": [place["begin"], place["end"]], "samples": WIDTH}
    took, size, before = [], 0, processor_time(process)
    for i in range(moves):
        begin = time.perf_counter()
        size = len(ask(address, "curves", asked | {"values": {PARAMETER: value * (1.0 + (i + 1) / moves)}}))
        took.append(1e3 * (time.perf_counter() - begin))
    return took, 1e3 * (processor_time(process) - before) / moves, size


# the browser


def has_chromium() -> bool:
    """Return whether Chromium and its driver are here."""
    return bool(shutil.which("chromium") and shutil.which("chromedriver"))


@contextmanager
def chromium(width: int = WIDTH, height: int = 900) -> Iterator[Any]:
    """Yield a browser of so many pixels that shows nothing on a screen."""
    from selenium import webdriver  # noqa: PLC0415

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
    browser = webdriver.Chrome(options=options, service=service)
    try:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        yield browser
    finally:
        browser.quit()


def until(browser: Any, condition: str, seconds: float = 300.0) -> None:
    """Wait until a script returns what is true; raise TimeoutError after so many seconds."""
    end = time.monotonic() + seconds
    while not browser.execute_script(condition):
        if time.monotonic() > end:
            raise TimeoutError(browser.execute_script("return document.getElementById('progress').textContent"))
        time.sleep(0.02)


def begin(browser: Any, selector: str) -> str:
    """Press a button that runs a command; return the script that says whether the command has ended."""
    before = (browser.execute_script(STATE).get("command") or {}).get("number", 0)
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)
    return f"const c = window.pneucliWorkbench.state().command; return c?.number > {before} && !c.running"


def press(browser: Any, selector: str) -> None:
    """Press a button that runs a command; wait until the command has ended."""
    until(browser, begin(browser, selector))


def slide(browser: Any, parameter: str, step: int) -> None:
    """Move the slider of a parameter to one of its 1000 steps; wait for the curve."""
    before = browser.execute_script(DRAWN)
    move = f"const s = document.querySelector(\"[data-key='slide {parameter}']\"); s.value = {step}; "
    browser.execute_script(f"{move} s.dispatchEvent(new Event('input', {{bubbles: true}}))")
    until(browser, f"return window.pneucliWorkbench.drawn() > {before}")


def first_view(browser: Any, address: str) -> tuple[float, float, float]:
    """Open the page; return s to the first paint and to the first curves, and kB that came."""
    begin = time.perf_counter()
    browser.get(address)
    until(browser, "return (window.pneucliWorkbench?.drawn() ?? 0) > 0")
    curves = time.perf_counter() - begin
    paint = browser.execute_script("return performance.getEntriesByName('first-contentful-paint')[0]?.startTime")
    entries = "[...performance.getEntriesByType('resource'), ...performance.getEntriesByType('navigation')]"
    size = browser.execute_script(f"return {entries}.reduce((sum, one) => sum + one.transferSize, 0)")
    return (float("nan") if paint is None else paint / 1e3), curves, size / 1e3


@dataclass(frozen=True)
class Slid:
    """What followed the moves of a slider: ms of each until the curve, how many were predicted, s until it rests."""

    took: Sequence[float]
    predicted: int
    rest: float

    def __str__(self) -> str:
        return f"{self.took[0]:.0f}, {quantiles(self.took)}, {self.predicted} predicted, rest {self.rest:.1f} s"


def slid(browser: Any, moves: int) -> Slid:
    """Move a slider with the curves of the long recording on the screen."""
    pick = "[...document.querySelectorAll('#recordings button')].find((b) => b.dataset.key === 'long').click()"
    browser.execute_script(pick)
    time.sleep(2.0)
    predicted = 0
    for i in range(moves):
        slide(browser, PARAMETER, 505 + 400 * i // moves)
        predicted += browser.execute_script("return window.pneucliWorkbench.predicted()")
    begin = time.perf_counter()
    until(browser, "return !window.pneucliWorkbench.predicted()", 60)
    rest = time.perf_counter() - begin
    return Slid(browser.execute_script(f"return window.pneucliWorkbench.latencies.slice(-{moves})"), predicted, rest)


def quantiles(took: Sequence[float]) -> str:
    """Return median and 95 % of times in ms."""
    return f"{statistics.median(took):.0f} / {np.quantile(took, 0.95):.0f}"


def print_speed(arguments: Sequence[str], *, is_small: bool = False) -> None:
    """Print a row for each number of samples."""
    counts = [int(float(one)) for one in arguments] or ([3000] if is_small else [10_000, 100_000, 1_000_000])
    moves = 3 if is_small else MOVES
    print("samples   question ms  cpu ms  kB   paint s  curves s  page kB  slider to curve ms, server MB")
    for samples in counts:
        with tempfile.TemporaryDirectory() as folder, served(compared(write_pipeline(Path(folder), samples))) as one:
            address, process = one
            took, used, size = questions(address, process, moves, "long")
            row = f"{samples:<9} {quantiles(took):<12} {used:<7.0f} {size / 1e3:<4.0f}"
            if has_chromium():
                with chromium() as browser:
                    paint, curves, kilobytes = first_view(browser, address)
                    row += f" {paint:<8.1f} {curves:<9.1f} {kilobytes:<8.0f} {slid(browser, moves)};"
            print(f"{row} {memory(process):.0f}, at most {memory(process, 'VmHWM'):.0f}")


# a walk through the page


def walk(browser: Any, file: Path) -> list[tuple[str, float, float]]:
    """Diagnose and add what is named until nothing more is; return each click, its seconds, and the error then."""
    steps: list[tuple[str, float, float]] = []

    def click(action: str) -> dict[str, Any]:
        begin = time.perf_counter()
        press(browser, f"[data-action={action}]")
        steps.append((action, time.perf_counter() - begin, float(browser.find_element("id", "error").text)))
        return dict(browser.execute_script(STATE))

    while click("diagnose")["diagnosis"]["missing"]:
        missing = browser.execute_script(STATE)["diagnosis"]["missing"]
        if not set(missing) - set(load(file).model.effects):
            break
        click("add-named")
    return steps


def answers(file: Path) -> dict[str, Any]:
    """Return effects, errors and verdict as the stages have stored them."""
    folder = next((file.parent / "artifacts").iterdir())
    found = {name: read_manifest(folder / name) for name in ("compare", "diagnose")}
    read = {name: one.answer for name, one in found.items() if one is not None and one.answer is not None}
    values = {name: one["value"] for name, one in read["compare"]["model"]["parameters"].items()}
    wanted = ("verdict", "missing")
    stored = {"errors": read["compare"]["error"], "parameters": values}
    return stored | {name: read["diagnose"][name] for name in wanted} | {"effects": load(file).model.effects}


def print_walk(arguments: Sequence[str], *, is_small: bool = False) -> bool:
    """Print each click of a walk; return whether the answers are those of the commands."""
    if is_small or not has_chromium():
        print("0 clicks: needs Chromium and minutes")
        return True
    case = Path(arguments[0]) if arguments else shared_folder() / "cases" / "case-09"
    with tempfile.TemporaryDirectory() as here, tempfile.TemporaryDirectory() as there:
        files = []
        for folder in (Path(here) / "case", Path(there) / "case"):
            if case.is_dir():
                shutil.copytree(case, folder, ignore=shutil.ignore_patterns("artifacts", "truth.json"))
            else:
                folder.mkdir()
                copy_demo(folder)
            files.append(folder / "pipeline.toml")
        begin = time.perf_counter()
        with served(files[0]) as (address, _), chromium() as browser:
            browser.get(address)
            until(browser, LIVE)
            until(browser, IDLE)
            error = browser.find_element("id", "error").text
            print(f"opened, first fit     {time.perf_counter() - begin:6.1f} s  error {error}")
            steps = walk(browser, files[0])
            log = browser.get_log("browser")
        for action, seconds, error in steps:
            print(f"click {action:<15} {seconds:6.1f} s  error {error:.3g}")
            pneucli(*(["add", str(files[1]), "--suggested"] if action == "add-named" else [action, str(files[1])]))
        same = answers(files[0]) == answers(files[1])
        effects = ", ".join(load(files[0]).model.effects)
        print(f"{len(steps)} clicks, {sum(one[1] for one in steps):.0f} s; effects: {effects}")
        print(f"answers {'equal' if same else 'differ from'} those of the commands; {len(log)} messages in the console")
    return same and not log


# random hands

WANTED = ", ".join(
    f"{where} {what}"
    for where in ("#curves", "#recordings", "#ladder", "#buttons", ".parameter", ".effect", "main")
    for what in ({"main": ["summary"], "#curves": ["button", "input"]}.get(where, ["button"]))
)
CLICK = (
    "const some = [...document.querySelectorAll(arguments[0])].filter((e) => e.offsetParent && !e.disabled); "
    "some[Math.floor(arguments[1] * some.length)]?.click()"
)
SLIDE = (
    "const all = [...document.querySelectorAll('input[type=range]')]; const one = all[Math.floor(arguments[0] * "
    "all.length)]; if (!one) return; "  # while a model is read there is none
    "one.value = 1000 * arguments[0]; one.dispatchEvent(new Event('input', {bubbles: true}))"
)
DRAG = (
    "const all = [...document.querySelectorAll('.u-over')]; const one = all[Math.floor(arguments[0] * all.length)]; "
    "if (!one) return; const r = one.getBoundingClientRect(); const at = (type, share) => ("
    "type === 'mouseup' ? document : one).dispatchEvent(new MouseEvent(type, {bubbles: true, button: 0, buttons: 1, "
    "clientX: r.left + share * r.width, clientY: r.top + r.height / 2})); const [from, to] = arguments; "
    "at('mousemove', from); at('mousedown', from); at('mousemove', to); at('mouseup', to)"
)
REFUSED = ("409", "400")  # what came while a command ran, or of a page that the file has left behind
PATIENCE = 0.04  # share of the clicks after which the hand waits for the command that runs


def random_hands(browser: Any, file: Path, number: int) -> list[str]:
    """Click, drag and slide at random, the pipeline file loaded after each; return the errors of the console.

    At the end a fit brings the curves back, whatever the hands have done: TimeoutError where it does not.
    """
    choose = random.Random(SEED)
    for i in range(number):
        drags = i % 4 == 3
        words = [] if drags else [WANTED]
        browser.execute_script(DRAG if drags else CLICK, *words, choose.random(), choose.random())
        browser.execute_script(SLIDE, choose.random())
        load(file)
        if choose.random() < PATIENCE:
            until(browser, IDLE)
    browser.execute_script("document.getElementById('cancel').click()")
    until(browser, IDLE, 30)
    press(browser, "[data-action=fit]")
    until(browser, LIVE, 30)
    messages = [one["message"] for one in browser.get_log("browser")]
    return [one for one in messages if not any(f"status of {code}" in one for code in REFUSED)]


def print_clicks(arguments: Sequence[str], *, is_small: bool = False) -> bool:
    """Print what so many random clicks, drags and moves of sliders left behind; return whether it was nothing."""
    number = int(arguments[0]) if arguments else 12 if is_small else CLICKS
    if not has_chromium():
        print("0 clicks: needs Chromium")
        return True
    with tempfile.TemporaryDirectory() as folder:
        file = copy_small(Path(folder))
        with served(file) as (address, process), chromium() as browser:
            browser.get(address)
            until(browser, LIVE)
            until(browser, IDLE)
            begin = time.perf_counter()
            errors = random_hands(browser, file, number)
            seconds, used = time.perf_counter() - begin, memory(process)
    print(
        f"{number} clicks and drags, as many moves of sliders in {seconds:.0f} s: {len(errors)} errors; {used:.0f} MB"
    )
    print(*errors, sep="\n", end="")
    return not errors


# a page that stays open


@dataclass
class Stay:
    """What a page that stayed open has seen.

    Attributes:
        beats: Heartbeats that it answered.
        connections: How often it connected; again where an answer came too late.
        looks: Looks of the server at the files.
        used: Memory in MB at the start and after the hours.

    """

    beats: int = 0
    connections: int = 0
    looks: int = 0
    used: list[float] = field(default_factory=list)


async def stay(file: Path, hours: float) -> Stay:
    """Keep a page open for so many hours of a sped-up clock."""
    from aiohttp.test_utils import TestClient, TestServer  # noqa: PLC0415

    from pneucli.notebook.run import open_pipeline_of  # noqa: PLC0415
    from pneucli.workbench import lifetime  # noqa: PLC0415
    from pneucli.workbench.bench import Bench  # noqa: PLC0415
    from pneucli.workbench.commands import CommandRunner  # noqa: PLC0415
    from pneucli.workbench.lifetime import Guard  # noqa: PLC0415
    from pneucli.workbench.server import application  # noqa: PLC0415

    found, usual = Stay(), (lifetime.HEARTBEAT, lifetime.WATCH_INTERVAL)
    beats, looks = (3600.0 * hours / one for one in usual)
    lifetime.HEARTBEAT, lifetime.WATCH_INTERVAL = (one / SPED_UP for one in usual)
    bench = Bench(file, None, lambda: open_pipeline_of(file), CommandRunner(file.parent))
    look = bench.stamp

    def counted() -> tuple[Any, ...]:
        found.looks += 1
        return look()

    bench.stamp = counted  # type: ignore[method-assign]
    try:
        workbench = lifetime.Workbench(bench, Guard("token", "127.0.0.1"))
        async with TestClient(TestServer(application(workbench))) as client:
            while bench.live is None:
                await asyncio.sleep(0.05)
            found.used.append(memory())
            while found.beats < beats or found.looks < looks:
                await _listen(client, found, lambda: found.beats >= beats and found.looks >= looks)
            found.used.append(memory())
    finally:
        lifetime.HEARTBEAT, lifetime.WATCH_INTERVAL = usual
    return found


async def _listen(client: Any, found: Stay, is_enough: Callable[[], bool]) -> None:
    """Answer heartbeats as a page does, until enough have come or the server hangs up."""
    from aiohttp import WSMsgType  # noqa: PLC0415

    page = await client.ws_connect("/events?token=token", autoping=False)
    found.connections += 1
    while not is_enough():
        try:
            message = await page.receive(timeout=0.2)
        except TimeoutError:
            continue
        if message.type is WSMsgType.PING:
            await page.pong(message.data)
            found.beats += 1
        elif message.type is not WSMsgType.TEXT:
            break
    await page.close()


def kept(file: Path, count: int) -> tuple[list[float], list[float]]:
    """Return the times in ms of so many questions, and the server's memory in MB after each tenth of them."""
    took, used = [], []
    with served(file) as (address, process):
        for _ in range(10):
            took += questions(address, process, count // 10, RECORDING)[0]
            used.append(memory(process))
    return took, used


def print_hours(arguments: Sequence[str], *, is_small: bool = False) -> None:
    """Print what a page of so many hours leaves."""
    hours, count = (0.1, 20) if is_small else (float(arguments[0]) if arguments else 8.0, QUESTIONS)
    with tempfile.TemporaryDirectory() as folder:
        file, begin = copy_small(Path(folder)), time.perf_counter()
        found = asyncio.run(stay(file, hours))
        seconds = time.perf_counter() - begin
        took, used = kept(file, count)
    print(f"{hours:g} h in {seconds:.0f} s: {found.beats} heartbeats answered, {found.looks} looks at the files")
    print(f"the page connected {found.connections} times; {found.used[0]:.0f} MB, then {found.used[1]:.0f} MB")
    print(
        f"{count} questions, {quantiles(took)} ms; the server's MB after each tenth:", *(f"{one:.0f}" for one in used)
    )


# the moving picture

PICTURE = 1200, 900  # pixels of the page
SHOWN = 900, 675  # of the picture
PROGRESS = 8  # frames of a command that runs
QUALITY = 60  # of WebP: text stays sharp


def print_picture(arguments: Sequence[str], *, is_small: bool = False) -> None:
    """Write the moving picture of the demo: it fails, a slider moves, it is diagnosed, the error falls."""
    from PIL import Image  # noqa: PLC0415

    if is_small or not has_chromium():
        print("0 pictures: needs Chromium and minutes")
        return
    frames: list[tuple[Any, int]] = []

    def take(browser: Any, milliseconds: int) -> tuple[Any, int]:
        image = Image.open(BytesIO(browser.get_screenshot_as_png())).convert("RGB")
        return image.resize(SHOWN, Image.Resampling.LANCZOS), milliseconds

    with tempfile.TemporaryDirectory() as folder:
        file = compared(copy_demo(Path(folder)))
        with served(file) as (address, _), chromium(*PICTURE) as browser:
            record(browser, address, partial(take, browser), frames.append)
    target = Path(arguments[0]) if arguments else ROOT / "docs" / "img" / "workbench.webp"
    images, durations = zip(*frames, strict=True)
    images[0].save(
        target, save_all=True, append_images=images[1:], duration=durations, loop=0, quality=QUALITY, method=6
    )
    print(f"{target.name}: {len(frames)} frames, {sum(durations) / 1e3:.0f} s, {target.stat().st_size / 1e3:.0f} kB")


def record(browser: Any, address: str, take: Callable[[int], Any], keep: Callable[[Any], None]) -> None:
    """Go through the demo's page; ``take`` makes a frame of so many ms, ``keep`` puts one into the picture."""
    browser.get(address)
    until(browser, LIVE)
    until(browser, IDLE)
    browser.execute_script("document.documentElement.style.scrollbarWidth = 'none'")
    time.sleep(0.5)
    keep(take(1500))
    shown = browser.execute_script("return document.querySelector('#recordings [aria-current=true]').dataset.key")
    for selector in ("[data-do=all]", f"[data-key='{shown}']"):
        before = browser.execute_script(DRAWN)
        browser.execute_script("document.querySelector(arguments[0]).click()", selector)
        until(browser, f"return window.pneucliWorkbench.drawn() > {before}")
        time.sleep(0.2)
        keep(take(1500))
    parameter = browser.execute_script("return document.querySelector('input[type=range]').dataset.key.slice(6)")
    for step in (*range(500, 700, 20), *range(700, 500, -20)):
        slide(browser, parameter, step)
        keep(take(80))
    browser.execute_script("document.getElementById('reset-all').click()")
    for action in ("diagnose", "add-named"):
        ended = begin(browser, f"[data-action={action}]")
        running = []
        while not browser.execute_script(ended):
            running.append(take(300))
            time.sleep(0.3)
        for frame in running[:: -(-len(running) // PROGRESS)]:
            keep(frame)
        time.sleep(1.0)
        keep(take(3500))


TABLES: dict[str, Callable[..., object]] = {
    "speed": print_speed,
    "walk": print_walk,
    "clicks": print_clicks,
    "hours": print_hours,
    "picture": print_picture,
}


def main(arguments: list[str]) -> int:
    """Print one of the tables, or of each a small one; return 1 where a walk or a hand left an error."""
    return print_tables(TABLES, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
