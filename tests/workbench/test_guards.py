"""Nobody but the page with the token is answered, and nothing beside the pipeline is reached."""

import asyncio
import os
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientError, WSMsgType, WSServerHandshakeError
from aiohttp.test_utils import make_mocked_request

from benchmarks.workbench import ask, served, stay, wait_for_model
from pneucli.config import load
from pneucli.pipeline.manifest import MANIFEST_FILE, read_manifest
from pneucli.workbench import lifetime
from pneucli.workbench.lifetime import MAX_BODY, MAX_PAGES, TOKEN_HEADER, Guard
from pneucli.workbench.server import application
from tests.workbench.conftest import TOKEN, Asked, Session

GUARD = Guard(TOKEN, "127.0.0.1")


def refusal(guard: Guard = GUARD, path: str = "/state", token: str = TOKEN, **headers: str) -> str:
    sent = {"Host": "127.0.0.1:80", TOKEN_HEADER: token} | {name.replace("_", "-"): v for name, v in headers.items()}
    return guard.refusal(make_mocked_request("GET", path, headers=sent))


def test_the_own_page_is_answered() -> None:
    assert refusal() == ""
    assert refusal(Host="localhost:80", Origin="http://localhost:80", Sec_Fetch_Site="same-origin") == ""
    assert refusal(path=f"/events?token={TOKEN}", token="") == ""


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:81"},
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example:80"},
        {"Host": ""},
        {"Sec_Fetch_Site": "cross-site"},
        {"token": ""},
        {"token": "another"},
        {"token": "ünïcode"},
    ],
)
def test_another_origin_host_or_token_is_refused(headers: dict[str, str]) -> None:
    assert refusal(**headers)


def test_a_host_that_was_asked_for_needs_the_token_all_the_same() -> None:
    guard = Guard(TOKEN, "192.168.7.3")
    assert refusal(guard, Host="192.168.7.3:80") == ""
    assert refusal(guard, Host="192.168.7.3:80", token="")
    assert refusal(guard, Host="evil.example")
    assert refusal(Guard(TOKEN, "0.0.0.0"), Host="10.0.0.9:80") == ""
    assert refusal(Guard(TOKEN, "0.0.0.0"), Host="evil.example")


async def test_every_path_is_guarded_also_the_websocket(asked: Asked) -> None:
    for route in application(asked.workbench).router.routes():
        path = route.resource.canonical.replace("{name}", "valve")  # type: ignore[union-attr]
        response = await asked.client.request(route.method, path)
        assert response.status == 403, path
    with pytest.raises(WSServerHandshakeError, match="403"):
        await asked.client.ws_connect("/events")
    foreign = {"Origin": "http://evil.example"}
    with pytest.raises(WSServerHandshakeError, match="403"):
        await asked.client.ws_connect(f"/events?token={TOKEN}", headers=foreign)


async def test_no_code_comes_from_the_page_and_nothing_is_stored(asked: Asked) -> None:
    response = await asked.client.get(f"/?token={TOKEN}")
    policy = response.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self';" in policy
    assert response.headers["Cache-Control"] == "no-store"
    assert TOKEN in await response.text()


@pytest.mark.parametrize(
    "path",
    [
        "/assets/..%2f..%2fpipeline.toml",
        "/assets/%2e%2e/%2e%2e/pyproject.toml",
        "/assets//etc/passwd",
        "/chapter/..%2f..%2fpipeline",
        "/effect/..%2fstribeck",
    ],
)
async def test_no_path_leads_out_of_what_is_named(asked: Asked, path: str) -> None:
    response = await asked.client.get(path, headers={TOKEN_HEADER: TOKEN})
    assert response.status in (400, 404)


@pytest.mark.parametrize("name", ["../evil.csv", "..\\evil.csv", "/evil/evil.csv", "C:\\x\\evil.csv"])
async def test_a_dropped_file_stays_in_its_folder(asked: Asked, name: str) -> None:
    folder = asked.workbench.bench.file.parent
    response = await asked.client.post(
        "/drop", params={"name": name}, data=b"t,u\n0,1\n1,2\n", headers={TOKEN_HEADER: TOKEN}
    )
    assert (await response.json())["file"] == "dropped/evil.csv"
    assert (folder / "dropped" / "evil.csv").is_file()
    assert not (folder.parent / "evil.csv").exists()
    again = await asked.client.post("/drop", params={"name": name}, data=b"x", headers={TOKEN_HEADER: TOKEN})
    assert again.status == 409
    await asked.idle()


