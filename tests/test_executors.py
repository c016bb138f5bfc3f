"""Clusters that are none, or that do not answer."""

from __future__ import annotations

import socket

import pytest

from pneucli import executors
from pneucli.errors import InputError
from pneucli.executors import executor_from, require_cluster


@pytest.mark.parametrize("address", ["ray://here:8786", "dask://here", "dask://here:port", "dask://", "here:8786"])
def test_what_is_no_address_of_a_cluster_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="dask://host:port"), executor_from(address):
        pass


def test_a_port_where_nobody_listens_is_refused_before_anything_is_begun() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match="no cluster answers"):
        require_cluster(f"dask://127.0.0.1:{port}")


def test_who_listens_and_never_answers_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "PATIENCE", 0.3)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        address = f"dask://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(InputError, match="no cluster answers"), executor_from(address):
            pass
