"""Nobody but the page with the token is answered, and nothing beside the pipeline is reached."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import suppress

import pytest
from aiohttp import ClientError, WSMsgType, WSServerHandshakeError
from aiohttp.test_utils import make_mocked_request

from pneucli.workbench.guards import MAX_BODY, TOKEN_HEADER, Guard
from pneucli.workbench.lifetime import MAX_PAGES
from pneucli.workbench.server import application
from tests.workbench.conftest import TOKEN, Asked, Session

Start = Callable[[Session], None]
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


def test_every_path_is_guarded_also_the_websocket(session: Start) -> None:
    async def work(asked: Asked) -> None:
        for route in application(asked.workbench).router.routes():
            path = route.resource.canonical.replace("{name}", "valve")  # type: ignore[union-attr]
            response = await asked.client.request(route.method, path)
            assert response.status == 403, path
        with pytest.raises(WSServerHandshakeError, match="403"):
            await asked.client.ws_connect("/events")
        foreign = {"Origin": "http://evil.example"}
        with pytest.raises(WSServerHandshakeError, match="403"):
            await asked.client.ws_connect(f"/events?token={TOKEN}", headers=foreign)

    session(work)


def test_no_code_comes_from_the_page_and_nothing_is_stored(session: Start) -> None:
    async def work(asked: Asked) -> None:
        response = await asked.client.get(f"/?token={TOKEN}")
        policy = response.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert response.headers["Cache-Control"] == "no-store"
        assert TOKEN in await response.text()

    session(work)


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
def test_no_path_leads_out_of_what_is_named(session: Start, path: str) -> None:
    async def work(asked: Asked) -> None:
        response = await asked.client.get(path, headers={TOKEN_HEADER: TOKEN})
        assert response.status in (400, 404)

    session(work)


@pytest.mark.parametrize("name", ["../evil.csv", "..\\evil.csv", "/evil/evil.csv", "C:\\x\\evil.csv"])
def test_a_dropped_file_stays_in_its_folder(session: Start, name: str) -> None:
    async def work(asked: Asked) -> None:
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

    session(work)


@pytest.mark.parametrize("name", ["", ".hidden.csv", "-x.csv", "run.sh", "..", "pipeline.toml"])
def test_what_is_no_recording_is_not_stored(session: Start, name: str) -> None:
    async def work(asked: Asked) -> None:
        response = await asked.client.post("/drop", params={"name": name}, data=b"x", headers={TOKEN_HEADER: TOKEN})
        assert response.status == 400
        assert not (asked.workbench.bench.file.parent / "dropped").exists()

    session(work)


def test_words_of_the_command_line_are_chosen_from_a_list(session: Start) -> None:
    async def work(asked: Asked) -> None:
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

    session(work)


def test_large_and_malformed_messages_are_refused_and_it_goes_on(session: Start) -> None:
    async def work(asked: Asked) -> None:
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

    session(work)


def test_a_message_of_100_mb_is_refused_before_it_is_in_memory(session: Start) -> None:
    async def work(asked: Asked) -> None:
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

    session(work)


def test_200_connections_that_say_nothing_stop_nobody(session: Start) -> None:
    async def work(asked: Asked) -> None:
        port = asked.client.server.port
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(200)]
        for _, writer in silent:
            writer.write(b"POST /curves HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        assert (await asyncio.wait_for(asked.get("/state"), 10))[0] == 200
        for _, writer in silent:
            writer.close()

    session(work)


def test_more_pages_than_the_limit_are_refused_and_200_requests_are_answered(session: Start) -> None:
    async def work(asked: Asked) -> None:
        pages = [await asked.client.ws_connect(f"/events?token={TOKEN}") for _ in range(MAX_PAGES)]
        with pytest.raises(WSServerHandshakeError, match="503"):
            await asked.client.ws_connect(f"/events?token={TOKEN}")
        answers = await asyncio.gather(*(asked.get("/assets/none") for _ in range(200)))
        assert {status for status, _ in answers} == {404}
        for page in pages:
            await page.close()
        await asyncio.sleep(0.1)
        assert asked.workbench.pages == set()

    session(work)
