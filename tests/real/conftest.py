"""Real recordings, found through PNEUCLI_DATA or in ../shared/real beside the repository."""

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.stages.chain import run_stages

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("PNEUCLI_DATA", ROOT.parent / "shared" / "real"))

Answers = Callable[..., dict[str, Any]]


def pipeline_with_effects(
    path: Path, effects: tuple[str, ...], folder: Path, fixed: tuple[tuple[str, str], ...] = ()
) -> Path:
    """Write a copy of a pipeline file whose model has these effects and fixed parameters; return its path."""
    text = path.read_text().partition("[model]")
    listed = ", ".join(f'"{e}"' for e in effects)
    stated = "".join(f'"{name}" = {{ fixed = "{value}" }}\n' for name, value in fixed)
    rest = text[2].partition("\n\n")[2]
    copy = folder / f"{'-'.join((path.stem, 'with', *effects, *(name for name, _ in fixed)))}.toml"
    copy.write_text(f"{text[0]}[model]\neffects = [{listed}]\n\n[model.parameters]\n{stated}\n{rest}")
    return copy


@pytest.fixture(scope="session")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Answers:
    """Answers of a pipeline, run once each; ``effects`` and ``fixed`` parameters replace those in the file."""
    if not DATA.is_dir():
        pytest.skip("the real recordings are not here (PNEUCLI_DATA)")
    folder = tmp_path_factory.mktemp("real")

    @cache
    def run(name: str, effects: tuple[str, ...] | None = None, *fixed: tuple[str, str]) -> dict[str, Any]:
        path = ROOT / "pipelines" / f"{name}.toml"
        if effects is not None:
            path = pipeline_with_effects(path, effects, folder, fixed)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PNEUCLI_DATA", str(DATA))
            return run_stages(path, folder / path.stem)

    return run


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.real)
