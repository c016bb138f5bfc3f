"""The page in a real browser: it renders, zooms, logs no error, and serves every medium and reader."""

import base64
import re
import shutil
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
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


# --- the report on paper, on a telephone, in the dark, by keyboard, by touch and for a screen reader


PRINTED = """
const canvases = [...document.querySelectorAll('[data-plots=comparison] .one canvas')];
const pixels = (c) => c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
const inked = (c) => pixels(c).some((v, i) => i % 4 == 3 && v > 200);
return [
  [...document.querySelectorAll('[data-plots=comparison] .one h3')].map(e => e.textContent),
  canvases.map(inked),
  document.querySelector('#parameters details').open,
];
"""
AFTER = """
return [
  !document.querySelector('#parameters details').open,
  document.querySelectorAll('.one').length,
  document.documentElement.hasAttribute('data-printing'),
];
"""
SCROLLS = """
const overflow = (e) => getComputedStyle(e).overflowX;
return [...document.querySelectorAll('main *')].filter(e => ['auto', 'scroll'].includes(overflow(e))).length
"""
LOOKS = """
return [
  getComputedStyle(document.body).backgroundColor,
  getComputedStyle(document.querySelector('.tools')).display,
];
"""
NAMED = """
return [...document.querySelectorAll('svg[role=img], .plots canvas')].map(e => e.getAttribute('aria-label') || '')
"""
BOX = "const r = arguments[0].getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
DARK = [{"name": "prefers-color-scheme", "value": "dark"}]


@pytest.fixture
def opened(chromium: Any, page: str, tmp_path: Path) -> Iterator[Any]:
    """A browser with the page open, as wide and as dark as asked."""

    def opened(width: int = 1400, *, dark: bool = False) -> Any:
        file = tmp_path / "report.html"
        file.write_text(page, encoding="utf-8")
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": DARK if dark else []})
        chromium.get(file.as_uri())
        WebDriverWait(chromium, 10).until(lambda b: b.execute_script(f"return {PLOTS}.length") > 0)
        return chromium

    yield opened
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (1400, True), (400, False)])
def test_axe_finds_nothing_serious(opened: Any, width: int, dark: bool) -> None:
    axe = pytest.importorskip("axe_playwright_python", reason="no axe-core (extra dev)")
    browser = opened(width, dark=dark)
    browser.execute_script("document.querySelectorAll('details').forEach(one => one.open = true)")
    browser.execute_script((files(axe) / "axe.min.js").read_text(encoding="utf-8"))
    found = browser.execute_async_script(
        "axe.run(document, {resultTypes: ['violations']}).then(arguments[arguments.length - 1])"
    )
    assert len(found["passes"]) > 20
    assert [(v["impact"], v["id"], v["nodes"][0]["html"][:200]) for v in found["violations"]] == []


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2) of ``#rgb`` or ``#rrggbb``."""
    digits = colour.lstrip("#")
    digits = "".join(c * 2 for c in digits) if len(digits) == 3 else digits
    parts = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def over(colour: str, ground: str) -> str:
    """A colour with a share of transparency (``#rrggbbaa``), as it looks on a ground."""
    if len(colour) != 9:
        return colour
    share = int(colour[7:], 16) / 255
    ground = "#" + "".join(c * 2 for c in ground[1:]) if len(ground) == 4 else ground
    mixed = [share * int(colour[i : i + 2], 16) + (1 - share) * int(ground[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(c):02x}" for c in mixed)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_a_contrast_of_four_and_a_half(scheme: str) -> None:
    style = files("pneucli.report").joinpath("assets", "page.css").read_text(encoding="utf-8")
    light, dark = style.split("@media screen and (prefers-color-scheme: dark)")
    colours = dict(re.findall(r"--([\w-]+): (#\w+)", light))
    if scheme == "dark":
        colours |= dict(re.findall(r"--([\w-]+): (#\w+)", dark.partition("\n}")[0]))
    pairs = [(ink, ground) for ink in ("ink", "faint", "link") for ground in ("ground", "raised")]
    pairs += [(tone, ground) for tone in ("good", "bad") for ground in ("ground", f"{tone}-ground")]
    pairs += [("ink", f"{tone}-ground") for tone in ("good", "bad", "warning")]
    pairs += [("faint", f"{tone}-ground") for tone in ("good", "bad")]
    pairs += [("ink", "bar"), ("good", "bar"), ("bad", "bar")]
    for ink, ground in pairs:
        lights = sorted((luminance(colours[ink]), luminance(over(colours[ground], colours["ground"]))))
        assert (lights[1] + 0.05) / (lights[0] + 0.05) >= 4.5, (ink, ground)


def test_keys_zoom_move_and_show_all_again(opened: Any) -> None:
    browser = opened()
    (low, high), *_ = whole = limits(browser)
    plots = browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] .plots")
    reset = browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] [data-do=all]")
    assert not reset.is_enabled()
    plots.send_keys("+")
    middle, quarter = (low + high) / 2, (high - low) / 4
    assert limits(browser)[-1] == pytest.approx((middle - quarter, middle + quarter), rel=1e-6)
    plots.send_keys(Keys.ARROW_LEFT)
    assert limits(browser)[0][0] == pytest.approx(low, abs=1e-6)
    assert reset.is_enabled()
    told = browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] [role=status]").text
    assert re.fullmatch(r"0 to [\d.]+ s of [\d.]+ s", told)
    plots.send_keys("0")
    assert limits(browser) == whole
    assert not reset.is_enabled()


