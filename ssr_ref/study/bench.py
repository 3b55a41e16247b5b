"""Error against run time: every case of a sweep on the same G-buffers, timed and judged.

Times: one call of a case warms it up (its kernels are compiled then, which is told apart); after
that all cases take turns, so that a slow moment of the machine touches all of them, and each has
the median of its own. Garbage collection is off meanwhile. The time of a case is its trace, slabs
or planes prepared, and the passes that it alone needs (back faces). What every method needs (the
other G-buffer passes) or does alike (composite) is left out, and so is judging the errors.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..buffers import HitBuffer
from ..camera import Camera, View
from ..pipeline import Drawn, Progress, Stages, draw_gbuffer, raster_options
from ..raster.geometry import flatten
from ..raster.rasterize import rasterize
from ..scene import Scene
from ..settings import Settings
from ..ssr.resolve import resolve
from ..ssr.trace import trace
from ..typed import F64Array, U32Array
from .judge import Judged, judge, pooled
from .sweep import Case

if TYPE_CHECKING:
    from ..analytic.scene import AnalyticScene

BLOCK = (8, 4)
"""Width and height in pixels of what a GPU runs in step: 32 lanes."""


@dataclass(frozen=True, slots=True)
class Row:
    """One case over all cameras. Times in seconds a frame, work a ray unless said.

    changes: what the case sets; settings: resolved.
    seconds: median of the trace, mean over cameras; low, high: least and greatest repeat, alike.
    passes: seconds of passes that this case alone needs. compile_seconds: its first call less the
    median; kernels that an earlier case has compiled cost it nothing. block_steps: mean over 8×4
    blocks of pixels of the largest step count in each. draws: objects drawn more than once.
    """

    method: str
    label: str
    changes: dict[str, Any]
    settings: Settings
    seconds: float
    low: float
    high: float
    passes: float
    compile_seconds: float
    steps: float
    fetches: float
    block_steps: float
    draws: int
    errors: Judged

    @property
    def total(self) -> float:
        """Seconds of trace and own passes."""
        return self.seconds + self.passes

    def to_json(self) -> dict[str, Any]:
        """JSON values; a number that there is none of is None."""
        return {
            "method": self.method,
            "label": self.label,
            "changes": self.changes,
            "settings": self.settings.to_json(),
            "seconds": {
                "total": self.total,
                "trace": self.seconds,
                "least": self.low,
                "greatest": self.high,
                "passes": self.passes,
                "compile": self.compile_seconds,
            },
            "work": {
                "steps": self.steps,
                "fetches": self.fetches,
                "block_steps": self.block_steps,
                "draws": self.draws,
            },
            "errors": self.errors.to_json(),
        }


@dataclass(frozen=True, slots=True)
class Bench:
    """All rows of one scene. rays: over all cameras. knowable: the error that is left to a method
    that finds everything the screen shows and nothing else. not_applicable: method and reason.
    """

    scene: str
    scene_sha256: str
    triangles: int
    size: tuple[int, int]
    cameras: int
    repeats: int
    rays: int
    rows: tuple[Row, ...]
    knowable: Judged | None
    truth_seconds: float
    not_applicable: tuple[tuple[str, str], ...] = ()


def run_bench(
    scene: Scene | AnalyticScene,
    cameras: Sequence[Camera | View | None],
    cases: Sequence[Case],
    *,
    repeats: int = 5,
    flip: bool = True,
    progress: Progress | None = None,
) -> Bench:
    """Time and judge every case from every camera.

    cameras: None is the scene's own view. flip: also the FLIP of the reflection, if the package for
    it is installed. Raises what `pipeline.render` raises.
    """
    from ..truth import trace_truth

    told = progress or (lambda name, share: None)
    times = np.zeros((len(cases), len(cameras), repeats + 1))
    passes = np.zeros(len(cameras))
    work = np.zeros((len(cases), 4))  # steps, fetches, blocks, sum of the largest steps in each
    judged: list[list[Judged]] = [[] for _ in cases]
    knowable: list[Judged] = []
    truth_seconds = 0.0
    for view_index, camera in enumerate(cameras):
        share = view_index / len(cameras)
        told("G-buffer", share)
        first = replace(cases[0].settings, thickness_from="back_faces")
        more = {f"case-{i}": case.settings for i, case in enumerate(cases)}
        drawn = draw_gbuffer(scene, camera, first, more, Stages(None))
        passes[view_index] = back_face_seconds(scene, drawn, repeats)
        told("truth", share)
        started = time.perf_counter()
        truth = trace_truth(scene, drawn.camera, drawn.settings, drawn.gbuffer)
        truth_seconds += time.perf_counter() - started

        # Every case once, then all in turn.
        runs = [
            lambda s=settings, d=drawn: trace(d.view, d.gbuffer, s)
            for settings in drawn.more.values()
        ]
        for repeat in range(repeats + 1):
            with collector_off():
                for i, run in enumerate(runs):
                    told(
                        cases[i].label,
                        share + (repeat + i / len(runs)) / (repeats + 1) / len(cameras),
                    )
                    times[i, view_index, repeat] = _seconds(run)

        for i, (run, settings) in enumerate(zip(runs, drawn.more.values())):
            told("errors", share + i / len(runs) / len(cameras))
            hits = run()
            work[i] += work_of(hits)
            shown = resolve(drawn.view, drawn.gbuffer, hits, settings)
            judged[i].append(judge((hits, shown), truth, drawn.gbuffer, settings, flip=flip))
        knowable.append(judge(None, truth, drawn.gbuffer, drawn.settings, flip=flip))

    rays = sum(k.rays for k in knowable)
    rows = [
        _row(case, times[i], passes, work[i], pooled(judged[i]), drawn.more[f"case-{i}"], rays)
        for i, case in enumerate(cases)
    ]
    return Bench(
        scene=scene.name,
        scene_sha256=scene.content_sha256(),
        triangles=int(scene.triangle_count),
        size=drawn.settings.size,
        cameras=len(cameras),
        repeats=repeats,
        rays=rays,
        rows=tuple(rows),
        knowable=pooled(knowable),
        truth_seconds=truth_seconds,
    )


def _row(
    case: Case,
    times: F64Array,
    passes: F64Array,
    work: F64Array,
    errors: Judged,
    settings: Settings,
    rays: int,
) -> Row:
    """times: (cameras, 1 + repeats), the first of each the warm-up."""
    medians = np.median(times[:, 1:], axis=1)
    steps, fetches, blocks, largest = work
    return Row(
        method=case.method,
        label=case.label,
        changes=case.changes,
        settings=settings,
        seconds=float(medians.mean()),
        low=float(times[:, 1:].min(axis=1).mean()),
        high=float(times[:, 1:].max(axis=1).mean()),
        passes=float(passes.mean()) if settings.thickness_from == "back_faces" else 0.0,
        compile_seconds=max(0.0, float(times[0, 0] - medians[0])),
        steps=steps / rays if rays else 0.0,
        fetches=fetches / rays if rays else 0.0,
        block_steps=largest / blocks if blocks else 0.0,
        draws=0,
        errors=errors,
    )


def back_face_seconds(scene: Scene | AnalyticScene, drawn: Drawn, repeats: int) -> float:
    """Seconds that back faces add to the G-buffer: medians with and without, taken in turn.

    A closed-form scene's are cast with everything else; there it is 0.
    """
    if not isinstance(scene, Scene):
        return 0.0
    geometry = flatten(scene)
    both = [replace(raster_options(drawn.settings), back_depth=back) for back in (False, True)]
    runs = [lambda o=options: rasterize(drawn.view, geometry, o) for options in both]
    times = np.zeros((2, repeats + 1))
    with collector_off():
        for repeat in range(repeats + 1):
            for i, run in enumerate(runs):
                times[i, repeat] = _seconds(run)
    without, with_back = np.median(times[:, 1:], axis=1)
    return max(0.0, float(with_back - without))


def work_of(hits: HitBuffer) -> F64Array:
    """(4,) sums over the image: steps, fetches, blocks with a ray, the largest steps of each."""
    largest = block_maxima(hits.steps)
    return np.array(
        [
            hits.steps.sum(dtype=np.float64),
            hits.fetches.sum(dtype=np.float64),
            np.count_nonzero(largest),
            largest.sum(dtype=np.float64),
        ]
    )


def block_maxima(steps: U32Array) -> U32Array:
    """The largest value in each block of 8×4 pixels; blocks at the border may be cut off."""
    width, height = BLOCK
    rows, columns = -(-steps.shape[0] // height), -(-steps.shape[1] // width)
    padded = np.zeros((rows * height, columns * width), steps.dtype)
    padded[: steps.shape[0], : steps.shape[1]] = steps
    out: U32Array = padded.reshape(rows, height, columns, width).max(axis=(1, 3))
    return out


@contextmanager
def collector_off() -> Iterator[None]:
    """No garbage collection inside; one before."""
    was = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _seconds(run: Callable[[], object]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start
