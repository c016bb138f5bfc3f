"""What the page asks for is what the commands do: the same numbers, the same file, undone to the letter."""

import asyncio
import json
import math
import os
import signal
import socket
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.compare import Comparison
from pneucli.compare.channel_errors import channel_result
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.artifacts import read_table
from pneucli.pipeline.manifest import read_manifest
from pneucli.report.page_elements import Panel, Series
from pneucli.report.report_data import Table
from pneucli.report.sections.comparison import channel_panel
from pneucli.simulate.model import Model
from pneucli.workbench import live_model
from pneucli.workbench.live_model import gauss_newton_step
from pneucli.workbench.prediction import MAX_REACH, MAX_SIMULATED, Prediction, Simulated
from pneucli.workbench.server import listen, pack
from tests.workbench.conftest import Asked


def unpack(content: bytes) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Return head and arrays as the page reads them."""
    (length,) = struct.unpack("<I", content[:4])
    head = json.loads(content[4 : 4 + length])
    numbers = np.frombuffer(content, "<f4", offset=4 + length)
    sizes = [panel["samples"] for panel in head["panels"] for _ in range(1 + len(panel["series"]))]
    return head, np.split(numbers, np.cumsum(sizes)[:-1])


def test_panels_are_packed_on_whole_words_with_gaps_as_nan() -> None:
    panel = Panel("p1", "bar", np.array([2.0, 3.0]), [Series("m", "model", np.array([1.5, np.nan]))], [2.5])
    head, (time, values) = unpack(pack([panel], {"ü": 1}))
    assert head["panels"][0] == {
        "title": "p1",
        "unit": "bar",
        "start": 2.0,
        "restarts": [2.5],
        "samples": 2,
        "series": [{"label": "m", "role": "model"}],
    }
    assert time.tolist() == [0.0, 1.0]
    assert values[0] == 1.5
    assert np.isnan(values[1])


@pytest.mark.parametrize(("segments", "gaps"), [(20, 19), (2000, 0)])
def test_a_curve_has_gaps_at_restarts_where_there_is_room(segments: int, gaps: int) -> None:
    time = np.arange(100_000) / 1000.0
    columns = {"measured": np.sin(time), "model": np.cos(time), "residual": np.sin(time) - np.cos(time)}
    segment = np.arange(time.size) * segments // time.size
    rows = Table({"time": time, "unit": np.full(time.size, "m"), "segment": segment.astype(float), **columns})
    _, model = channel_panel("x", rows, None, 1400).series
    assert np.count_nonzero(np.isnan(model.values)) == gaps


async def test_the_errors_of_the_page_are_those_of_compare(asked: Asked) -> None:
    compared = read_manifest(asked.workbench.bench.artifacts / "compare")
    assert compared is not None
    assert compared.answer is not None
    expected = {(c["recording"], c["channel"]): c["ratio_to_noise"] for c in compared.answer["channels"]}
    status, content = await asked.post("/curves", {"focus": "driven_1", "samples": 100})
    assert status == 200
    found = {(one["recording"], one["channel"]): one["ratio"] for one in unpack(content)[0]["errors"]}
    assert found == pytest.approx(expected)
    _, overall = await asked.post("/error", {"focus": "driven_1"})
    assert overall == pytest.approx(compared.answer["error"])


async def test_the_curves_are_those_that_compare_stored(asked: Asked) -> None:
    interval = await asked.interval("driven_2")
    _, content = await asked.post("/curves", {"focus": "driven_2", "interval": interval, "samples": 40_000})
    head, arrays = unpack(content)
    table = read_table(asked.workbench.bench.artifacts / "compare" / "residuals.parquet")
    mine = [(r, c) == ("driven_2", "x") for r, c in zip(table["recording"], table["channel"], strict=True)]
    titles = [panel["title"] for panel in head["panels"]]
    before = sum(1 + len(panel["series"]) for panel in head["panels"][: titles.index("x")])
    shown = arrays[before + 1]
    np.testing.assert_allclose(shown, 1e3 * np.asarray(table["measured"])[mine], rtol=1e-6)


async def test_a_value_by_hand_moves_the_curve_and_the_error(asked: Asked) -> None:
    _, content = await asked.post("/curves", {"focus": "driven_1", "values": {"friction.coulomb": 25.0}})
    head, _ = unpack(content)
    assert max(one["ratio"] for one in head["errors"]) > 3.0
    labels = {s["label"].partition(",")[0] for panel in head["panels"] for s in panel["series"]}
    assert {"measured", "fitted", "model"} <= labels
    status, answer = await asked.post("/curves", {"focus": "driven_1", "values": {"friction.none": 1.0}})
    assert status == 400
    assert "friction.none" in answer["error"]


async def test_one_step_serves_the_curves_and_the_error_over_all_recordings(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[Model] = []

    def counted(*words: Any) -> Model:
        steps.append(gauss_newton_step(*words))
        return steps[-1]

    monkeypatch.setattr(live_model, "gauss_newton_step", counted)

    content = {"focus": "driven_1", "effects": ["stribeck"], "step": True}
    status, _ = await asked.post("/curves", content)
    assert status == 200
    _, found = await asked.post("/error", content)
    _, plain = await asked.post("/error", content | {"step": False})
    assert found["train"] != plain["train"]
    assert len(steps) == 1
    await asked.post("/error", content | {"focus": "driven_2"})
    assert len(steps) == 2


async def test_peaks_survive_the_reduction_and_a_window_is_sent_alone(asked: Asked) -> None:
    begin, end = await asked.interval("driven_1")
    asked_for = {"focus": "driven_1", "interval": [begin, end]}
    _, whole = await asked.post("/curves", asked_for | {"samples": 40_000})
    _, few = await asked.post("/curves", asked_for | {"samples": 200})
    _, window = await asked.post("/curves", {"focus": "driven_1", "interval": [begin + 1.0, begin + 2.0]})
    assert len(few) < 0.2 * len(whole)
    (_, full), (_, reduced) = unpack(whole), unpack(few)
    for a, b in zip(full, reduced, strict=True):
        if np.isfinite(a).any():
            # the curve of the model lies between the peaks of measurement and residual
            assert np.nanmax(b) == pytest.approx(float(np.nanmax(a)), abs=0.02 * float(np.nanmax(a) - np.nanmin(a)))
    head, arrays = unpack(window)
    assert all(begin + 0.9 <= panel["start"] <= begin + 1.0 for panel in head["panels"])
    assert arrays[0][-1] + head["panels"][0]["start"] == pytest.approx(begin + 2.0, abs=0.05)
    assert end > begin + 2.5


async def test_all_recordings_stand_on_one_axis_with_gaps_between_them(asked: Asked) -> None:
    _, state = await asked.get("/state")
    places = {one["name"]: one["place"] for one in state["recordings"]}
    uses = [one["use"] for one in state["recordings"]]
    assert uses == sorted(uses)  # "test" before "train"
    ends = [time for one in places.values() for time in (one["begin"], one["end"])]
    assert ends == sorted(ends)
    assert len(places) > 2
    _, content = await asked.post("/curves", {"focus": "driven_1", "samples": 2000})
    head, arrays = unpack(content)
    position = next(i for i, panel in enumerate(head["panels"]) if panel["title"] == "x")
    before = sum(1 + len(panel["series"]) for panel in head["panels"][:position])
    time, measured = arrays[before] + head["panels"][position]["start"], arrays[before + 1]
    assert (np.diff(time) >= 0.0).all()
    for one in places.values():
        inside = (time >= one["begin"] - 1e-3) & (time <= one["end"] + 1e-3)
        assert np.isfinite(measured[inside]).sum() > 100
    firsts = np.searchsorted(time, [one["begin"] - 1e-3 for one in list(places.values())[1:]])
    assert np.isnan(measured[firsts - 1]).all()  # no line leads from one recording to the next


async def test_only_effects_that_the_recordings_can_show_are_offered(asked: Asked) -> None:
    """A measured force tells friction; a valve it has none of, and leaks change no reading of it."""
    _, state = await asked.get("/state")
    offered = {one["name"] for one in state["effects"]}
    assert {"stribeck", "presliding", "friction-asymmetry"} <= offered
    assert not {"opening-leak", "piston-leak", "pump-flow", "valve-lag"} & offered


async def test_adding_an_effect_does_what_the_command_does_and_is_undone_to_the_letter(asked: Asked) -> None:
    bench = asked.workbench.bench
    before = bench.file.read_bytes()
    seen = {"version": bench.version}
    status, _ = await asked.post("/command", {"action": "add", "names": ["stribeck"], **seen})
    assert status == 200
    await asked.idle()
    _, state = await asked.get("/state")
    assert state["command"]["line"] == "pneucli add pipeline.toml stribeck"
    assert not state["command"]["failed"], state["command"]["text"]
    assert "added stribeck" in state["command"]["text"]
    assert b"# measurements of one rig" in bench.file.read_bytes()
    assert load(bench.file).model.effects == ["stribeck"]
    assert [one["effects"] for one in state["ladder"]] == [[], ["stribeck"]]
    assert [one["name"] for one in state["effects"] if one["in_model"]] == ["stribeck"]
    assert state["undo"]["line"] == "pneucli remove pipeline.toml stribeck"

    stale, answer = await asked.post("/command", {"action": "remove", "names": ["stribeck"], **seen})
    assert stale == 409
    assert "has changed" in answer["error"]

    first = next(one["number"] for one in state["ladder"] if not one["effects"])
    _, content = await asked.post("/curves", {"focus": "driven_1", "earlier": first})
    assert unpack(content)[0]["panels"]
    status, _ = await asked.post("/undo", {"version": state["version"]})
    assert status == 200
    await asked.idle()
    assert bench.file.read_bytes() == before


async def test_what_another_program_wrote_is_not_undone(asked: Asked) -> None:
    bench = asked.workbench.bench
    _, state = await asked.get("/state")
    fix = {"name": "friction.coulomb", "value": 14.0, "unit": "N", "version": state["version"]}
    assert (await asked.post("/fix", fix))[0] == 200
    await asked.idle()
    assert load(bench.file).model.parameters["friction.coulomb"].fixed == "14 N"
    text = bench.file.read_text() + "# by hand\n"
    bench.file.write_text(text)
    status, answer = await asked.post("/undo", {"version": bench.version})
    assert status == 409
    assert "another program" in answer["error"]
    assert bench.file.read_text() == text


async def test_a_value_that_the_file_cannot_have_leaves_it_as_it_was(asked: Asked) -> None:
    bench = asked.workbench.bench
    before = bench.file.read_bytes()
    wrong = {"name": "friction.none", "value": 14.0, "unit": "N", "version": bench.version}
    status, answer = await asked.post("/fix", wrong)
    assert status == 400
    assert "friction.none" in answer["error"]
    assert bench.file.read_bytes() == before


async def test_a_quantity_is_read_with_its_unit(asked: Asked) -> None:
    assert await asked.post("/quantity", {"text": "12 mm/s", "unit": "m/s"}) == (200, {"value": 0.012})
    status, answer = await asked.post("/quantity", {"text": "12 bar", "unit": "m/s"})
    assert status == 400
    assert "dimension" in answer["error"]


async def test_a_cancelled_command_leaves_answers_whole(asked: Asked) -> None:
    bench = asked.workbench.bench
    before = {path: path.read_bytes() for path in bench.artifacts.rglob("*.json")}
    await asked.post("/command", {"action": "diagnose", "version": bench.version})
    while not bench.runner.running or not bench.runner.last or not bench.runner.last.messages:
        await asyncio.sleep(0.05)
    busy, _ = await asked.post("/command", {"action": "fit", "version": bench.version})
    assert busy == 409
    await asked.post("/cancel", {})
    await asked.idle()
    _, state = await asked.get("/state")
    assert state["command"]["cancelled"]
    assert {path: path.read_bytes() for path in before} == before


async def test_a_page_hears_of_changes_by_another_program(asked: Asked) -> None:
    page = await asked.client.ws_connect("/events?token=the-token")
    assert (await page.receive_str(timeout=5)) == "changed"
    file = asked.workbench.bench.file
    file.write_text(file.read_text() + "\n# by hand\n")
    assert (await page.receive_str(timeout=5)) == "changed"
    await page.close()


async def test_a_broken_file_is_told_and_mended_again(asked: Asked) -> None:
    file = asked.workbench.bench.file
    good = file.read_text()
    file.write_text(good + "[model]\n")
    status, state = await asked.get("/state")
    assert status == 200
    assert "pipeline.toml" in state["broken"]
    file.write_text(good)
    _, state = await asked.get("/state")
    assert "broken" not in state


def test_a_taken_port_is_a_clear_line() -> None:
    taken = listen("127.0.0.1", 0)
    taken.listen()
    with pytest.raises(InputError, match="cannot listen there"):
        listen("127.0.0.1", taken.getsockname()[1])
    with pytest.raises(InputError, match="cannot listen there"):
        listen("192.0.2.1", 0)
    taken.close()


@pytest.mark.skipif(not hasattr(signal, "SIGINT") or sys.platform == "win32", reason="needs signals")
def test_the_command_prints_its_address_and_ends_on_ctrl_c(folder: Path) -> None:
    words = [sys.executable, "-m", "pneucli", "workbench", "pipeline.toml", "--no-browser", "--json"]
    started = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ})
    assert started.stdout is not None
    opened = b""
    while b"}" not in opened:
        opened += started.stdout.readline()
    address = json.loads(opened)["address"]
    assert address.startswith("http://127.0.0.1:")
    port = int(address.split(":")[2].partition("/")[0])
    with socket.create_connection(("127.0.0.1", port), timeout=5):
        pass
    started.send_signal(signal.SIGINT)
    _, messages = started.communicate(timeout=20)
    assert started.returncode == 0, messages
    assert b"Traceback" not in messages


# --- what is shown while the hand moves over a long recording: a line between two simulations, until a third is there


NAME = "friction.coulomb"


def simulated(**values: float) -> Simulated:
    return Simulated("model", values, {"run": None}, 1.0)  # type: ignore[dict-item]


def line(prediction: Prediction, asked: float, moving: str = "a", **others: float) -> tuple[float, float, float] | None:
    found = prediction.line("model", {moving: asked, **others}, moving, 0.0, ["run"])
    ends = [] if found is None else [one.values.get(moving, 0.0) for one in (found.first, found.second)]
    return None if found is None else (ends[0], ends[1], found.share)


def test_the_line_leads_through_the_two_nearest_simulations_that_are_equal_in_all_else() -> None:
    prediction = Prediction()
    prediction.keep(simulated())
    assert line(prediction, 2.0) is None
    prediction.keep(simulated(a=4.0))
    assert line(prediction, 1.0) == (0.0, 4.0, 0.25)
    prediction.keep(simulated(a=2.0))
    assert line(prediction, 3.5) == (4.0, 2.0, 0.25)
    assert line(prediction, 1.0, b=1.0) is None
    assert line(prediction, 1.0, moving="b") is None
    assert prediction.line("another model", {"a": 1.0}, "a", 0.0, ["run"]) is None
    assert prediction.line("model", {"a": 1.0}, "a", 0.0, ["another run"]) is None


def test_a_line_is_not_carried_on_beyond_its_reach() -> None:
    prediction = Prediction()
    prediction.keep(simulated())
    prediction.keep(simulated(a=1.0))
    assert line(prediction, MAX_REACH) is not None
    assert line(prediction, MAX_REACH + 2.0) is None


def test_only_the_last_simulations_are_kept() -> None:
    prediction = Prediction()
    for value in range(MAX_SIMULATED + 1):
        prediction.keep(simulated(a=float(value)))
    assert prediction.same("model", {"a": 0.0}, ["run"]) is None
    assert prediction.same("model", {"a": 1.0}, ["run"]) is not None
    assert prediction.same("model", {"a": 1.0}, ["another run"]) is None


async def test_the_errors_are_those_of_the_predicted_curves_also_with_gaps(asked: Asked) -> None:
    live = asked.workbench.bench.require_live()
    found = [live.comparison(live.variant(live_model.Variant({NAME: v}), ""), "driven_1") for v in (9.0, 12.0)]
    measured = {c: np.where(np.arange(y.size) % 50 == 3, np.nan, y) for c, y in found[0].measured.items()}
    first, second = (_with(each, measured) for each in found)
    prediction = Prediction()
    for value, each in ((9.0, first), (12.0, second)):
        prediction.keep(Simulated("", {NAME: value}, {"driven_1": each}, 1.0))
    through = prediction.line("", {NAME: 10.0}, NAME, 0.0, ["driven_1"])
    assert through is not None
    tables, results, rows = prediction.tables(through, "driven_1", (-math.inf, math.inf), 40_000)
    assert results
    for one in results:
        curve = first.modelled[one.channel] + (second.modelled[one.channel] - first.modelled[one.channel]) / 3.0
        recording = first.experiment.recording
        wanted = channel_result(recording, one.channel, measured[one.channel], curve, one.noise)
        assert one.ratio_to_noise == pytest.approx(wanted.ratio_to_noise)
        assert one.fit_percent == pytest.approx(wanted.fit_percent)
        assert tables[one.channel]["model"] == pytest.approx(curve[rows])


def _with(found: Comparison, measured: dict[str, Any]) -> Comparison:
    """Return a comparison with other measurements, its errors anew."""
    results = tuple(
        channel_result(found.experiment.recording, r.channel, measured[r.channel], found.modelled[r.channel], r.noise)
        for r in found.results
    )
    return replace(found, measured=measured, results=results)


async def test_a_hand_is_followed_by_a_line_and_simulations_come_after_it(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_model, "MAX_SIMULATION", 0.0)

    async def curves(asked: Asked, values: dict[str, float], moving: str | None = NAME) -> tuple[bool, Any, Any]:
        interval = await asked.interval("driven_1")
        content = {"focus": "driven_1", "values": values, "moving": moving, "samples": 40_000, "interval": interval}
        head, arrays = unpack((await asked.post("/curves", content))[1])
        return head["predicted"], arrays, {one["channel"]: one["ratio"] for one in head["errors"]}

    assert not (await curves(asked, {}))[0]
    assert not (await curves(asked, {NAME: 10.0}))[0]
    is_predicted, arrays, errors = await curves(asked, {NAME: 10.2})
    assert is_predicted
    deadline = asyncio.get_running_loop().time() + 20.0
    while (await curves(asked, {NAME: 10.2}))[0] and asyncio.get_running_loop().time() < deadline:
        await asyncio.sleep(0.02)
    is_predicted, exact, right = await curves(asked, {NAME: 10.2})
    assert not is_predicted
    assert errors == pytest.approx(right, rel=0.02)
    assert [one.shape for one in arrays] == [one.shape for one in exact]
    assert not (await curves(asked, {NAME: 11.0}, None))[0]


async def test_a_short_simulation_is_never_predicted(asked: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_model, "MAX_SIMULATION", 10.0)

    for value in (10.0, 10.1, 10.2):
        content = {"focus": "driven_1", "values": {NAME: value}, "moving": NAME}
        head, _ = unpack((await asked.post("/curves", content))[1])
        assert not head["predicted"]