@pytest.mark.parametrize("name", ["", ".hidden.csv", "-x.csv", "run.sh", "..", "pipeline.toml"])
async def test_what_is_no_recording_is_not_stored(asked: Asked, name: str) -> None:
    response = await asked.client.post("/drop", params={"name": name}, data=b"x", headers={TOKEN_HEADER: TOKEN})
    assert response.status == 400
    assert not (asked.workbench.bench.file.parent / "dropped").exists()


async def test_words_of_the_command_line_are_chosen_from_a_list(asked: Asked) -> None:
    version = asked.workbench.bench.version
    for action, names in (
        ("exam", []),
        ("add", ["--out"]),
        ("add", ["--suggested"]),
        ("remove", ["stribeck; rm -rf"]),
        ("add", []),
        ("init", ["../pipeline.toml"]),
        ("init", ["dropped/../pipeline.toml"]),
        ("init", ["--from"]),
    ):
        asked_for = {"action": action, "names": names, "version": version}
        status, answer = await asked.post("/command", asked_for)
        assert status == 400, (action, names)
        assert answer["error"]
    assert asked.workbench.bench.runner.last is None


async def test_large_and_malformed_messages_are_refused_and_it_goes_on(asked: Asked) -> None:
    large = await asked.client.post("/curves", data=b" " * (MAX_BODY + 1), headers={TOKEN_HEADER: TOKEN})
    assert large.status == 413
    for body in (
        b"[",
        b"[]",
        b"\xff",
        b"1",
        b"[" * 60_000,
        b'{"focus": 1}',
        b'{"focus": "x", "values": 3}',
    ):
        response = await asked.client.post("/curves", data=body, headers={TOKEN_HEADER: TOKEN})
        assert response.status == 400, body[:20]
        assert (await response.json())["error"]
    status, _ = await asked.get("/state")
    assert status == 200


async def test_a_message_of_100_mb_is_refused_before_it_is_in_memory(asked: Asked) -> None:
    sent = 0

    async def parts() -> AsyncIterator[bytes]:
        nonlocal sent
        for _ in range(1600):
            sent += 65_536
            yield b" " * 65_536

    with suppress(ClientError):  # the server hangs up on who goes on
        response = await asked.client.post("/curves", data=parts(), headers={TOKEN_HEADER: TOKEN})
        assert response.status == 413
    assert sent < 20 << 20
    page = await asked.client.ws_connect(f"/events?token={TOKEN}")
    await page.receive_str()
    with suppress(ConnectionError):
        await page.send_bytes(bytes(100 << 20))
    closed = await page.receive(timeout=20)
    assert closed.type in (WSMsgType.CLOSE, WSMsgType.CLOSED, WSMsgType.CLOSING, WSMsgType.ERROR)
    assert (await asked.get("/state"))[0] == 200


async def test_200_connections_that_say_nothing_stop_nobody(asked: Asked) -> None:
    port = asked.client.server.port
    silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(200)]
    for _, writer in silent:
        writer.write(b"POST /curves HTTP/1.1\r\nHost: 127.0.0.1\r\n")
    assert (await asyncio.wait_for(asked.get("/state"), 10))[0] == 200
    for _, writer in silent:
        writer.close()


async def test_more_pages_than_the_limit_are_refused_and_200_requests_are_answered(asked: Asked) -> None:
    pages = [await asked.client.ws_connect(f"/events?token={TOKEN}") for _ in range(MAX_PAGES)]
    with pytest.raises(WSServerHandshakeError, match="503"):
        await asked.client.ws_connect(f"/events?token={TOKEN}")
    answers = await asyncio.gather(*(asked.get("/assets/none") for _ in range(200)))
    assert {status for status, _ in answers} == {404}
    for page in pages:
        await page.close()
    await asyncio.sleep(0.1)
    assert asked.workbench.pages == set()


# --- the workbench lasts: a kill in the middle loses nothing, and a page may stay open for hours


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
