"""Files of an S3-like store and of a web server, read where they are wanted; both servers are on this machine."""

from __future__ import annotations

import http.server
import os
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from pyarrow import fs

from pneucli.errors import InputError
from pneucli.io.remote import fetch, is_remote, refused, stamp

CONTENT = b"t,p\n0,1\n" * 1000


@pytest.fixture(scope="module")
def store() -> Iterator[str]:
    """An S3-like store with one file in it; yields its URL without the file's name, and the endpoint as its query."""
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    keys = {"AWS_ACCESS_KEY_ID": "nobody", "AWS_SECRET_ACCESS_KEY": "nothing", "AWS_EC2_METADATA_DISABLED": "true"}
    before = {name: os.environ.get(name) for name in keys}
    os.environ.update(keys)
    host, port = server.get_host_and_port()
    query = f"endpoint_override={host}:{port}&scheme=http&region=us-east-1&allow_bucket_creation=true"
    system, _ = fs.FileSystem.from_uri(f"s3://rigs?{query}")
    system.create_dir("rigs")
    with system.open_output_stream("rigs/a b.csv") as file:
        file.write(CONTENT)
    yield f"s3://rigs/{{}}?{query}"
    server.stop()
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.update({name: value})


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A web server with one file."""
    pytest.importorskip("aiohttp")
    folder = tmp_path_factory.mktemp("web")
    (folder / "a.csv").write_bytes(CONTENT)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/{{}}"
        server.shutdown()


def test_what_is_a_url_is_no_path() -> None:
    assert is_remote("s3://b/x.csv")
    assert is_remote("https://host/x.csv")
    assert not is_remote("raw/x.csv")
    assert not is_remote("C:\\raw\\x.csv")


@pytest.mark.parametrize(("where", "name"), [("store", "a b.csv"), ("web", "a.csv")])
def test_a_remote_file_is_fetched_as_it_is_and_known_again(
    where: str, name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    url = request.getfixturevalue(where).format(name.replace(" ", "%20"))
    path = fetch(url, tmp_path)
    assert (path.suffix, path.read_bytes()) == (".csv", CONTENT)
    assert stamp(url) == stamp(url)
    assert str(len(CONTENT)) in stamp(url)


@pytest.mark.parametrize("where", ["store", "web"])
def test_a_remote_file_that_is_not_there_is_the_inputs_fault(
    where: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    url = request.getfixturevalue(where).format("none.csv")
    for ask in (stamp, partial(fetch, folder=tmp_path)):
        with pytest.raises(InputError, match=r"none\.csv.*cannot be read"):
            ask(url)


def test_an_error_does_not_tell_a_password() -> None:
    assert "secret" not in str(refused("s3://user:secret@b/x.csv", OSError("no")))
