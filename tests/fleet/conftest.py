"""Keys of the local S3-like store: there before the first process is forked, since workers have its environment."""

import os
from functools import partial

import pytest

from pneucli.executors import THREADS_VARIABLE
from pneucli.fleet import run

os.environ.update(AWS_ACCESS_KEY_ID="nobody", AWS_SECRET_ACCESS_KEY="nothing", AWS_EC2_METADATA_DISABLED="true")


@pytest.fixture(autouse=True)
def rows_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows are done in this process, which has loaded what they need; those of a module's fixture in their own ones."""
    monkeypatch.setattr(run, "engine_from", partial(run.engine_from, threads=True))
    monkeypatch.setenv(THREADS_VARIABLE, "1")
