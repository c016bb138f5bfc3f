"""The page in a real browser: a model fails, is diagnosed, gets what it lacks, and its error falls."""

import re
import shutil
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
from selenium.webdriver.common.keys import Keys

from benchmarks.workbench import IDLE, LIVE, STATE, begin, press, random_hands, slide, until
from pneucli.config import load
from pneucli.pipeline.manifest import read_manifest
from tests.report.test_browser import CHROMIUM, DRIVER, chromium  # noqa: F401 - a fixture
from tests.workbench.conftest import FIXTURES

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="no Chromium, or no chromedriver"),
]
HANDS = 20  # 400 in benchmarks.workbench


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


def served() -> Iterator[Servers]:
    found = Servers()
    yield found
    found.end()


servers = pytest.fixture(served)
lasting = pytest.fixture(served, scope="module")  # for tests that change nothing but their page


def open_page(browser: webdriver.Chrome, address: str, width: int = 1400) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get("about:blank")  # else the page of the test before complains that its workbench has ended
    browser.get_log("browser")
    browser.get(address)
    until(browser, LIVE)
    until(browser, IDLE)


LABELS = "window.pneucliWorkbench.plots.panels.flatMap((p) => p.series.map((s) => s.label))"


def labels(browser: Any) -> list[str]:
    found: list[str] = browser.execute_script(f"return {LABELS}")
    return found


def errors_of(browser: Any) -> list[str]:
    return [one["message"] for one in browser.get_log("browser")]


def test_a_model_fails_is_diagnosed_and_its_error_falls(servers: Servers, chromium: Any, tmp_path: Path) -> None:  # noqa: F811
    file = Path(shutil.copytree(FIXTURES / "friction_hysteresis", tmp_path / "bench")) / "pipeline.toml"
    text = file.read_text(encoding="utf-8")
    open_page(chromium, servers.start(file))
    before = float(chromium.find_element(By.ID, "error").text)
    assert before > 10.0
    press(chromium, "[data-action=diagnose]")
    named = chromium.execute_script(STATE)["diagnosis"]["missing"]
    assert named
    ended = begin(chromium, "[data-action=add-named]")
    step_is_shown = "document.getElementById('ladder').textContent.includes('one step; the fit runs')"
    until(chromium, f"if ({step_is_shown}) return true; {ended}", 30)  # on a busy machine the fit may end first
    until(chromium, ended)
    until(chromium, "return !document.getElementById('ladder').textContent.includes('one step')", 30)
    after = float(chromium.find_element(By.ID, "error").text)
    assert after < 2.0
    assert load(file).model.effects[-1:] == named[-1:]
    stored = read_manifest(file.parent / "artifacts" / "friction_hysteresis" / "compare")
    assert stored is not None
    assert stored.answer is not None
    assert after == pytest.approx(stored.answer["error"]["test"], rel=5e-3)
    bars = "return window.pneucliWorkbench.state().ladder.map((one) => one.bar)"
    first, last = chromium.execute_script(bars)
    assert first == 1.0
    assert last < 0.2
    assert file.read_text(encoding="utf-8").count("# absolute") == text.count("# absolute")
    assert "model 1" not in labels(chromium)
    chromium.find_element(By.CSS_SELECTOR, "#ladder button[aria-pressed=false]").click()
    until(chromium, f"return ({LABELS}).includes('model 1')", 30)
    for name, content in (
        ("where", "figure svg"),
        ("friction", "figure svg"),
        ("valve", ".small:not([role])"),
    ):  # it has no valve
        chromium.execute_script(f"document.querySelector('#chapters [data-key={name}]').open = true")
        until(chromium, f"return Boolean(document.querySelector('#chapters [data-key={name}] {content}'))", 60)
    assert errors_of(chromium) == []


