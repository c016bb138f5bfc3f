"""A workbench on a copy of a small run, asked through aiohttp's own client."""

import asyncio
import shutil
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from inspect import iscoroutinefunction, signature
from pathlib import Path
from typing import Any

import pytest
from aiohttp.test_utils import TestClient, TestServer

import pneucli
from pneucli.notebook.run import open_pipeline_of
from pneucli.workbench.bench import Bench
from pneucli.workbench.commands import CommandRunner
from pneucli.workbench.lifetime import TOKEN_HEADER, Guard, Workbench
from pneucli.workbench.server import application

FIXTURES = Path(__file__).parents[2] / "fixtures"
TOKEN = "the-token"


@pytest.fixture(scope="session")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a pipeline that has been compared: a cylinder without effects."""
    folder = tmp_path_factory.mktemp("compared") / "bench"
    shutil.copytree(FIXTURES / "friction_null_coulomb", folder, ignore=shutil.ignore_patterns("artifacts"))
    pneucli.open(folder / "pipeline.toml", quiet=True).bring_up("compare")
    return folder


@pytest.fixture
def folder(compared: Path, tmp_path: Path) -> Path:
    """A copy of it of the test's own."""
    shutil.copytree(compared, tmp_path / "bench")
    return tmp_path / "bench"


@dataclass
class Asked:
    """A workbench that runs, and a client."""

    workbench: Workbench
    client: TestClient[Any, Any]

    async def get(self, path: str, **headers: str) -> tuple[int, Any]:
        """Return status and JSON."""
        response = await self.client.get(path, headers={TOKEN_HEADER: TOKEN} | headers)
        return response.status, await response.json()

    async def post(self, path: str, content: Any, **headers: str) -> tuple[int, Any]:
        """Return status and JSON, or bytes."""
        response = await self.client.post(path, json=content, headers={TOKEN_HEADER: TOKEN} | headers)
        binary = response.content_type == "application/octet-stream"
        return response.status, await (response.read() if binary else response.json())

    async def interval(self, recording: str) -> list[float]:
        """Return where a recording begins and ends on the common axis."""
        _, state = await self.get("/state")
        place = next(one["place"] for one in state["recordings"] if one["name"] == recording)
        return [place["begin"], place["end"]]

    async def idle(self) -> None:
        """Wait until no command runs."""
        await asyncio.sleep(0.05)
        while self.workbench.busy or self.workbench.bench.runner.running:
            await asyncio.sleep(0.05)


Session = Callable[[Asked], Coroutine[Any, Any, None]]


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine with the session that it asks for."""
    if not iscoroutinefunction(pyfuncitem.obj):
        return None
    given = {name: pyfuncitem.funcargs[name] for name in signature(pyfuncitem.obj).parameters}
    given.pop("asked")(lambda asked: pyfuncitem.obj(asked=asked, **given))
    return True


@pytest.fixture
def asked(session: Callable[[Session], None]) -> Callable[[Session], None]:
    """What runs a test that is a coroutine, which gets an :class:`Asked`."""
    return session


@pytest.fixture
def session(folder: Path) -> Callable[[Session], None]:
    """Run a coroutine with a workbench that has loaded its model."""
    file = folder / "pipeline.toml"

    async def run(work: Session) -> None:
        runner = CommandRunner(folder)
        bench = Bench(file, None, lambda: open_pipeline_of(file), runner)
        workbench = Workbench(bench, Guard(TOKEN, "127.0.0.1"), keep=True)
        runner.changed = workbench.tell
        async with TestClient(TestServer(application(workbench))) as client:
            asked = Asked(workbench, client)
            while bench.live is None and not bench.problem:
                await asyncio.sleep(0.02)
            await asked.idle()
            await work(asked)

    def start(work: Session) -> None:
        asyncio.run(run(work))

    return start
