"""What commands print: tables for a terminal, plain columns for a pipe, JSON on request."""

from __future__ import annotations

import json as json_text
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .progress import ProgressBar


@dataclass(frozen=True, slots=True)
class Output:
    """The global options on output.

    quiet: no summary, no bar. json: one JSON object, no text. verbose: a longer summary.
    """

    quiet: bool = False
    json: bool = False
    verbose: bool = False

    def progress(self) -> ProgressBar:
        """A bar on stderr; it shows nothing unless that is a terminal."""
        return ProgressBar(enabled=not self.quiet and sys.stderr.isatty())

    def data(self, value: Any) -> None:
        """Print the command's one JSON object."""
        print(json_text.dumps(value, sort_keys=True, indent=1, allow_nan=False))

    def facts(self, rows: Sequence[tuple[str, str]]) -> None:
        """Print names and values, one a line."""
        width = max(len(name) for name, _ in rows)
        for name, value in rows:
            print(f"{name:{width}}  {value}".rstrip())

    def table(self, title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table; the first column is text, the others are aligned right."""
        print()
        if sys.stdout.isatty():
            _rich_table(title, headers, rows)
            return
        print(title)
        widths = [max(len(row[i]) for row in (headers, *rows)) for i in range(len(headers))]
        for row in (headers, *rows):
            cells = [
                f"{v:<{w}}" if i == 0 else f"{v:>{w}}" for i, (v, w) in enumerate(zip(row, widths))
            ]
            print("  " + "  ".join(cells).rstrip())


def _rich_table(title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for i, header in enumerate(headers):
        table.add_column(header, justify="left" if i == 0 else "right", no_wrap=i == 0)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console(highlight=False).print(table)


def percent(part: int, whole: int) -> str:
    """A share as text; "-" of nothing."""
    return f"{100.0 * part / whole:.1f} %" if whole else "-"


def length(value: float | str | None) -> str:
    """A length in scene units as text."""
    return "inf" if value is None or isinstance(value, str) else f"{value:g}"
