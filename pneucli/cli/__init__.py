"""The command line: each command parses its arguments, brings its stage up to date, and prints the answer.

The body of a command does the heavy imports, so that ``--help`` answers at once.
"""

import gc
import io
import os
import sys
import tempfile
import traceback
import warnings

# before numpy is loaded: on small matrices BLAS threads only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# derivatives are mostly zeros that are never written: with huge pages they would take memory all the same
os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")
# pydantic would search all installed packages for plugins
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

import typer

from pneucli.cli import console
from pneucli.cli.program import as_command, build
from pneucli.errors import InputError, environment_error


def main() -> None:
    """Run the program; exit codes: 0 done, 1 a check failed, 2 the input is at fault, 3 the program is, 130 Ctrl-C.

    A closed pipe on standard output is exit code 0.
    """
    warnings.simplefilter("ignore", RuntimeWarning)  # of intermediate numbers; the results are checked
    gc.set_threshold(100_000, 50, 100)  # a compiler makes many objects, and few that are garbage
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without "×" shows "?"
    try:
        code = _run()
        sys.stdout.flush()
    except BrokenPipeError:
        console.discard_output(sys.stdout)
        code = 0
    sys.exit(code)


def _run() -> int:
    try:
        _call([word for word in sys.argv[1:] if word != "--debug"])
    except SystemExit as leave:
        if isinstance(leave.__context__, BrokenPipeError):  # typer's exit code would be 1
            raise leave.__context__ from None
        return int(leave.code or 0)
    except InputError as error:
        return _print_refusal(error)
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except Exception as error:
        refused = environment_error(error) if isinstance(error, OSError | MemoryError) else None
        if refused:
            return _print_refusal(refused)
        console.print_message(_fault_message(error))
        return 3
    return 0


def _print_refusal(error: InputError) -> int:
    """Print the error, under ``--json`` as JSON as well; return the exit code."""
    console.print_message(f"error: {error}")
    if "--json" in sys.argv[1:]:
        console.print_error(error)
    return error.exit_code


def _call(arguments: list[str]) -> None:
    """Run the command; under ``--json`` a wrong command line is an InputError, which is printed as JSON as well."""
    command = as_command(build(next((word for word in arguments if not word.startswith("-")), "")))
    if "--json" not in arguments:
        command(args=arguments, prog_name="pneucli")
        return
    try:
        code = command(args=arguments, prog_name="pneucli", standalone_mode=False)
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        raise InputError("command line", error.format_message(), mend="pneucli COMMAND --help", code="E001") from error
    sys.exit(code or 0)


def _fault_message(error: Exception) -> str:
    trace = "".join(traceback.format_exception(error))
    if "--debug" in sys.argv[1:]:
        return trace.rstrip()
    what = f"fault of the program: {type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
    try:
        with tempfile.NamedTemporaryFile("w", prefix="pneucli-", suffix=".log", delete=False, encoding="utf-8") as file:
            file.write(f"{' '.join(sys.argv)}\n{trace}")
    except (OSError, UnicodeError):
        return f"{what} (--debug shows the traceback)"
    return f"{what} (traceback in {file.name}; --debug shows it)"
