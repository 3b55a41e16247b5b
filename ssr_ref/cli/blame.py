"""`ssr-ref blame`: what a method could have known, and where its error comes from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import SettingsError
from .options import CameraOptions, SceneOptions, TraceOptions, grouped
from .output import Output, percent

if TYPE_CHECKING:
    from ..blame import Blame, Outcome
    from ..pipeline import Frame

FORMAT = "ssr_ref blame"


@grouped
def blame(
    ctx: typer.Context,
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="As for `render`.")],
    scene_options: SceneOptions,
    camera_options: CameraOptions,
    trace_options: TraceOptions,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for blame.json and pictures."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace such a folder that is there.")
    ] = False,
    ambiguity: Annotated[
        bool,
        typer.Option("--ambiguity", help="Also where the answer hangs on rounding: eight traces."),
    ] = False,
) -> None:
    """Compare methods with ray-traced truth: outcomes, and error in four parts that add up."""
    from ..blame import ambiguity as ambiguity_mask
    from ..blame import blame as blame_frame
    from ..blame import outcome
    from ..fileio.folder import MANIFEST_FILE, FolderKind, check_target, disk_errors, whole_folder
    from ..fileio.manifest import json_bytes
    from ..fileio.npz import file_sha256
    from ..pipeline import render
    from ..truth import trace_truth

    out: Output = ctx.obj
    methods = trace_options.methods()
    if any(settings.listing for settings in methods.values()) and ambiguity:
        raise SettingsError("--ambiguity with listing; expected one of them")
    scene_options.check()
    camera_options.given()
    if output is not None:
        check_target(output, FolderKind("blame", "blame", FORMAT), force=force)

    with out.progress() as progress:
        loaded = scene_options.load(scene)
        first, *rest = methods
        more = {name: methods[name] for name in rest}
        frame = render(
            loaded, camera_options.view(loaded), methods[first], more=more, progress=progress
        )
        progress("truth", 0.0)
        truth = trace_truth(loaded, frame.camera, frame.settings, frame.gbuffer)
        frames = {first or frame.settings.tracer: replace(frame, more={})}
        frames |= {name: frame.of(name) for name in rest}
        found: dict[str, tuple[Outcome, Blame, Any]] = {}
        for i, (name, one) in enumerate(frames.items()):
            progress("blame", i / len(frames))
            mask = ambiguity_mask(one) if ambiguity else None
            found[name] = outcome(one, truth), blame_frame(one, truth), mask
        data = {
            "format": FORMAT,
            "scene": {"name": loaded.name, "content_sha256": loaded.content_sha256()},
            "methods": {
                name: {
                    "settings": frames[name].settings.to_json(),
                    "outcome": seen.to_json(),
                    "blame": blamed.totals.to_json(),
                    **({} if mask is None else {"ambiguous": int((mask != 0).sum())}),
                }
                for name, (seen, blamed, mask) in found.items()
            },
        }
        if output is not None:
            from ..report.blame_pictures import write_blame_pictures

            with whole_folder(output) as folder:
                for name, (_, blamed, mask) in found.items():
                    title = f"{loaded.name}, {name}"
                    target = folder if len(found) == 1 else folder / name
                    write_blame_pictures(blamed, truth, target, ambiguity=mask, title=title)
                with disk_errors(MANIFEST_FILE):
                    (folder / "blame.json").write_bytes(json_bytes(data))
                    files = sorted(p for p in folder.rglob("*") if p.is_file())
                    hashes = {p.relative_to(folder).as_posix(): file_sha256(p) for p in files}
                    manifest = {"format": FORMAT, "files": hashes}
                    (folder / MANIFEST_FILE).write_bytes(json_bytes(manifest))
    if out.json:
        out.data(data)
    elif not out.quiet:
        for name, (seen, blamed, mask) in found.items():
            _print(out, name, frames[name], seen, blamed, mask)
        if output is not None:
            print(f"\nwritten to {output}")


def _print(out: Output, name: str, frame: Frame, seen: Outcome, blamed: Blame, mask: Any) -> None:
    from ..buffers import Status, TruthClass

    print()
    if not seen.rays:
        out.facts([("method", name), ("rays", "no pixel reflects: there is nothing to compare")])
        return
    d, z = seen.distance, seen.depth_error
    out.facts(
        [
            ("method", name),
            ("rays", f"{seen.rays}, {percent(seen.visible, seen.rays)} with their truth on screen"),
            ("precision", _share(seen.precision)),
            ("recall", _share(seen.recall)),
            ("F1", _share(seen.f1)),
            ("distance", f"median {d.median:.4f}, p95 {d.p95:.4f}, most {d.most:.2f} px"
                         + (f" at {d.worst}" if d.worst else "")),
            ("depth error", f"median {z.median:.3g}, p95 {z.p95:.3g}, of the depth"),
            ("wrong object", _share(seen.wrong_object)),
            *([] if mask is None else [("ambiguous", percent(int((mask != 0).sum()), seen.rays))]),
        ]
    )  # fmt: skip
    classes = [c for c in TruthClass if c and seen.status_by_class[:, c].any()]
    rows = [
        (s.name, *(str(seen.status_by_class[s, c]) for c in classes))
        for s in Status
        if seen.status_by_class[s, classes].any()
    ]
    out.table("pixels by status and truth", ("status", *(c.name for c in classes)), rows)
    totals = blamed.totals
    parts = [(part, _share(share)) for part, share in totals.shares.items()]
    out.table(f"mean square error {totals.mean_square:.4g}", ("part", "share"), parts)
    charged = [
        (kind, str(n), percent(n, totals.counted)) for kind, n in totals.charged.items() if n
    ]
    out.table("pixels by what was first wrong", ("charge", "pixels", "share"), charged)


def _share(value: float) -> str:
    return "-" if math.isnan(value) else f"{100.0 * value:.2f} %"
