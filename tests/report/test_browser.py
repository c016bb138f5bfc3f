"""The page in a real browser, on a desk and on a telephone: it renders, zooms, and logs no error."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("selenium")
from selenium import webdriver
from selenium.webdriver import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="no Chromium, or no chromedriver"),
]
PLOTS = "window.pneucliPlots['comparison']"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(executable_path=DRIVER))
    yield browser
    browser.quit()


@pytest.fixture(params=[1400, 400], ids=["desk", "telephone"])
def browser(request: pytest.FixtureRequest, chromium: Any, page: str, tmp_path: Path) -> Any:
    """A browser with the network cut off, as wide as the parameter, with the page open."""
    file = tmp_path / "report.html"
    file.write_text(page, encoding="utf-8")
    size = {"width": request.param, "height": 900, "deviceScaleFactor": 1, "mobile": request.param < 500}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    chromium.execute_cdp_cmd("Network.enable", {})
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    chromium.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    chromium.get_log("browser")
    chromium.get(file.as_uri())
    WebDriverWait(chromium, 10).until(lambda b: b.execute_script(f"return {PLOTS}.length") > 0)
    return chromium


def limits(browser: Any) -> list[tuple[float, float]]:
    """Stretch of time that each plot shows, in s."""
    script = f"return {PLOTS}.map(p => [p.scales.x.min, p.scales.x.max])"
    return [(low, high) for low, high in browser.execute_script(script)]


def drag(browser: Any, start: float, end: float) -> None:
    """Drag over the first plot, from one share of its width to another."""
    over = browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] .u-over")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", over)
    width = over.size["width"]
    actions = ActionChains(browser, duration=50)
    actions.move_to_element_with_offset(over, round((start - 0.5) * width), 0).click_and_hold()
    actions.move_by_offset(round((end - start) * width / 2), 0).move_by_offset(round((end - start) * width / 2), 0)
    actions.release().perform()


def test_the_page_renders_without_console_errors(browser: Any) -> None:
    assert browser.title == "bench & co – pneucli report"
    figures = browser.find_elements(By.CSS_SELECTOR, "figure svg")
    assert len(figures) >= 14
    front = next(figure for figure in figures if figure.is_displayed())
    assert front.rect["y"] + front.rect["height"] < (900 if browser.execute_script("return innerWidth") > 700 else 1600)
    browser.execute_script("document.querySelectorAll('details').forEach(one => one.open = true)")
    shown = [figure.size["height"] for figure in figures if figure.size["width"]]
    assert len(shown) == len(figures) - 1  # the first picture is there twice, for a desk and for a telephone
    assert min(shown) > 100
    assert browser.get_log("browser") == []


def test_a_link_opens_its_folded_chapter(browser: Any) -> None:
    chapter = browser.find_element(By.CSS_SELECTOR, "#valve details")
    assert not chapter.get_property("open")
    link = browser.find_element(By.CSS_SELECTOR, "nav a[href='#valve']")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", link)
    link.click()
    WebDriverWait(browser, 20).until(lambda _: chapter.get_property("open"))  # the page hears of it a moment later


def test_the_page_does_not_scroll_sideways(browser: Any) -> None:
    wide, shown = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
    assert wide <= shown


def test_the_curves_are_drawn(browser: Any) -> None:
    inked = (
        f"return {PLOTS}.map(p => {{const c = p.ctx.canvas, d = p.ctx.getImageData(0, 0, c.width, c.height).data;"
        "let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 200; return n;})"
    )
    assert min(browser.execute_script(inked)) > 200


def test_dragging_zooms_all_plots_and_a_double_click_shows_all_again(browser: Any) -> None:
    (low, high), *_ = whole = limits(browser)
    drag(browser, 0.25, 0.5)
    zoomed = limits(browser)
    # a pixel or two of 250 to 1200
    tolerance = 0.02 * (high - low)
    for start, end in zoomed:
        assert start == pytest.approx(low + 0.25 * (high - low), abs=tolerance)
        assert end == pytest.approx(low + 0.5 * (high - low), abs=tolerance)
    over = browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] .u-over")
    ActionChains(browser).double_click(over).perform()
    assert limits(browser) == whole
    assert browser.get_log("browser") == []


def test_another_recording_can_be_chosen(browser: Any) -> None:
    choice = Select(browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] select"))
    names = [option.text for option in choice.options]
    assert names == ["axis_<b>&_$2$ (test)", "axis_1 (train)"]
    choice.select_by_index(1)
    titles = browser.find_elements(By.CSS_SELECTOR, "[data-plots=comparison] h3")
    assert [title.text for title in titles] == [
        "valve command in V",
        "p1 in bar",
        "x in mm",
        "v in mm/s",
        "measured − model in × noise",
    ]
    assert browser.get_log("browser") == []
