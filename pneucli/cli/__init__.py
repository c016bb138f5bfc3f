"""The command line: a thin skin. Each command parses, brings its stage up to date, and prints.

Nothing heavy is imported before a command's body runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
import traceback

# before numpy is loaded: on small matrices BLAS threads only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from pneucli.cli import console
from pneucli.cli.commands import build
from pneucli.errors import InputError


def main() -> None:
    """Run the program; exit codes: 0 done, 1 a check failed, 2 the input is at fault, 3 the program is, 130 Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without "×" shows "?", and the answer still comes
    try:
        _call([word for word in sys.argv[1:] if word != "--debug"])
    except InputError as error:
        if "--json" in sys.argv[1:]:
            console.fault(error)
        print(f"error: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(130)
    except Exception as error:
        print(_fault(error), file=sys.stderr)
        sys.exit(3)


def _call(arguments: list[str]) -> None:
    """Run the command; under ``--json`` a wrong command line is an InputError, so that it is told as JSON as well."""
    command = build()
    if "--json" not in arguments:
        command(args=arguments, prog_name="pneucli")
        return
    try:
        code = command(args=arguments, prog_name="pneucli", standalone_mode=False)
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        raise InputError("command line", error.format_message(), mend="pneucli COMMAND --help") from error
    sys.exit(code or 0)


def _fault(error: Exception) -> str:
    trace = "".join(traceback.format_exception(error))
    if "--debug" in sys.argv[1:]:
        return trace.rstrip()
    with tempfile.NamedTemporaryFile("w", prefix="pneucli-", suffix=".log", delete=False, encoding="utf-8") as file:
        file.write(f"{' '.join(sys.argv)}\n{trace}")
    what = (str(error).splitlines() or [""])[0]
    return f"fault of the program: {type(error).__name__}: {what} (traceback in {file.name}; --debug shows it)"
