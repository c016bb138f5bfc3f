"""What other programs export, from ``init`` to signals in SI: German, LabVIEW's and MATLAB's ways of writing."""

from pathlib import Path

import numpy as np
import pytest

from pneucli.config import load
from pneucli.io.recordings import load_recordings
from pneucli.pipeline.graph import Context
from pneucli.recording import Recording
from pneucli.stages import ingest, init

FIXTURES = Path(__file__).parents[2] / "fixtures"
RIG = {  # what people add: the rig's truth
    '"? cm^2"': '"8.04 cm^2"',
    '"? mm"': '"200 mm"',
    '"? l"': '"0.16 l"',
    '"? cm^3"': '"32 cm^3"',
}
# lines to fill in, the file that is held out, and what is recorded
EXPORTS = {
    "export_german": (2, "Versuch 2", {"p1", "p2", "x"}),
    "export_labview": (1, "step 3V", {"u", "p_supply", "p1"}),
    "export_matlab": (3, "run2", {"u", "p_supply", "p1", "p2", "x"}),
}


def started(name: str, folder: Path) -> tuple[int, list[Recording]]:
    """Return how many lines had to be filled in, and the recordings."""
    answer = init.create(folder / name, [FIXTURES / name])
    path = Path(answer.pipeline)
    text = path.read_text(encoding="utf-8")
    for asked, given in RIG.items():
        text = text.replace(asked, given)
    path.write_text(text, encoding="utf-8")
    ingest.run(Context(path, load(path), folder / "out", folder))
    return len(answer.fill_in), load_recordings(folder / "out")


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_needs_the_rigs_dimensions_and_nothing_else(name: str, tmp_path: Path) -> None:
    lines, held, signals = EXPORTS[name]
    asked, recordings = started(name, tmp_path)
    assert asked == lines
    assert [one.name for one in recordings if one.use == "test"] == [held]
    for one in recordings:
        assert set(one.signals) == signals
        assert one.period == pytest.approx(2e-3 if name == "export_labview" else 1e-3, rel=1e-3)
        assert 0.5e5 < one["p1"].min() < one["p1"].max() < 7.2e5
        if "x" in one:
            assert 0.0 <= one["x"].min() < one["x"].max() <= 0.2


def test_the_clock_of_a_date_goes_on_over_midnight(tmp_path: Path) -> None:
    _, (first, *_) = started("export_labview", tmp_path)
    np.testing.assert_allclose(np.diff(first.time), 2e-3, atol=1e-9)  # they begin one second before midnight
    assert first.time[-1] > 2.0
