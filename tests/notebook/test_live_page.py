"""The workbench from a notebook: a frame, guarded as from the command line, and ended by hand."""

from __future__ import annotations

import urllib.error
import urllib.request

import pytest

import pneucli
from pneucli.errors import InputError

pytest.importorskip("aiohttp")


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def test_a_run_is_shown_in_a_frame_until_it_is_closed(axis: pneucli.Run) -> None:
    page = axis.workbench()
    assert page.address in page._repr_html_()
    assert status(page.address) == 200
    assert status(page.address[:-1]) == 403
    page.close()
    with pytest.raises(urllib.error.URLError):
        status(page.address)


def test_a_folder_of_artifacts_has_nothing_to_change(axis: pneucli.Run) -> None:
    axis.bring_up("compare")
    with pytest.raises(InputError, match="artifacts alone"):
        pneucli.open(axis.artifacts).workbench()
