"""Compiled kernels are shared by all tests and runs of them, and kept apart from the user's own."""

from __future__ import annotations

import getpass
import os
import tempfile
from pathlib import Path

from hypothesis import settings

os.environ.setdefault("PNEUCLI_CACHE", str(Path(tempfile.gettempdir(), f"pneucli-tests-{getpass.getuser()}")))

# the same examples each time: a run that fails says that something changed
settings.register_profile("pneucli", derandomize=True, deadline=None)
settings.load_profile("pneucli")
