"""Draw static figures: inline SVG from matplotlib, whose ink is the page's text colour, light or dark."""

import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator, ScalarFormatter
from numpy.typing import ArrayLike, NDArray

from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_plain
from pneucli.report.page_elements import Figure

# Okabe and Ito (2008): distinguishable with every kind of colour vision
BLUE, ORANGE, GREEN, PINK, SKY, AMBER = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"
GREY = "#888888"
PALETTE = (BLUE, ORANGE, GREEN, PINK, SKY, AMBER)
TEXT_COLOUR = "#010203"  # placeholder for the page's own text colour
HEAT_MAP_LINE_COLOUR = "#222222"  # lines over a heat map, whose colours do not follow the page
_STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "pneucli",
    "text.parse_math": False,  # a recording's name may contain a dollar sign
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(color=PALETTE),
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "image.cmap": "viridis",
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), TEXT_COLOUR),
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "savefig.facecolor"), "none"),
}
RASTER_DPI = 150
WIDTH, HEIGHT = 4.6, 3.1  # inches; one fits on a telephone, two next to each other on a desk
_MIDDLE = LinearSegmentedColormap.from_list("middle", matplotlib.colormaps["viridis"](np.linspace(0.18, 0.88, 64)))


@dataclass
class Drawing:
    """An unfinished figure: draw on ``axes`` (and ``canvas``); ``figure`` exists after the block."""

    canvas: Canvas
    axes: Axes
    caption: str
    figure: Figure | None = None


@contextmanager
def drawing(caption: str, x: str, y: str, height: float = HEIGHT) -> Iterator[Drawing]:
    """Yield a drawing with titled axes; its ``figure`` is made when the block ends."""
    with matplotlib.rc_context(_STYLE):
        canvas = Canvas(figsize=(WIDTH, height), layout="constrained")
        axes = canvas.subplots()
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        one = Drawing(canvas, axes, caption)
        yield one
        one.figure = Figure(_svg(canvas), one.caption)


def render(draw: Callable[[Canvas], None], width: float, height: float) -> str:
    """Let ``draw`` draw on a canvas of that size in inches; return the SVG."""
    with matplotlib.rc_context(_STYLE):
        canvas = Canvas(figsize=(width, height), layout="constrained")
        draw(canvas)
        return _svg(canvas)


@dataclass(frozen=True)
class Line:
    """One curve of a chart: x and y of shape (n,), its label, and how it is drawn; None: as matplotlib would.

    ``band`` has the ends of an interval about it, each (n,), shaded; ``bars`` has those of an interval at each marker.
    """

    x: ArrayLike
    y: ArrayLike
    label: str | None = None
    colour: str | None = None
    style: str = "-"
    width: float | None = None
    size: float | None = None  # of its markers
    band: tuple[ArrayLike, ArrayLike] | None = None
    bars: tuple[NDArray[Any], NDArray[Any]] | None = None
    alpha: float | None = None

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        look: dict[str, Any] = {"color": self.colour, "markersize": self.size, "label": self.label}
        if self.bars is not None:
            spread = np.clip([self.y - self.bars[0], self.bars[1] - self.y], 0, None)
            axes.errorbar(self.x, self.y, spread, fmt=self.style, capsize=2, **look)
            return
        if self.band is not None:
            axes.fill_between(self.x, *self.band, color=self.colour, alpha=0.25, linewidth=0)
        axes.plot(self.x, self.y, self.style, linewidth=self.width, alpha=self.alpha, **look)


def chart(
    caption: str,
    x: str,
    y: str,
    *lines: Line,
    legend: Any = "",
    ncols: int = 1,
    height: float = HEIGHT,
    extra: Callable[[Axes], object] = lambda axes: None,
    **limits: Any,
) -> Figure:
    """Return a figure of curves.

    Args:
        caption: One sentence that says what it shows.
        x: Title of the horizontal axis.
        y: Title of the vertical axis.
        lines: The curves, the last one on top.
        legend: Place of the legend, as matplotlib names it; "" for none.
        ncols: Columns of a legend outside of the axes.
        height: Height in inches.
        extra: Draws what else there is, below the legend.
        limits: Further properties of the axes, such as ``xlim`` or ``yscale``.
    """
    with drawing(caption, x, y, height) as one:
        for line in lines:
            line.draw(one.axes)
        one.axes.set(**limits)
        extra(one.axes)
        if str(legend).startswith("outside"):
            one.canvas.legend(loc=legend, ncols=ncols)
        elif legend:
            one.axes.legend(loc=legend)
    return figures([one])[0]


def logarithmic_beyond(axes: Axes, linear: float) -> None:
    """Draw y linearly up to ``linear`` on either side of 0, and logarithmically beyond."""
    axes.set_yscale("symlog", linthresh=linear, linscale=1.0)
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_locator(NullLocator())


def plain_numbers(axes: Axes) -> None:
    """Label a logarithmic y axis with numbers without powers of ten."""
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_plain(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())


def zero_line(axes: Axes) -> None:
    """Draw a thin line at zero."""
    axes.axhline(0, color=GREY, linewidth=0.6)


def reduced(line: Line, max_samples: int) -> Line:
    """Return a curve of about that many samples, with every peak."""
    x, y = np.asarray(line.x), np.asarray(line.y)
    kept = envelope_indices([y], max_samples)
    return replace(line, x=x[kept], y=y[kept])


def figures(drawings: Sequence[Drawing]) -> list[Figure]:
    """Return the finished figures of drawings."""
    return [one.figure for one in drawings if one.figure is not None]


def _svg(canvas: Canvas) -> str:
    text = io.StringIO()
    canvas.set_dpi(RASTER_DPI)
    # not savefig, which draws everything once more beforehand
    FigureCanvasSVG(canvas).print_svg(text, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :].replace(TEXT_COLOUR, "currentColor")
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*">', "<g>", svg)  # matplotlib numbers them anew in each figure
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    return re.sub(r'(<svg[^>]*?) height="[^"]*"', r'\1 role="img"', svg, count=1)


def evenly_chosen(values: NDArray[Any], count: int) -> NDArray[Any]:
    """Return at most so many of the values (n,), evenly over their places, the first and the last among them."""
    return values[np.unique(np.linspace(0, values.size - 1, count).round().astype(int))] if values.size else values


def rank_colour(number: int, count: int) -> Any:
    """Return the colour of curve ``number`` of ``count`` that rise in order; legible on light and dark."""
    return _MIDDLE(number / max(count - 1, 1))


def heat_map(one: Drawing, x: NDArray[Any], y: NDArray[Any], z: NDArray[Any], title: str, **options: Any) -> Colorbar:
    """Draw ``z`` of shape (y, x) as an image over cell edges or centres, with a colour bar; NaN stays empty."""
    mesh = one.axes.pcolormesh(x, y, np.ma.masked_invalid(z), rasterized=True, **options)
    bar = one.canvas.colorbar(mesh, ax=one.axes, label=title, pad=0.02)
    bar.outline.set_visible(False)
    return bar


def with_gaps(values: NDArray[Any], segment: NDArray[Any]) -> NDArray[np.float64]:
    """Return values (n,) with NaN at the last sample of each ``segment`` (n,), so that a restart appears as a gap."""
    out = np.array(values, dtype=np.float64)
    out[np.flatnonzero(np.diff(segment))] = np.nan
    return out
