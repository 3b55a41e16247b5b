"""One HTML page of the built-in scenes: picture, purpose, size, and the command for each.

The page is a single file: pictures are PNG data URIs, and nothing is loaded from elsewhere. The
same version of the package writes the same page.
"""

from __future__ import annotations

import base64
import contextlib
import io
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from .. import __version__
from ..errors import FileError
from ..pipeline import Progress, render
from ..scenes import BUILTIN, build
from ..settings import Settings
from ..typed import Size, U8Array
from .colors import srgb_bytes

PICTURE_SIZE: Size = (480, 270)


class SceneEntry(NamedTuple):
    """What the page says about a scene. picture: (H, W, 3) sRGB bytes of its composite."""

    name: str
    description: str
    triangles: int
    objects: int
    textures: int
    picture: U8Array

    @property
    def facts(self) -> dict[str, int | str]:
        """Everything but the picture, as JSON values."""
        return {
            "description": self.description,
            "triangles": self.triangles,
            "objects": self.objects,
            "textures": self.textures,
        }


def scene_entry(
    name: str, size: Size = PICTURE_SIZE, tessellation: int | None = None
) -> SceneEntry:
    """Build and render a built-in scene in its own view with default settings."""
    scene = build(name, tessellation)
    frame = render(scene, settings=Settings(size=size))
    return SceneEntry(
        name=name,
        description=BUILTIN[name].description,
        triangles=scene.triangle_count,
        objects=len(scene.nodes),
        textures=len(scene.images),
        picture=srgb_bytes(frame.resolved.composite),
    )


def check_page(path: str | Path, *, force: bool = False) -> Path:
    """Where the page is written; raises FileError if it may not be, before any work is done."""
    path = Path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise FileError(f"page is '{path}'; expected a file name that ends in .html")
    if path.is_dir():
        raise FileError(f"{path} is a folder; expected a file name: give another")
    if path.exists() and not force:
        raise FileError(
            f"{path} exists; choose another name, or --force (force=True) to replace it"
        )
    return path


def write_scene_page(
    path: str | Path, *, force: bool = False, progress: Progress | None = None
) -> list[SceneEntry]:
    """Render every built-in scene small and write the page; returns what it says.

    Folders on the way are made. Raises FileError for a name without .html, for a file that exists
    unless `force`, and where it cannot be written; nothing is left behind then.
    """
    path = check_page(path, force=force)
    entries = []
    for i, name in enumerate(BUILTIN):
        if progress is not None:
            progress(name, i / len(BUILTIN))
        entries.append(scene_entry(name))

    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(scene_page(entries), encoding="utf-8", newline="\n")
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise FileError(
            f"{path} cannot be written ({error.strerror or error}); expected a place that may be "
            "written to: give another"
        ) from error
    return entries


def scene_page(entries: Sequence[SceneEntry]) -> str:
    """The page as text."""
    cards = "\n".join(_card(entry) for entry in entries)
    return (
        _PAGE.replace("@VERSION@", escape(__version__))
        .replace("@COUNT@", str(len(entries)))
        .replace("@CARDS@", cards)
    )


def _card(entry: SceneEntry) -> str:
    height, width = entry.picture.shape[:2]
    sentence = escape(entry.description[:1].upper() + entry.description[1:])
    name = escape(entry.name)
    return f"""<article id="{name}">
<img src="{_data_uri(entry.picture)}" width="{width}" height="{height}"
 alt="Rendered picture of the scene {name}: {sentence}.">
<div class="text">
<h2>{name}</h2>
<p>{sentence}.</p>
<p class="size">{_counted(entry.triangles, "triangle")} · {_counted(entry.objects, "object")} ·
 {_counted(entry.textures, "texture") if entry.textures else "no textures"}</p>
<pre tabindex="0"><code>ssr-ref render {name} -o golden/{name}</code></pre>
</div>
</article>"""


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def _data_uri(picture: U8Array) -> str:
    from PIL import Image

    png = io.BytesIO()
    Image.fromarray(picture).save(png, "PNG", compress_level=9)
    return "data:image/png;base64," + base64.b64encode(png.getvalue()).decode("ascii")


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Built-in scenes of ssr_ref</title>
<style>
:root { color-scheme: light dark; --paper: #f6f6f4; --card: #fff; --ink: #1b1b1f; --soft: #55555e;
 --line: #d8d8d4; --code: #efefec; }
@media (prefers-color-scheme: dark) { :root { --paper: #17171a; --card: #212126; --ink: #ececf0;
 --soft: #b0b0ba; --line: #38383f; --code: #2b2b31; } }
* { box-sizing: border-box; }
body { margin: 0; padding: 1.5rem clamp(1rem, 4vw, 3rem) 3rem; background: var(--paper);
 color: var(--ink); font: 1rem/1.5 system-ui, sans-serif; }
header { max-width: 44rem; margin-bottom: 1.5rem; }
h1 { margin: 0 0 0.5rem; font-size: 1.75rem; line-height: 1.2; }
h2 { margin: 0; font-size: 1.2rem; }
p { margin: 0.25rem 0 0; }
main { display: grid; gap: 1.25rem;
 grid-template-columns: repeat(auto-fill, minmax(min(100%, 22rem), 1fr)); }
article { display: flex; flex-direction: column; overflow: hidden; background: var(--card);
 border: 1px solid var(--line); border-radius: 0.6rem; }
img { display: block; width: 100%; height: auto; background: #000; }
.text { display: flex; flex-direction: column; flex: 1; padding: 0.9rem 1rem 1rem; }
.size, header p { color: var(--soft); }
.size { font-size: 0.9rem; margin-bottom: 0.75rem; }
pre { margin: auto 0 0; padding: 0.5rem 0.7rem; overflow-x: auto; white-space: pre-wrap;
 overflow-wrap: anywhere; background: var(--code);
 border-radius: 0.35rem; font-size: 0.85rem; }
code { font-family: ui-monospace, SFMono-Regular, Menlo, Consolas, monospace; }
</style>
</head>
<body>
<header>
<h1>Built-in scenes</h1>
<p>The @COUNT@ scenes of ssr_ref @VERSION@, made by code alone. Each picture is the composite that
the default settings give; where a ray found nothing on screen, a mirror stays dark.</p>
</header>
<main>
@CARDS@
</main>
</body>
</html>
"""
