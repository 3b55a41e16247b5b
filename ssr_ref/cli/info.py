"""`ssr-ref info`: verify a golden bundle and say what is in it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .output import Output, length, percent
from .render import method_table

if TYPE_CHECKING:
    from ..fileio.bundle import Bundle


def info(
    ctx: typer.Context,
    bundle: Annotated[Path, typer.Argument(help="Folder of a golden bundle.", metavar="BUNDLE")],
) -> None:
    """Verify every hash of a golden bundle and print what it holds."""
    from ..fileio.bundle import load_bundle

    out: Output = ctx.obj
    loaded = load_bundle(bundle)
    if out.json:
        out.data({**loaded.manifest, "verified": True})
    elif not out.quiet:
        _print(out, loaded)


def _print(out: Output, bundle: Bundle) -> None:
    from ..fileio.bundle import SHAPES_FILE

    manifest = bundle.manifest
    scene, statistics = manifest["scene"], manifest["statistics"]
    width, height = manifest["size"]
    what = "surfaces" if SHAPES_FILE in manifest["files"] else "triangles"
    lines = [
        ("bundle", str(bundle.path)),
        ("scene", f"{scene['name']} ({scene['triangles']} {what}, {scene['objects']} objects)"),
        ("size", f"{width}x{height}"),
        *_camera(bundle),
        *_settings(bundle),
        ("rays", f"{statistics['rays']} ({percent(statistics['rays'], statistics['pixels'])})"),
        (
            "hits",
            f"{statistics['hits']} ({percent(statistics['hits'], statistics['rays'])} of rays)",
        ),
        ("written by", f"{manifest['package']['name']} {manifest['package']['version']}"),
        ("content sha256", manifest["content_sha256"]),
    ]
    out.facts(lines + [("warning", text) for text in manifest["warnings"]])
    if "methods" in manifest:
        method_table(out, "further methods", manifest["methods"])
    out.table("statuses", ("status", "number", "pixels", "share"), _statuses(manifest))
    out.table(
        "arrays", ("array", "dtype", "shape", "least", "greatest", "not finite"), _arrays(bundle)
    )
    out.table("files", ("file", "bytes"), _files(bundle))
    print("\nhashes verified")


def _camera(bundle: Bundle) -> list[tuple[str, str]]:
    camera = bundle.camera
    kind = "perspective" if camera.is_perspective else "orthographic"
    eye = ", ".join(f"{v:g}" for v in camera.world_from_view[:3, 3])
    towards = ", ".join(f"{-v:g}" for v in camera.world_from_view[:3, 2])
    return [
        ("camera", f"{kind}, eye ({eye}), looks along ({towards})"),
        ("near, far", f"{camera.near:g}, {camera.far:g}"),
    ]


def _settings(bundle: Bundle) -> list[tuple[str, str]]:
    """Settings that are not the defaults; lengths always, since they come from the scene."""
    from ..settings import Settings

    plain = Settings().to_json() | {"edge_power": bundle.settings.tracer_edge_power}
    if bundle.settings.tracer != "march":
        plain["step"] = bundle.settings.step  # of no other tracer
    usual: dict[str, Any] = json.loads(json.dumps(plain))
    found: dict[str, Any] = json.loads(json.dumps(bundle.settings.to_json()))
    changed = [
        f"{name} {length(value) if isinstance(value, float) else json.dumps(value)}"
        for name, value in sorted(found.items())
        if name != "size" and value != usual[name]
    ]
    return [("settings", ", ".join(changed).replace('"', "") or "defaults")]


def _statuses(manifest: dict[str, Any]) -> list[tuple[str, ...]]:
    numbers, pixels = manifest["names"]["status"], manifest["statistics"]["pixels"]
    counts = manifest["statistics"]["status"]
    return [
        (name, str(numbers[name]), str(counts[name]), percent(counts[name], pixels))
        for name in sorted(counts, key=lambda n: int(numbers[n]))
        if counts[name]
    ]


def _arrays(bundle: Bundle) -> list[tuple[str, ...]]:
    from ..fileio.bundle import finite_range

    rows = []
    for name, array in bundle.arrays.items():
        least, greatest, others = finite_range(array)
        shape = "x".join(str(n) for n in array.shape)
        ends = ("-" if v is None else f"{v:.6g}" for v in (least, greatest))
        rows.append((name, array.dtype.name, shape, *ends, str(others)))
    return rows


def _files(bundle: Bundle) -> list[tuple[str, ...]]:
    names = ["manifest.json", *sorted(bundle.manifest["files"])]
    return [(name, str((bundle.path / name).stat().st_size)) for name in names]
