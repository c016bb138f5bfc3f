"""The pages that a reader meets: made pages do not drift, links lead somewhere, what is typed exists."""

import csv
import re
import shlex
import shutil
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
import typer

from pneucli.cli import docs
from pneucli.cli.program import build
from pneucli.config.key_reference import all_keys
from pneucli.physics.effects import catalogue
from pneucli.report.effect_figures import effect_figure

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MADE = docs.generated_pages()
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
REFERENCES = {
    "cli.md",
    "data-checks.md",
    "errors.md",
    "pipeline-file.md",
}  # as long as there are commands, keys, checks
PARTLY_MADE = {"data-checks.md", "own-effect.md", "raw-files.md"}  # of which a table is made
WRITTEN = [
    page for page in sorted(DOCS.rglob("*.md")) if page.relative_to(DOCS).as_posix() not in {*MADE} - PARTLY_MADE
]
METHOD = "method.md"


def _module(path: Path) -> Any:
    """Load a module that is in no package."""
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SITE = _module(DOCS / "build_site.py")


@pytest.mark.parametrize("name", MADE)
def test_a_generated_page_is_up_to_date(name: str) -> None:
    if (DOCS / name).read_text(encoding="utf-8") != MADE[name]:
        pytest.fail(f"docs/{name} has drifted: run `make docs`")


def test_every_effect_page_and_picture_belongs_to_an_effect() -> None:
    kept = {path.name for path in (DOCS / "effects").iterdir()}
    assert kept == {f"{name}.{kind}" for name in catalogue() for kind in ("md", "svg")}


def test_an_effect_that_changes_nothing_has_no_picture() -> None:
    load = catalogue()["constant-force"]
    mute = replace(load, parameters=tuple(replace(one, typical=(1e-12, 1e-12)) for one in load.parameters))
    with pytest.raises(ValueError, match="is visible in no standard experiment"):
        effect_figure(mute)


def links(page: Path) -> Iterator[str]:
    text = re.sub(r"```.*?```|`[^`]*`|\$[^$]*\$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return (found for found in re.findall(r"\]\(([^)]+)\)", text) if not re.match(r"https?:|#", found))


def words(page: Path) -> int:
    return sum(bool(re.search(r"\w", word)) for word in page.read_text(encoding="utf-8").split())


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_a_page_for_users_is_short(page: Path) -> None:
    if page.name in REFERENCES:
        assert "longer than other pages" in page.read_text(encoding="utf-8")
    elif page in WRITTEN:
        assert words(page) <= (3000 if page.name == METHOD else 1600)


def test_the_written_pages_are_few_and_short_together() -> None:
    assert len(WRITTEN) <= 24
    assert sum(map(words, WRITTEN)) <= 35_000


def test_hits_of_guesses_are_those_of_the_list() -> None:
    page = (DOCS / "development" / "decisions.md").read_text(encoding="utf-8")
    with (ROOT / "findings" / "guesses.csv").open(encoding="utf-8", newline="") as file:
        guesses = list(csv.DictReader(file))
    for ground in {guess["ground"] for guess in guesses}:
        hits = [guess["seen"] == "so" for guess in guesses if guess["ground"] == ground]
        assert f"| {ground} | {sum(hits)} of {len(hits)} |" in page, ground


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_page_rests_on_a_commit_or_on_a_script_that_is_gone(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"\b(?=[0-9]*[a-f])(?=[a-f]*[0-9])[0-9a-f]{7,40}\b", text) == []
    assert re.findall(r"(?:scripts?|trials?) that (?:was|were) not kept", text) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_module_that_a_page_names_exists(page: Path) -> None:
    modules = {path.relative_to(ROOT).as_posix() for folder in ("pneucli", "tests", "benchmarks", "docs")
               for path in (ROOT / folder).rglob("*.py")}  # fmt: skip
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"`(?:pneucli/)?([\w/]+\.py)`", text)
    assert [name for name in named if not any(f"/{path}".endswith(f"/{name}") for path in modules)] == []
    run = re.findall(r"python -m ((?:pneucli|tests|benchmarks)(?:\.[a-z_]+)+)", text)
    assert [name for name in run if not ROOT.joinpath(*name.split(".")).with_suffix(".py").is_file()
            and not ROOT.joinpath(*name.split("."), "__main__.py").is_file()] == []  # fmt: skip


