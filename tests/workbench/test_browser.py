"""The page in a real browser: the demo fails, is diagnosed, gets what it lacks, and its error falls."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("selenium")
from selenium import webdriver
from selenium.webdriver.common.by import By

from pneucli.config import load
from pneucli.pipeline.manifest import read_manifest
from tests.report.test_browser import CHROMIUM, DRIVER, chromium  # noqa: F401 - a fixture

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="no Chromium, or no chromedriver"),
]
CLICKS = 60
STATE = "return window.pneucliWorkbench.state()"
IDLE = "const s = window.pneucliWorkbench?.state(); return Boolean(s && !s.command?.running)"


class Servers:
    """Workbenches that the command serves."""

    def __init__(self) -> None:
        self.running: list[subprocess.Popen[str]] = []

    def start(self, file: Path) -> str:
        """Serve a pipeline file; return the address."""
        words = [sys.executable, "-m", "pneucli", "workbench", str(file), "--no-browser", "--keep", "--quiet"]
        one = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.running.append(one)
        assert one.stdout is not None
        return re.sub(r"^workbench\s+", "", one.stdout.readline()).strip()

    def end(self) -> None:
        """End them all."""
        for one in self.running:
            one.terminate()
            one.communicate(timeout=30)


@pytest.fixture
def servers() -> Iterator[Servers]:
    found = Servers()
    yield found
    found.end()


def until(browser: Any, condition: str, seconds: float = 180.0) -> None:
    end = time.monotonic() + seconds
    while not browser.execute_script(condition):
        assert time.monotonic() < end, browser.execute_script("return document.getElementById('progress').textContent")
        time.sleep(0.1)


def open_page(browser: webdriver.Chrome, address: str, width: int = 1400) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get_log("browser")
    browser.get(address)
    until(browser, "return Boolean(window.pneucliWorkbench?.state()?.live && document.querySelector('.plots canvas'))")
    until(browser, IDLE)


def press(browser: Any, selector: str) -> None:
    """Press a button that runs a command; wait until the command has ended."""
    before = (browser.execute_script(STATE).get("command") or {}).get("number", 0)
    browser.find_element(By.CSS_SELECTOR, selector).click()
    ended = f"const c = window.pneucliWorkbench.state().command; return c.number > {before} && !c.running"
    until(browser, ended)


def errors_of(browser: Any) -> list[str]:
    return [one["message"] for one in browser.get_log("browser")]


def test_the_demo_fails_is_diagnosed_and_its_error_falls(servers: Servers, chromium: Any, tmp_path: Path) -> None:  # noqa: F811
    text = (ROOT / "pipelines" / "demo.toml").read_text(encoding="utf-8")
    file = tmp_path / "pipeline.toml"
    file.write_text(text.replace("../fixtures", (ROOT / "fixtures").as_posix()), encoding="utf-8")
    open_page(chromium, servers.start(file))
    before = float(chromium.find_element(By.ID, "error").text)
    assert before > 10.0
    press(chromium, "[data-action=diagnose]")
    named = chromium.execute_script(STATE)["diagnosis"]["missing"]
    assert named
    press(chromium, "[data-action=add-named]")
    after = float(chromium.find_element(By.ID, "error").text)
    assert after < 2.0
    assert load(file).model.effects[-1:] == named[-1:]
    stored = read_manifest(tmp_path / "artifacts" / "demo" / "compare")
    assert stored is not None
    assert stored.answer is not None
    assert after == pytest.approx(stored.answer["error"]["test"], rel=5e-3)
    bars = "return window.pneucliWorkbench.state().ladder.map((one) => one.bar)"
    first, last = chromium.execute_script(bars)
    assert first == 1.0
    assert last < 0.2
    assert file.read_text(encoding="utf-8").count("# absolute") == text.count("# absolute")
    assert errors_of(chromium) == []


@pytest.fixture
def page(servers: Servers, chromium: Any, folder: Path) -> Any:  # noqa: F811
    """The page of the small run."""
    open_page(chromium, servers.start(folder / "pipeline.toml"))
    return chromium


def test_a_slider_moves_curve_and_error_and_is_reset(page: Any) -> None:
    middle = "p.series.map((s) => [s.label, s.values[s.values.length >> 1]])"
    ink = f"return window.pneucliWorkbench.plots.panels.map((p) => {middle})"
    slider = page.find_element(By.CSS_SELECTOR, "[data-key='slide friction.coulomb']")
    first = page.execute_script(ink)
    move = "arguments[0].value = 950; arguments[0].dispatchEvent(new Event('input', {bubbles: true}))"
    page.execute_script(move, slider)
    until(page, "return document.getElementById('by-hand').textContent.includes('By hand')", 20)
    moved = page.execute_script(ink)
    assert moved != first
    assert page.find_element(By.CSS_SELECTOR, ".parameter.moved")
    page.find_element(By.CSS_SELECTOR, "[data-key='reset friction.coulomb']").click()
    until(page, "return !document.querySelector('.parameter.moved')", 20)
    time.sleep(0.5)
    assert page.execute_script(ink) == first
    assert errors_of(page) == []


def test_a_value_is_typed_with_its_unit(page: Any) -> None:
    typed = page.find_element(By.CSS_SELECTOR, "[data-key='typed friction.viscous']")
    page.execute_script("arguments[0].value = '0.05 kN s/m'; arguments[0].dispatchEvent(new Event('change'))", typed)
    until(page, "return document.querySelector(\"[data-key='typed friction.viscous']\").value.startsWith('50 ')", 20)
    page.execute_script("arguments[0].value = '5 bar'; arguments[0].dispatchEvent(new Event('change'))", typed)
    until(page, "return document.querySelector('#banner').textContent.includes('dimension')", 20)
    assert typed.get_attribute("aria-invalid") == "true"


def test_the_page_is_found_accessible_and_fits_a_telephone(page: Any, servers: Servers, folder: Path) -> None:
    axe = pytest.importorskip("axe_playwright_python")
    script = next(Path(axe.__file__).parent.rglob("axe.min.js")).read_text(encoding="utf-8")
    page.execute_script("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    page.execute_cdp_cmd("Runtime.evaluate", {"expression": script})
    found = page.execute_async_script("axe.run(document).then(arguments[arguments.length - 1])")
    assert [(one["id"], one["nodes"][0]["html"]) for one in found["violations"]] == []
    size = {"width": 400, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    wide, shown = page.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
    assert wide <= shown


def test_a_page_of_an_ended_workbench_says_so(servers: Servers, chromium: Any, folder: Path) -> None:  # noqa: F811
    open_page(chromium, servers.start(folder / "pipeline.toml"))
    chromium.execute_script("window.fetch = () => Promise.reject(new TypeError('gone'))")
    servers.end()
    until(
        chromium, "return document.querySelector('#banner').textContent.includes('pneucli workbench pipeline.toml')", 20
    )


WANTED = ", ".join(
    f"{where} {what}"
    for where in ("#curves", "#recordings", "#ladder", "#buttons", ".parameter", ".effect", "main")
    for what in ({"main": ["summary"], "#curves": ["button", "input"]}.get(where, ["button"]))
)


def test_random_clicks_leave_no_error_and_a_valid_file(page: Any, folder: Path) -> None:
    choose = random.Random(7)
    click = (
        "const some = [...document.querySelectorAll(arguments[0])].filter((e) => e.offsetParent && !e.disabled); "
        "some[Math.floor(arguments[1] * some.length)]?.click()"
    )
    slide = (
        "const all = [...document.querySelectorAll('input[type=range]')]; const one = all[Math.floor(arguments[0] * "
        "all.length)]; if (!one) return; "  # while a model is read there is none
        "one.value = 1000 * arguments[0]; one.dispatchEvent(new Event('input', {bubbles: true}))"
    )
    for _ in range(CLICKS):
        page.execute_script(click, WANTED, choose.random())
        page.execute_script(slide, choose.random())
        load(folder / "pipeline.toml")
    page.execute_script("document.getElementById('cancel').click()")
    until(page, IDLE)
    refused = ("409", "400")  # what came while a command ran, or of a page that the file has left behind
    assert [one for one in errors_of(page) if not any(code in one for code in refused)] == []
