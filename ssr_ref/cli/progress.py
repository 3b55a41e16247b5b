"""A progress bar on a terminal's stderr for work that takes more than about a second."""

from __future__ import annotations

import threading
from types import TracebackType
from typing import Any

PATIENCE = 1.0
"""Seconds of work before the bar appears: shorter work would only make it flash."""


class ProgressBar:
    """A context and a callback: called with a stage's name and the share of it that is done."""

    def __init__(self, *, enabled: bool) -> None:
        self._enabled = enabled
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._bar: Any = None
        self._task: Any = None
        self._state = ("", 0.0)

    def __enter__(self) -> ProgressBar:
        if self._enabled:
            self._timer = threading.Timer(PATIENCE, self._appear)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __call__(self, stage: str, share: float) -> None:
        with self._lock:
            self._state = (stage, min(max(float(share), 0.0), 1.0))
            if self._bar is not None:
                self._bar.update(self._task, description=stage, completed=self._state[1])

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._timer is not None:
            self._timer.cancel()
        with self._lock:
            self._enabled = False
            if self._bar is not None:
                self._bar.stop()

    def _appear(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        with self._lock:
            if not self._enabled:  # the work ended while rich was being imported
                return
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._task = self._bar.add_task(self._state[0], total=1.0, completed=self._state[1])
            self._bar.start()
