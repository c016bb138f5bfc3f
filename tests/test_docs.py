"""The pages that a reader meets: made pages do not drift, links lead somewhere, what is typed exists."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest
import typer

from pneucli.cli import docs
from pneucli.cli.commands import build
from pneucli.config.key_reference import all_keys
from pneucli.physics.effects import catalogue
from pneucli.report.effect_figures import effect_figure

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MADE = docs.generated_pages()
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("*/*.md"))]


@pytest.mark.parametrize("name", MADE)
def test_a_made_page_is_what_the_program_says(name: str) -> None:
    if (DOCS / name).read_text(encoding="utf-8") != MADE[name]:
        pytest.fail(f"docs/{name} has drifted: run `make docs`")


def test_there_are_no_pages_or_pictures_of_effects_that_are_gone() -> None:
    kept = {path.name for path in (DOCS / "effects").iterdir()}
    assert kept == {f"{name}.{kind}" for name in catalogue() for kind in ("md", "svg")}


def test_every_page_of_an_effect_has_its_story() -> None:
    for effect in catalogue().values():
        text = MADE[f"effects/{effect.name}.md"]
        told = (effect.title, effect.equation, effect.looks_like, effect.separate, effect.source, *effect.twins)
        assert [words for words in told if words not in text] == []
        assert all(f"| {p.name} | {p.unit} |" in text for p in effect.parameters)


@pytest.mark.parametrize(
    ("effect", "label"),
    [("stribeck", "difference of F in N"), ("chamber-leak", "difference of p1 in bar"), ("dwell-breakaway", "in mm")],
)
def test_a_picture_is_drawn_from_the_declaration_of_what_shows_it(effect: str, label: str) -> None:
    words = [
        node.text or ""
        for node in ET.fromstring(effect_figure(catalogue()[effect])).iter()
        if node.tag.endswith("text")
    ]
    assert any(label in word for word in words)
    assert "model without it" in words


def test_the_picture_is_the_same_every_time() -> None:
    effect = catalogue()["line-delay"]
    assert effect_figure(effect) == effect_figure(effect)


def test_an_effect_that_changes_nothing_has_no_picture() -> None:
    mute = replace(catalogue()["constant-force"], ports={})
    with pytest.raises(ValueError, match="shows on no standard manoeuvre"):
        effect_figure(mute)


def links(page: Path) -> Iterator[str]:
    text = re.sub(r"```.*?```|`[^`]*`|\$[^$]*\$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return (found for found in re.findall(r"\]\(([^)]+)\)", text) if not re.match(r"https?:|#", found))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page: Path) -> None:
    broken = [link for link in links(page) if not (page.parent / link.partition("#")[0]).exists()]
    assert broken == []


def test_the_site_is_built_and_every_link_of_it_leads_somewhere(tmp_path: Path) -> None:
    """Links between pages, to headings and pictures; every page has its place in the navigation."""
    pytest.importorskip("mkdocs", reason="no mkdocs (extra docs)")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path)]
    run = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    )
    assert run.returncode == 0, run.stderr
    page = (tmp_path / "diagnosis.html").read_text(encoding="utf-8")
    assert "<math" in page
    assert "$$" not in page
    assert (
        re.findall(r'(?:src|href)="(https?:)?//(?!github|keepachangelog|semver|squidfunk|toml|doi|zensical)[^"]*', page)
        == []
    )


def test_every_page_is_reached_from_the_index() -> None:
    reached = {(DOCS / link.partition("#")[0]).resolve() for link in links(DOCS / "index.md")}
    assert [page.name for page in DOCS.glob("*.md") if page.name != "index.md" and page.resolve() not in reached] == []


def test_the_constants_of_the_diagnosis_are_those_of_the_code() -> None:
    page = (DOCS / "diagnosis.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z.]+)\.([A-Z_]+)` \| ([^ ]+) \|", page, re.MULTILINE)
    found = {f"{module}.{name}": getattr(import_module(f"pneucli.{module}"), name) for module, name, _ in rows}
    assert len(rows) >= 20
    assert {f"{module}.{name}": float(value) for module, name, value in rows} == found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_piece_of_a_pipeline_file_is_one(page: Path) -> None:
    """It is TOML, and each key of a table that the program knows is a key of it."""
    known: dict[str, set[str]] = {}
    for key in all_keys():
        known.setdefault(key.table.partition(",")[0], set()).add(key.name)
    for block in re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        document = tomllib.loads(block)
        for table, entries in document.items():
            inner = {name.split(".")[1] for name in known if name.startswith(f"{table}.")}
            for one in entries if isinstance(entries, list) else [entries]:
                if table in known and isinstance(one, dict):
                    assert set(one) <= known[table] | inner, (table, block)


def test_commands_in_the_readme_exist_with_their_options() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = [line.removeprefix("$ ") for block in re.findall(r"```(?:sh|console)\n(.*?)```", text, re.DOTALL)
             for line in block.splitlines()]  # fmt: skip
    typed = [shlex.split(line, comments=True) for line in lines if line.startswith("pneucli ")]
    commands = typer.main.get_command(build()).commands  # type: ignore[attr-defined]
    assert len(typed) >= 5
    for _, name, *words in (line for line in typed if line[1] != "--help"):
        options = {flag for parameter in commands[name].params for flag in parameter.opts}
        assert [word for word in words if word.startswith("--") and word not in options] == []
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert {line.split()[1] for line in lines if line.startswith("make ")} <= set(targets)
