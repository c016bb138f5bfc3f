"""The page of a fleet: one HTML file that filters and sorts ten thousand rigs without a server."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from pneucli.fleet.trends import Trend
from pneucli.messages.fleet import repeatability_sentence

_ASSETS = files("pneucli.fleet") / "assets"
MAX_TREND_BYTES = 2_000_000  # of the trends: those of the first rigs of the list, as far as they fit
MAX_TREND_POINTS = 40  # of one trend: the last dates
MAX_FAILURE_CHARACTERS = 240


def to_html(answer: Mapping[str, Any], results: Sequence[Mapping[str, Any]], trends: Sequence[Trend]) -> str:
    """Return the page: changed rigs, missing effects over the fleet, trends, failures by cause."""
    environment = Environment(
        loader=PackageLoader("pneucli.fleet", "assets"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    script = _asset("fleet.js")
    data = json.dumps(page_data(answer, results, trends), separators=(",", ":"), allow_nan=False)
    return environment.get_template("fleet.html.j2").render(
        answer=answer,
        repeating=repeatability_sentence(answer),
        style=_asset("fleet.css"),
        script=script,
        policy=_policy(script),
        data=Markup(data.replace("<", "\\u003c")),
    )


def _asset(name: str) -> Markup:
    return Markup((_ASSETS / name).read_text(encoding="utf-8"))


def _policy(script: str) -> str:
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    own = f"img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{allowed}'"
    return f"default-src 'none'; {own}; base-uri 'none'; form-action 'none'"


def page_data(
    answer: Mapping[str, Any], results: Sequence[Mapping[str, Any]], trends: Sequence[Trend]
) -> dict[str, Any]:
    """Return the page's data: a list for each rig, the most changed first, with texts by their number."""
    by_rig: dict[str, list[Mapping[str, Any]]] = {}
    for one in sorted(results, key=lambda r: str(r["date"])):
        by_rig.setdefault(one["rig"], []).append(one)
    texts: dict[str, int] = {}
    trends_by_rig: dict[str, list[Trend]] = {}
    for trend in trends:
        trends_by_rig.setdefault(trend.rig, []).append(trend)
    ranked = sorted(
        by_rig, key=lambda rig: (-_log_evidence(by_rig[rig]), not _has_change_point(trends_by_rig.get(rig, [])), rig)
    )
    rows = [_rig(rig, by_rig[rig], texts, trends_by_rig.get(rig, [])) for rig in ranked]
    panels = _trend_panels(ranked, trends_by_rig, texts)  # before the list of texts, to which it adds
    return {"rigs": rows, "words": list(texts), "trends": panels, "failures": answer["failures"],
            "missing": answer["missing"], "changes": _rigs_by_change(results)}  # fmt: skip


def _rigs_by_change(results: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    counts: dict[str, set[str]] = {}
    for result in results:
        for one in result["changes"]:
            counts.setdefault(one["name"], set()).add(result["rig"])
    return {name: len(rigs) for name, rigs in sorted(counts.items(), key=lambda c: -len(c[1]))}


def _log_evidence(results: Sequence[Mapping[str, Any]]) -> float:
    """Return -log10 of a rig's smallest p-value, 0 where nothing changed."""
    p_values = [max(float(r["p_value"] or 0.0), 1e-99) for r in results if r["changes"]]
    return -math.log10(min(p_values)) if p_values else 0.0


def _has_change_point(trends: Sequence[Trend]) -> bool:
    return any(t.change_points for t in trends)


def _rig(rig: str, results: Sequence[Mapping[str, Any]], texts: dict[str, int], trends: Sequence[Trend]) -> list[Any]:
    """Return a rig's row in the order of the columns in fleet.js."""
    last = results[-1]
    changed = next((r for r in reversed(results) if r["changes"]), None)
    failure = next((r for r in reversed(results) if r["failure"]), None)
    report = (changed or last)["report"]
    return [
        rig,
        _text_number(last["date"], texts),
        len(results),
        _text_number(last["verdict"] or "failed", texts),
        [_text_number(name, texts) for name in last["missing"]],
        [] if changed is None else [_change(one, texts) for one in changed["changes"]],
        round(_log_evidence(results), 1),
        None if last["error_test"] is None else float(f"{last['error_test']:.3g}"),
        None
        if failure is None
        else [_text_number(failure["cause"], texts), str(failure["failure"])[:MAX_FAILURE_CHARACTERS]],
        None if report is None else quote(report),
        [_text_number(t.name, texts) for t in trends if t.change_points],
    ]


def _change(one: Mapping[str, Any], texts: dict[str, int]) -> list[Any]:
    numbers = [None if one[key] is None else float(f"{one[key]:.4g}") for key in ("before", "after")]
    return [_text_number(one["name"], texts), *numbers, _text_number(one["unit"], texts)]


def _text_number(text: str, texts: dict[str, int]) -> int:
    return texts.setdefault(str(text), len(texts))


def _trend_panels(
    ranked: Sequence[str], trends_by_rig: Mapping[str, Sequence[Trend]], texts: dict[str, int]
) -> list[Any]:
    """Return the trends of the first rigs of the list, as many as MAX_TREND_BYTES allow."""
    out: list[Any] = []
    room = MAX_TREND_BYTES
    for number, rig in enumerate(ranked):
        for t in trends_by_rig.get(rig, ()):
            first = max(len(t.values) - MAX_TREND_POINTS, 0)
            values = [float(f"{v:.4g}") for v in t.values[first:]]
            errors = [float(f"{e:.2g}") for e in t.errors[first:]]
            breaks = [b - first for b in t.change_points if b >= first]
            names = [
                _text_number(t.name, texts),
                _text_number(t.unit, texts),
                _text_number(t.dates[first], texts),
                _text_number(t.dates[-1], texts),
            ]
            one = [number, *names, values, errors, breaks]
            room -= len(json.dumps(one, separators=(",", ":")))
            if room < 0:
                return out
            out.append(one)
    return out