def test_buttons_do_what_keys_do(opened: Any) -> None:
    browser = opened(400)
    whole = limits(browser)
    for name in ("in", "later", "out", "in", "earlier"):
        button = browser.find_element(By.CSS_SELECTOR, f"[data-plots=comparison] [data-do={name}]")
        assert button.size["height"] >= 40  # a finger's width
        browser.execute_script("arguments[0].click()", button)
    assert limits(browser) != whole
    browser.execute_script("document.querySelector('[data-plots=comparison] [data-do=all]').click()")
    assert limits(browser) == whole


def test_one_finger_drags_over_a_stretch_and_two_pinch(opened: Any) -> None:
    browser = opened(400)
    (low, high), *_ = limits(browser)
    over = browser.find_element(By.CSS_SELECTOR, "[data-plots=comparison] .u-over")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", over)
    box = browser.execute_script(BOX, over)

    def touch(kind: str, *shares: float) -> None:
        points = [{"x": box[0] + s * box[2], "y": box[1] + box[3] / 2, "id": i} for i, s in enumerate(shares)]
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 0.25)
    for share in (0.3, 0.4, 0.5):
        touch("touchMove", share)
    touch("touchEnd")
    for start, end in limits(browser):
        assert start == pytest.approx(low + 0.25 * (high - low), abs=0.04 * (high - low))
        assert end == pytest.approx(low + 0.5 * (high - low), abs=0.04 * (high - low))
    touch("touchStart", 0.3, 0.7)
    touch("touchMove", 0.4, 0.6)
    touch("touchEnd")
    start, end = limits(browser)[0]
    assert end - start == pytest.approx(0.5 * (high - low), rel=0.2)


def test_pictures_canvases_and_tables_have_names(opened: Any) -> None:
    browser = opened()
    browser.execute_script("document.querySelectorAll('details').forEach(one => one.open = true)")
    names = browser.execute_script(NAMED)
    assert len(names) > 15
    assert min(map(len, names)) > 20
    assert any(re.match(r"p1 in bar over time: measured from [\d.]+ to [\d.]+, model", name) for name in names)
    tables = browser.find_elements(By.CSS_SELECTOR, "main table[role=table]")
    assert all(table.find_elements(By.CSS_SELECTOR, "caption") for table in tables)
    assert browser.execute_script("return document.querySelectorAll('main thead th:not([scope=col])').length") == 0


def test_on_a_telephone_a_table_stacks_and_says_each_column(opened: Any) -> None:
    browser = opened(400)
    browser.execute_script("document.querySelector('#parameters details').open = true")
    row = browser.find_element(By.CSS_SELECTOR, "#parameters tbody tr")
    cells = row.find_elements(By.CSS_SELECTOR, "td")
    assert cells[1].location["y"] > cells[0].location["y"]
    said = browser.execute_script("return getComputedStyle(arguments[0], '::before').content", cells[1])
    assert "value, 95 % interval" in said
    wide, shown = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
    assert wide <= shown


def test_on_paper_every_recording_is_printed_and_nothing_scrolls(opened: Any) -> None:
    browser = opened(1000, dark=True)
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    names, inked, unfolded = browser.execute_script(PRINTED)
    browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
    folded, left, marked = browser.execute_script(AFTER)
    assert names == ["axis_<b>&_$2$ (test)", "axis_1 (train)"]
    assert len(inked) == 8
    assert all(inked)
    assert (unfolded, folded, left, marked) == (True, True, 0, False)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": DARK})
    ground, shown = browser.execute_script(LOOKS)
    assert (ground, shown) == ("rgb(255, 255, 255)", "none")
    assert browser.execute_script(SCROLLS) == 0
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
    pdf = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})["data"])
    assert 1 <= len(re.findall(rb"/Type\s*/Page[^s]", pdf)) <= 12