def test_what_the_architecture_says_where_it_is_is_there() -> None:
    text = (DOCS / "development" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/]+\.py): (\w+)`", text)
    texts = {path: (ROOT / "pneucli" / path).read_text(encoding="utf-8") for path, _ in named}
    missing = [one for one in named if not re.search(rf"^(def|class) {one[1]}\b", texts[one[0]], re.MULTILINE)]
    assert named
    assert missing == []


def test_options_of_benchmarks_on_a_page_exist() -> None:
    """An option that a benchmark does not read would be taken for something else, or refused."""
    for page in PAGES:
        for name, rest in re.findall(r"`(?:\w+=\w+ )*python -m benchmarks\.(\w+)([^`]*)`", page.read_text("utf-8")):
            source = (ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8") if name != "NAME" else rest
            assert [o for o in re.findall(r"--[a-z-]+", rest) if o not in source] == [], (page.name, name, rest)


def test_links_anchors_and_menus_lead_somewhere() -> None:
    assert SITE.faults(ROOT) == []


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of all that the site is made of."""
    for name in (*SITE.TAKEN, "zensical.toml", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(DOCS, tmp_path / "docs", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def _append(name: str, text: str) -> Callable[[Path], object]:
    def plant(root: Path) -> None:
        with (root / "docs" / name).open("a", encoding="utf-8") as page:
            page.write(text)

    return plant


@pytest.mark.parametrize(
    ("plant", "fault"),
    [
        (_append("rig.md", "\n[gone](gone.md)\n"), "docs/rig.md: dead link gone.md"),
        (_append("rig.md", "\n[gone](design.md#gone)\n"), "docs/rig.md: dead anchor design.md#gone"),
        (_append("rig.md", "\n[gone](#gone)\n"), "docs/rig.md: dead anchor #gone"),
        (_append("orphan.md", "# Orphan\n"), "docs/orphan.md: in no menu of zensical.toml"),
        (lambda root: (root / "docs" / "plan.md").unlink(), "zensical.toml: no page docs/plan.md"),
    ],
    ids=["dead link", "dead anchor", "dead anchor of its own", "orphan", "gone"],
)  # fmt: skip
def test_a_dead_link_a_dead_anchor_and_an_orphan_abort(
    copy: Path, plant: Callable[[Path], object], fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    plant(copy)
    assert SITE.main(copy, check_only=False) == 1
    assert fault in capsys.readouterr().err


def test_headings_have_the_anchors_of_the_site() -> None:
    text = "# The `name` of [a page](a.md)\n```\n# no heading\n```\n## Twice, 95 %\n## Twice, 95 %\n## Über κ\n"
    assert SITE.anchors(text) == {"the-name-of-a-page", "twice-95", "twice-95_1", "uber"}


def test_the_site_is_built(copy: Path) -> None:
    """With formulas, each anchor that the check foresees, and nothing that is fetched from elsewhere."""
    pytest.importorskip("zensical", reason="no zensical (extra docs)")
    assert SITE.main(copy, check_only=False) == 0
    site = copy / "build" / "site"
    method = (site / "method.html").read_text(encoding="utf-8")
    assert "<math" in method
    assert "$$" not in method
    for page in sorted(DOCS.rglob("*.md")):
        html = (site / page.relative_to(DOCS).with_suffix(".html")).read_text(encoding="utf-8")
        missing = SITE.anchors(page.read_text(encoding="utf-8")) - set(re.findall(r'id="([^"]+)"', html))
        assert missing == set(), page
        foreign = r'src="(?:https?:)?//[^"]*|<link[^>]*rel="(?:stylesheet|preconnect)"[^>]*href="(?:https?:)?//[^"]*'
        assert re.findall(foreign, html) == [], page


def test_every_page_is_reached_from_the_index() -> None:
    reached = {(DOCS / link.partition("#")[0]).resolve() for link in links(DOCS / "index.md")}
    pages = [*DOCS.glob("*.md"), *DOCS.glob("development/*.md")]
    assert [page.name for page in pages if page.name != "index.md" and page.resolve() not in reached] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_toml_example_is_valid(page: Path) -> None:
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


def commands_of(page: Path) -> list[list[str]]:
    """The words of every command of the program that a page shows in a block or within a sentence."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"```(?:sh|console)\n(.*?)```", text, re.DOTALL)
    lines = [line.removeprefix("$ ") for block in blocks for line in block.splitlines()]
    lines += re.findall(r"`(pneucli [^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    shown = [line.split("|")[0].rstrip("\\") for line in lines if line.startswith("pneucli ")]
    return [shlex.split(line, comments=True) for line in shown]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_commands_on_a_page_exist_with_their_options(page: Path) -> None:
    commands = typer.main.get_command(build()).commands  # type: ignore[attr-defined]
    typed = [command for command in commands_of(page) if command[1] != "COMMAND" and command[1][0] != "-"]
    for _, name, *words in typed:
        options = {flag for parameter in commands[name].params for flag in parameter.opts} | {"--help"}
        assert [word for word in words if word.startswith("-") and word.split("=")[0] not in options] == [], words


def test_the_readme_shows_commands_and_existing_targets() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(commands_of(ROOT / "README.md")) >= 5
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"^make (\w+)", text, re.MULTILINE)) <= set(targets)
