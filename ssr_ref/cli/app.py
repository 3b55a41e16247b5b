"""The command line: commands, global options, and how every error becomes one line.

Commands import what they need when they run, so that `--help` is quick.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from types import FrameType
from typing import Annotated, Any, NoReturn

import typer
from typer.main import get_command

from .. import __version__
from ..errors import SsrRefError, SsrRefWarning
from .bench import bench
from .blame import blame
from .info import info
from .output import Output
from .pixel import pixel
from .presets import presets
from .render import render
from .scenes import scenes
from .vectors import vectors

BAD_INPUT = 2
INTERRUPTED = 130

app = typer.Typer(
    name="ssr-ref",
    add_completion=False,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(render)
app.command()(info)
app.command()(pixel)
app.command()(presets)
app.command()(bench)
app.command()(blame)
app.command()(scenes)
app.command()(vectors)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"ssr-ref {__version__}")
        raise typer.Exit


@app.callback(epilog="These options may also stand after the command's name.")
def global_options(
    ctx: typer.Context,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print no summary and no progress bar.")
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of text.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also print what was made of a mesh file.")
    ] = False,
    threads: Annotated[
        int | None,
        typer.Option(metavar="N", help="Threads to compute with; the results are the same."),
    ] = None,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """A reference for screen-space reflection: golden images, oracles and benchmarks."""
    ctx.obj = Output(quiet=quiet, json=json, verbose=verbose)


def run(argv: Sequence[str]) -> int:
    """Run one command line and return its exit code.

    An error that a user can cause is one `error: ...` line on stderr and code 2; a warning is one
    `warning: ...` line. Any other exception is a bug and leaves with its traceback.
    """
    for stream in (sys.stdout, sys.stderr):  # a name that cannot be printed is no reason to stop
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    with _terminated_as_exception(), _warnings_as_lines():
        try:
            code = _invoke(list(argv) or ["--help"])
            sys.stdout.flush()
        except (KeyboardInterrupt, typer.Abort):
            code = INTERRUPTED
        except SystemExit as leaving:
            code = leaving.code if isinstance(leaving.code, int) else 1
        except SsrRefError as error:
            return _error(str(error))
        except MemoryError as error:
            return _error(f"not enough memory ({error}); choose a smaller image size or scene")
        except BrokenPipeError:  # the reader of our output has left: nobody to tell
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
        except OSError as error:
            return _error(f"{error.strerror or error}: {error.filename or 'standard output'}")
    if code == INTERRUPTED:
        print("interrupted", file=sys.stderr)
    return code


def _invoke(argv: list[str]) -> int:
    try:
        result = get_command(app).main(args=argv, prog_name="ssr-ref", standalone_mode=False)
    except Exception as error:
        # Typer brings its own copy of click, older ones use click itself: known by its methods.
        if not (hasattr(error, "format_message") and hasattr(error, "exit_code")):
            raise
        context: Any = getattr(error, "ctx", None)
        path = context.command_path if context is not None else "ssr-ref"
        return _error(f"{_usage_message(error, argv)} See '{path} --help'.")
    return result if isinstance(result, int) else 0


def _usage_message(error: Any, argv: Sequence[str]) -> str:
    """Typer's message, which does not say what it found in an option: look it up."""
    message = str(error.format_message()).strip()
    message += "" if message.endswith((".", "?")) else "."
    names = tuple(getattr(getattr(error, "param", None), "opts", ()))
    for word, value in pairwise(argv):
        if word in names and f"'{value}'" not in message:
            return f"{word} is '{value}'. {message}"
    return message


def _error(message: str) -> int:
    print("error: " + _one_line(message), file=sys.stderr)
    return BAD_INPUT


def _one_line(message: str) -> str:
    return " ".join(part.strip() for part in message.splitlines() if part.strip())


@contextmanager
def _warnings_as_lines() -> Iterator[None]:
    """Each different SsrRefWarning becomes one line on stderr; other warnings are as ever."""
    printed: set[str] = set()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: Any = None,
        line: str | None = None,
    ) -> None:
        if not issubclass(category, SsrRefWarning):
            usual(message, category, filename, lineno, file, line)
        elif (text := _one_line(str(message))) not in printed:
            printed.add(text)
            print("warning: " + text, file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", SsrRefWarning)
        usual, warnings.showwarning = warnings.showwarning, show
        yield


@contextmanager
def _terminated_as_exception() -> Iterator[None]:
    """SIGTERM raises SystemExit, so that a half-written bundle is removed before leaving."""

    def leave(number: int, frame: FrameType | None) -> NoReturn:
        raise SystemExit(128 + number)

    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
