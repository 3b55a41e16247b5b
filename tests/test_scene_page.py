"""The page of built-in scenes, its command, and the table in the docs."""

from __future__ import annotations

import base64
import io
import json
import re
import shlex
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssr_ref.__main__ import main
from ssr_ref.errors import FileError
from ssr_ref.pipeline import render
from ssr_ref.report import scene_list
from ssr_ref.report.colors import srgb_bytes
from ssr_ref.report.scene_list import SceneEntry, scene_entry, scene_page, write_scene_page
from ssr_ref.scenes import BUILTIN, build
from ssr_ref.settings import Settings

VOID = {"meta", "img", "link", "br", "input"}


class Page(HTMLParser):
    """Tags with their attributes in order, text by tag; fails where tags do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len({name for name, _ in attrs}) == len(attrs)
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.text.setdefault(self._open[-1], []).append(" ".join(data.split()))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]


def fake_entry(name: str, size: object = None, tessellation: object = None) -> SceneEntry:
    """An entry with a picture of noise instead of a render."""
    noise = np.random.default_rng(len(name)).integers(0, 256, (23, 37, 3), np.uint8)
    description = BUILTIN[name].description if name in BUILTIN else 'strange <b>&amp; "odd"\''
    return SceneEntry(name, description, 1234567, 1, 0 if name == "poles" else 2, noise)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_list, "scene_entry", fake_entry)


def test_entry_is_the_scene_and_its_composite() -> None:
    entry = scene_entry("textured", (37, 23), 2)
    scene = build("textured", 2)
    assert entry.name == "textured" and entry.description == BUILTIN["textured"].description
    assert (entry.triangles, entry.objects, entry.textures) == (64 * 2 + 188, 11, 8)
    assert len(scene.nodes) == 11
    composite = render(scene, settings=Settings(size=(37, 23))).resolved.composite
    assert np.array_equal(entry.picture, srgb_bytes(composite))


def test_page_says_everything_about_every_scene() -> None:
    entries = [fake_entry(name) for name in BUILTIN]
    text = scene_page(entries)
    page = Page(text)
    assert page.text["h2"] == list(BUILTIN)
    images = page.all("img")
    assert len(images) == len(entries)
    for entry, image in zip(entries, images):
        kind, data = image["src"].split(",", 1)
        assert kind == "data:image/png;base64"
        picture = np.array(Image.open(io.BytesIO(base64.b64decode(data, validate=True))))
        assert np.array_equal(picture, entry.picture)
        assert (int(image["width"]), int(image["height"])) == (37, 23)
        sentence = entry.description[0].upper() + entry.description[1:] + "."
        assert entry.name in image["alt"] and sentence in " ".join(image["alt"].split())
        assert sentence in page.text["p"]
    sizes = [text for text in page.text["p"] if "triangles" in text]
    assert len(sizes) == len(entries)
    assert set(sizes) == {
        "1,234,567 triangles · 1 object · 2 textures",
        "1,234,567 triangles · 1 object · no textures",
    }
    for name, command in zip(BUILTIN, page.text["code"]):
        assert shlex.split(command) == ["ssr-ref", "render", name, "-o", f"golden/{name}"]


def test_page_stands_alone_and_can_be_read_anywhere() -> None:
    text = scene_page([fake_entry("teapot")])
    page = Page(text)
    assert text.startswith("<!DOCTYPE html>\n") and page.all("html") == [{"lang": "en"}]
    meta = {m["name"]: m["content"] for m in page.all("meta") if "name" in m}
    assert meta["viewport"] == "width=device-width, initial-scale=1"
    assert meta["color-scheme"] == "light dark" and "prefers-color-scheme: dark" in text
    assert page.all("meta")[0] == {"charset": "utf-8"}
    assert {name for name, _ in page.tags} <= {
        "html", "head", "meta", "title", "style", "body", "header", "h1", "p", "main", "article",
        "img", "div", "h2", "pre", "code",
    }  # fmt: skip
    # Nothing is fetched: the one address in the file is the picture's own data.
    without_picture = re.sub(r'src="data:[^"]*"', "", text)
    for word in ("src=", "href=", "url(", "@import", "http", "//"):
        assert word not in without_picture, word
    # One column where the window is narrow; long commands scroll inside their box.
    assert "minmax(min(100%, 22rem), 1fr)" in text and "overflow-x: auto" in text
    assert "@" not in re.sub(r"@media", "", without_picture)  # no placeholder is left


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_contrasts_with_its_ground(scheme: str) -> None:
    """WCAG 2 contrast of 4.5 or more for every pair of text and ground."""
    roots = re.findall(r":root \{(.*?)\}", scene_page([]), re.DOTALL)
    colors = dict(re.findall(r"--(\w+): (#\w+)", roots[0 if scheme == "light" else 1]))

    def luminance(name: str) -> float:
        digits = colors[name][1:]
        digits = "".join(2 * c for c in digits) if len(digits) == 3 else digits
        c = np.array([int(digits[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        return float((linear * [0.2126, 0.7152, 0.0722]).sum())

    for text, ground in (("ink", "paper"), ("ink", "card"), ("ink", "code"), ("soft", "paper"),
                         ("soft", "card")):  # fmt: skip
        low, high = sorted((luminance(text), luminance(ground)))
        assert (high + 0.05) / (low + 0.05) >= 4.5, (text, ground)


def test_names_and_sentences_are_escaped() -> None:
    page = Page(scene_page([fake_entry('<i>"x')]))
    assert page.text["h2"] == ['<i>"x']
    assert 'Strange <b>&amp; "odd"\'.' in page.text["p"]
    assert not page.all("b") and not page.all("i")


def test_page_is_written_whole_or_not_at_all(
    quick: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "new folder" / "scenes.html"
    seen: list[tuple[str, float]] = []
    entries = write_scene_page(path, progress=lambda name, share: seen.append((name, share)))
    assert [entry.name for entry in entries] == list(BUILTIN) == [name for name, _ in seen]
    assert [share for _, share in seen] == [i / len(BUILTIN) for i in range(len(BUILTIN))]
    assert path.read_bytes() == scene_page(entries).encode()
    assert [p.name for p in path.parent.iterdir()] == ["scenes.html"]

    path.write_text("mine")
    with pytest.raises(FileError, match=r"scenes\.html exists; .*--force"):
        write_scene_page(path)
    assert path.read_text() == "mine"
    write_scene_page(path, force=True)
    assert path.read_bytes() == scene_page(entries).encode()

    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be written"):
        write_scene_page(tmp_path / "file" / "scenes.html")
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        write_scene_page(tmp_path / "folder.html", force=True)
    with pytest.raises(FileError, match=r"'.*scenes'; expected a file name that ends in \.html"):
        write_scene_page(tmp_path / "scenes")

    def full(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(FileError, match=r"cannot be written \(No space left on device\)"):
        write_scene_page(path, force=True)
    assert [p.name for p in path.parent.iterdir()] == ["scenes.html"]


def test_command(quick: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scenes.html"
    assert main(["scenes", "--html", str(path)]) == 0
    out = capsys.readouterr()
    assert out.out.split() == ["page", str(path), "scenes", str(len(BUILTIN))] and out.err == ""
    assert main(["scenes", "--html", str(path)]) == 2
    assert capsys.readouterr().err.startswith(f"error: {path} exists")
    assert main(["scenes", "--html", str(path), "--force", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["page"] == str(path) and list(told["scenes"]) == sorted(BUILTIN)
    assert told["scenes"]["water"] == {
        "description": BUILTIN["water"].description,
        "triangles": 1234567,
        "objects": 1,
        "textures": 2,
    }
    assert main(["scenes", "--html", str(path), "--force", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["scenes", "--force"]) == 2
    assert "without --html" in capsys.readouterr().err


def test_docs_table_is_the_registry_and_counts_triangles() -> None:
    text = (Path(__file__).parents[1] / "docs" / "scenes.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \| ([0-9,]+) \|$", text, re.MULTILINE)
    assert [(name, sentence) for name, sentence, _, _ in rows] == [
        (name, builtin.description) for name, builtin in BUILTIN.items()
    ]
    for name, _, formula, at_16 in rows:
        python = re.sub(r"([0-9]) n", r"\1 * n", formula).replace("n²", "n**2").replace("−", "-")
        for n in (4, 8, 16):
            assert build(name, n).triangle_count == eval(python, {"n": n}), (name, n, python)
        assert f"{build(name).triangle_count:,}" == at_16
