"""The workbench lasts: a kill in the middle loses nothing, and a page may stay open for hours."""

import asyncio
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.workbench import ask, served, stay, wait_for_model
from pneucli.config import load
from pneucli.pipeline.manifest import MANIFEST_FILE, read_manifest
from pneucli.workbench import lifetime
from tests.workbench.conftest import TOKEN, Asked, Session


@pytest.mark.skipif(sys.platform == "win32", reason="needs groups of processes")
@pytest.mark.parametrize("seconds", [0.4, 2.0])
def test_a_kill_in_the_middle_of_a_write_loses_nothing(folder: Path, seconds: float) -> None:
    file = folder / "pipeline.toml"
    before = file.read_text(encoding="utf-8")
    with served(file) as (address, process):
        state = wait_for_model(address)
        host, port = address.split("/")[2].split(":")
        token = address.rpartition("=")[2]
        with socket.create_connection((host, int(port))) as half:
            head = f"POST /drop?name=half.csv HTTP/1.1\r\nHost: {host}:{port}\r\nX-Pneucli-Token: {token}\r\n"
            half.sendall(f"{head}Content-Length: 100000\r\n\r\nt,u\n0,1\n".encode())
            deadline = time.monotonic() + 20
            while not (folder / "dropped").is_dir() and time.monotonic() < deadline:
                time.sleep(0.02)
            ask(address, "command", {"action": "add", "names": ["stribeck"], "version": state["version"]})
            time.sleep(seconds)
            os.killpg(process, signal.SIGKILL)
    assert [path for path in (folder / "dropped").iterdir() if not path.name.startswith(".")] == []
    effects = load(file).model.effects
    text = file.read_text(encoding="utf-8")
    assert text == before if not effects else (effects == ["stribeck"] and "# measurements of one rig" in text)
    stages = [path.parent for path in (folder / "artifacts").glob(f"*/[a-z]*/{MANIFEST_FILE}")]
    assert {path.name for path in stages} >= {"ingest", "identify", "compare"}
    assert all(read_manifest(path) is not None for path in stages)
    with served(file) as (address, _):
        again = wait_for_model(address)
        assert "broken" not in again
        assert len(ask(address, "curves", {"focus": ""})) > 1000


def test_a_page_that_stays_open_is_answered(folder: Path) -> None:
    found = asyncio.run(stay(folder / "pipeline.toml", 0.1))
    assert found.beats >= 18
    assert found.looks >= 360


def test_no_command_outlives_a_workbench_that_ends_as_it_begins(
    session: Callable[[Session], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[asyncio.subprocess.Process] = []
    start = asyncio.create_subprocess_exec

    async def slow_start(*words: Any, **options: Any) -> asyncio.subprocess.Process:
        begun.append(await start(*words, **options))
        await asyncio.sleep(0.0)
        return begun[0]

    monkeypatch.setattr(asyncio, "create_subprocess_exec", slow_start)

    async def work(asked: Asked) -> None:
        await asked.post("/command", {"action": "diagnose"})
        while not begun:
            await asyncio.sleep(0.0)

    session(work)
    assert begun[0].returncode is not None


def test_closing_the_last_page_ends_it_and_loading_a_page_anew_does_not(
    session: Callable[[Session], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lifetime, "WATCH_INTERVAL", 0.02)
    monkeypatch.setattr(lifetime, "LAST_PAGE_DELAY", 0.5)

    async def work(asked: Asked) -> None:
        asked.workbench.keep = False
        for _ in range(2):
            page = await asked.client.ws_connect(f"/events?token={TOKEN}")
            await asyncio.sleep(0.7)
            await page.close()
            await asyncio.sleep(0.15)  # looks that see no page
            assert not asked.workbench.ended.is_set()
        await asyncio.wait_for(asked.workbench.ended.wait(), 10)

    session(work)