@pytest.fixture(scope="module")
def address(lasting: Servers, compared: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A workbench on a copy of the small run."""
    copy = shutil.copytree(compared, tmp_path_factory.mktemp("shown") / "bench")
    return lasting.start(copy / "pipeline.toml")


@pytest.fixture
def page(address: str, chromium: Any) -> Any:  # noqa: F811
    """The page of the small run, loaded anew."""
    open_page(chromium, address)
    return chromium


@pytest.fixture
def own_page(servers: Servers, chromium: Any, folder: Path) -> Any:  # noqa: F811
    """The page of a workbench of the test's own."""
    open_page(chromium, servers.start(folder / "pipeline.toml"))
    return chromium


def test_a_slider_moves_curve_and_error_and_is_reset(page: Any) -> None:
    middle = "p.series.map((s) => [s.label, s.values[s.values.length >> 1]])"
    ink = f"return window.pneucliWorkbench.plots.panels.map((p) => {middle})"
    slider = page.find_element(By.CSS_SELECTOR, "[data-key='slide friction.coulomb']")
    one = next(p for p in page.execute_script(STATE)["parameters"] if p["name"] == "friction.coulomb")
    shaded = "const s = arguments[0]; return [s.clientWidth, getComputedStyle(s.parentElement, '::before').width]"
    width, interval = page.execute_script(shaded, slider)
    share = (one["ci95"][1] - one["ci95"][0]) / (one["range"][1] - one["range"][0])
    assert float(interval.removesuffix("px")) == pytest.approx(max(share * (width - 16), 4.0), abs=0.5)
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


def test_the_page_is_found_accessible_and_fits_a_telephone(page: Any) -> None:
    axe = pytest.importorskip("axe_playwright_python")
    script = next(Path(axe.__file__).parent.rglob("axe.min.js")).read_text(encoding="utf-8")
    page.execute_script("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    page.execute_cdp_cmd("Runtime.evaluate", {"expression": script})
    found = page.execute_async_script("axe.run(document).then(arguments[arguments.length - 1])")
    assert [(one["id"], one["nodes"][0]["html"]) for one in found["violations"]] == []
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    found = page.execute_async_script("axe.run(document).then(arguments[arguments.length - 1])")
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert [(one["id"], one["nodes"][0]["html"]) for one in found["violations"]] == []
    size = {"width": 320, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    page.execute_script("document.querySelector('[data-do=all]').click()")
    until(page, "return document.getElementById('errors').textContent.includes('driven_1: ')", 60)
    # 320 px: WCAG 1.4.10; a telephone shrinks a page that is too wide, and its window is wider then
    assert page.execute_script("return document.documentElement.scrollWidth") <= size["width"]


def interval(browser: Any) -> list[float] | None:
    found: list[float] | None = browser.execute_script("return window.pneucliWorkbench.plots.interval()")
    return found


def test_one_axis_of_time_zooms_over_all_recordings(page: Any) -> None:
    places = [one["place"] for one in page.execute_script(STATE)["recordings"]]
    shown = interval(page)
    assert shown in [[one["begin"], one["end"]] for one in places]
    page.find_element(By.CSS_SELECTOR, "[data-do=all]").click()
    limits = "window.pneucliWorkbench.plots.plots.map((p) => [p.scales.x.min, p.scales.x.max])"
    whole = [places[0]["begin"], places[-1]["end"]]
    until(page, f"return ({limits}).every((one) => one[0] === {whole[0]} && one[1] === {whole[1]})", 20)
    assert "4 recordings" in page.find_element(By.ID, "recording").text
    currents = page.find_elements(By.CSS_SELECTOR, "#recordings [aria-current=true]")
    assert len(currents) == len(places)
    errors = page.find_element(By.ID, "errors")
    until(page, "return document.getElementById('errors').textContent.includes('driven_1: ')", 20)
    assert all(f"{one['name']}: " in errors.text for one in places)
    plots = page.find_element(By.CSS_SELECTOR, ".plots")
    plots.send_keys("+")
    zoomed = interval(page)
    assert zoomed is not None
    assert zoomed[1] - zoomed[0] == pytest.approx(0.5 * (whole[1] - whole[0]))
    plots.send_keys(Keys.ARROW_RIGHT)
    moved = interval(page)
    assert moved is not None
    assert moved[0] > zoomed[0]
    plots.send_keys("0")
    assert interval(page) is None
    slider = page.find_element(By.CSS_SELECTOR, "[data-key='slide friction.coulomb']")
    slider.send_keys(Keys.ARROW_RIGHT)
    assert page.find_element(By.CSS_SELECTOR, ".parameter.moved")
    assert errors_of(page) == []


def test_a_command_shows_its_line_and_progress_and_is_cancelled(own_page: Any) -> None:
    own_page.find_element(By.CSS_SELECTOR, "[data-action=diagnose]").click()
    until(own_page, "return document.getElementById('progress').textContent.includes('diagnose')", 60)
    assert own_page.find_element(By.ID, "line").text == "pneucli diagnose pipeline.toml"
    assert own_page.find_element(By.ID, "bar").is_displayed()
    own_page.find_element(By.ID, "cancel").click()
    until(own_page, "return document.getElementById('progress').textContent.startsWith('Cancelled')", 30)
    assert not own_page.find_element(By.ID, "cancel").is_displayed()
    assert errors_of(own_page) == []


DROP = (
    "const held = new DataTransfer(); held.items.add(new File([arguments[0]], arguments[1])); "
    "document.body.dispatchEvent(new DragEvent('drop', {dataTransfer: held, bubbles: true, cancelable: true}))"
)


def test_a_new_recording_goes_through_look_and_init(own_page: Any, folder: Path, tmp_path: Path) -> None:
    new = tmp_path / "chosen.csv"
    new.write_bytes((folder / "driven_1.csv").read_bytes())
    own_page.find_element(By.ID, "file").send_keys(str(new))
    until(own_page, "return document.getElementById('text').textContent.includes('chosen.csv')", 60)
    own_page.execute_script(DROP, new.read_text(encoding="utf-8"), "another.csv")
    until(own_page, "return document.getElementById('init').textContent.includes('another.csv')", 60)
    until(own_page, "return document.getElementById('text').textContent.includes('another.csv')", 60)
    assert "pneucli look" in own_page.find_element(By.ID, "line").text
    assert "another.csv" in own_page.find_element(By.ID, "text").text
    press(own_page, "#init")
    assert (folder / "dropped" / "another" / "pipeline.toml").is_file()
    assert errors_of(own_page) == []


def test_a_page_of_an_ended_workbench_says_so(servers: Servers, chromium: Any, folder: Path) -> None:  # noqa: F811
    open_page(chromium, servers.start(folder / "pipeline.toml"))
    chromium.execute_script("window.fetch = () => Promise.reject(new TypeError('gone'))")
    servers.end()
    until(
        chromium, "return document.querySelector('#banner').textContent.includes('pneucli workbench pipeline.toml')", 20
    )


def test_a_page_whose_connection_broke_listens_again(servers: Servers, chromium: Any, folder: Path) -> None:  # noqa: F811
    address = servers.start(folder / "pipeline.toml")
    spy = (
        "window.sockets = []; const Usual = WebSocket; window.WebSocket = class extends Usual "
        "{ constructor(...words) { super(...words); window.sockets.push(this); } }"
    )
    script = chromium.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": spy})
    try:
        open_page(chromium, address)
        for number in (2, 3):
            chromium.execute_script("window.sockets.at(-1).close()")
            until(chromium, f"return window.sockets.length === {number} && window.sockets.at(-1).readyState === 1", 30)
            until(chromium, "return document.getElementById('banner').hidden", 30)
        file = folder / "pipeline.toml"
        file.write_text(file.read_text(encoding="utf-8") + "\n# by another hand\n", encoding="utf-8")
        until(chromium, "return document.getElementById('banner').textContent.includes('Another program')", 30)
        slide(chromium, "friction.coulomb", 700)
    finally:
        chromium.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)


def test_random_hands_leave_no_error_and_a_valid_file(own_page: Any, folder: Path) -> None:
    assert random_hands(own_page, folder / "pipeline.toml", HANDS) == []
