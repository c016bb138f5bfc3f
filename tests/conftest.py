"""Compiled kernels are shared by all tests and runs of them, and kept apart from the user's own."""

from __future__ import annotations

import getpass
import os
import tempfile
from pathlib import Path

os.environ.setdefault("PNEUCLI_CACHE", str(Path(tempfile.gettempdir(), f"pneucli-tests-{getpass.getuser()}")))
