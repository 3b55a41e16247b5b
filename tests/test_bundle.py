"""Golden bundles: bytes that repeat, hashes that notice everything, folders whole or absent."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from frames import box_scene, made_up_frame

import ssr_ref
from ssr_ref.buffers import Status
from ssr_ref.errors import BundleError, FileError
from ssr_ref.fileio import bundle as bundle_module
from ssr_ref.fileio import folder as folder_module
from ssr_ref.fileio import manifest as manifest_module
from ssr_ref.fileio.bundle import check_target, finite_range, load_bundle, write_bundle
from ssr_ref.fileio.exr import read_exr, write_exr
from ssr_ref.fileio.npz import content_sha256, read_npz, write_npz
from ssr_ref.pipeline import Traced

ODD_SIZES = [(1, 1), (1, 9), (9, 1), (37, 53), (16, 17)]


@pytest.fixture(scope="module")
def frame():
    return made_up_frame()


@pytest.fixture(scope="module")
def written(frame, tmp_path_factory):
    """One bundle with previews, read only."""
    return write_bundle(frame, tmp_path_factory.mktemp("written") / "golden")


@pytest.fixture
def copy(written, tmp_path):
    """A bundle that a test may damage."""
    return Path(shutil.copytree(written, tmp_path / "copy"))


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()
    }


def any_bits(shape: tuple[int, int], seed: int = 0) -> np.ndarray:
    """float32 of every kind: random bit patterns, and the special values."""
    rng = np.random.default_rng(seed)
    bits = rng.integers(0, 2**32, shape, dtype=np.uint32)
    special = np.array([np.inf, -np.inf, np.nan, -0.0, 1e-45, 3.4e38], np.float32).view(np.uint32)
    bits.ravel()[: special.size] = special[: bits.size]
    return bits.view(np.float32)


# EXR


@pytest.mark.parametrize("shape", ODD_SIZES)
def test_exr_keeps_every_bit(tmp_path, shape):
    images = {
        "Z": any_bits(shape),
        "status": np.random.default_rng(3).integers(0, 2**32, shape, dtype=np.uint32),
        "hit.U": np.full(shape, np.inf, np.float32),
    }
    write_exr(tmp_path / "a.exr", images)
    back = read_exr(tmp_path / "a.exr")
    assert list(back) == sorted(images)
    for name, image in images.items():
        assert back[name].dtype == image.dtype and back[name].shape == shape
        assert np.array_equal(back[name].view(np.uint32), image.view(np.uint32)), name


def test_exr_bytes_repeat_and_do_not_depend_on_the_order_of_channels(tmp_path):
    images = {"b": any_bits((37, 53)), "a": any_bits((37, 53), 1), "B": any_bits((37, 53), 2)}
    write_exr(tmp_path / "1.exr", images)
    os.utime(tmp_path / "1.exr", (0, 0))
    write_exr(tmp_path / "2.exr", dict(reversed(images.items())))
    assert (tmp_path / "1.exr").read_bytes() == (tmp_path / "2.exr").read_bytes()


def exr_header(data: bytes) -> dict[str, tuple[str, bytes]]:
    """Attributes of an EXR header: name, type, size, value (OpenEXR file layout)."""
    assert data[:4] == bytes.fromhex("762f3101")
    at, found = 8, {}
    while data[at] != 0:
        name, _, rest = data[at : at + 512].partition(b"\0")
        kind = rest.split(b"\0", 1)[0]
        at += len(name) + len(kind) + 2
        size = struct.unpack_from("<i", data, at)[0]
        found[name.decode()] = (kind.decode(), data[at + 4 : at + 4 + size])
        at += 4 + size
    return found


def test_exr_is_a_zip_scanline_file_with_no_time_or_host_in_its_header(written):
    header = exr_header((written / "golden.exr").read_bytes())
    assert set(header) == {
        "channels", "compression", "dataWindow", "displayWindow", "lineOrder",
        "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth", "type",
    }  # fmt: skip
    assert header["compression"][1] == b"\x03"  # ZIP, 16 lines a block
    assert header["type"][1] == b"scanlineimage"
    names = [re.match(rb"[\w.]+", part) for part in re.split(rb"\0.{16}", header["channels"][1])]
    found = [m[0].decode() for m in names if m]
    assert found == sorted(found) and {"R", "G", "B", "Z", "hit.U"} <= set(found)


@pytest.mark.parametrize(
    "images",
    [
        {},
        {"a": np.zeros((2, 3), np.float64)},
        {"a": np.zeros((2, 3), np.int32)},
        {"a": np.zeros((2, 3, 1), np.float32)},
        {"a": np.zeros((2, 3), np.float32), "b": np.zeros((3, 2), np.float32)},
        {"a": np.zeros((0, 3), np.float32)},
    ],
)
def test_exr_refuses_what_it_cannot_hold(tmp_path, images):
    with pytest.raises(FileError, match="expected"):
        write_exr(tmp_path / "a.exr", images)
    assert not (tmp_path / "a.exr").exists()


def test_damaged_or_missing_exr_and_npz_are_file_errors(tmp_path, written):
    for name, read in (("golden.exr", read_exr), ("golden.npz", read_npz)):
        half = tmp_path / name
        with pytest.raises(FileError, match="no file"):
            read(half)
        data = (written / name).read_bytes()
        half.write_bytes(data[: len(data) // 2])
        with pytest.raises(FileError, match="expected a complete file"):
            read(half)


# Arrays


def test_content_hash_is_the_documented_one():
    array = np.array([[1.0, np.inf], [-0.0, 2.0]], np.float32)
    by_hand = b"<f4\n2x2\n" + struct.pack("<4f", 1.0, np.inf, -0.0, 2.0)
    assert content_sha256(array) == hashlib.sha256(by_hand).hexdigest()
    small = np.array([[3, 4, 5]], np.uint8)
    assert content_sha256(small) == hashlib.sha256(b"|u1\n1x3\n\3\4\5").hexdigest()


def test_content_hash_sees_dtype_shape_and_values_but_not_memory_layout():
    array = np.arange(12, dtype=np.float32).reshape(3, 4)
    same = content_sha256(array)
    assert content_sha256(np.asfortranarray(array)) == same
    assert content_sha256(array.astype(">f4")) == same
    assert content_sha256(np.repeat(array, 2, axis=1)[:, ::2]) == same
    others = [array.reshape(4, 3), array.astype(np.float64), array.view(np.int32), array + 1]
    assert len({same, *(content_sha256(other) for other in others)}) == 5


def test_npz_is_sorted_stored_and_dated_1980(tmp_path):
    import zipfile

    write_npz(tmp_path / "a.npz", {"b": np.ones(3), "a": np.asfortranarray(np.eye(2))})
    with zipfile.ZipFile(tmp_path / "a.npz") as file:
        entries = file.infolist()
    assert [e.filename for e in entries] == ["a.npy", "b.npy"]
    assert all(e.date_time == (1980, 1, 1, 0, 0, 0) and e.compress_type == 0 for e in entries)


def test_stored_arrays_are_the_frames_own_rounded_once(frame, written):
    arrays = load_bundle(written).arrays
    memory = {**frame.gbuffer.arrays(), **frame.hits.arrays(), **frame.resolved.arrays()}
    assert set(arrays) == {*memory, "hit_uv"}
    for name, array in memory.items():
        expected = array.astype(np.float32) if array.dtype.kind == "f" else array
        assert arrays[name].dtype == expected.dtype, name
        assert np.array_equal(arrays[name], expected, equal_nan=expected.dtype.kind == "f"), name
    uv = (frame.hits.hit_px / [37.0, 23.0]).astype(np.float32)
    assert np.array_equal(arrays["hit_uv"], uv, equal_nan=True)
    assert {arrays[n].dtype.str for n in ("status", "end", "flags")} == {"|u1"}
    assert {arrays[n].dtype.str for n in ("steps", "fetches")} == {"<u4"}


def test_further_methods_have_arrays_layers_settings_and_pictures_of_their_own(frame, tmp_path):
    other = made_up_frame((37, 23), seed=2)
    march = Traced(replace(frame.settings, tracer="march"), other.hits, other.resolved)
    both = replace(frame, more={"march": march})
    path = write_bundle(both, tmp_path / "both")
    bundle = load_bundle(path)

    # The first method's arrays keep every byte; the other's are those of a bundle of its own.
    alone = load_bundle(write_bundle(frame, tmp_path / "first", previews=False))
    apart = load_bundle(write_bundle(both.of("march"), tmp_path / "march", previews=False))
    own = {*frame.hits.arrays(), *frame.resolved.arrays(), "hit_uv"}
    assert set(bundle.arrays) == {*alone.arrays, *("march." + name for name in own)}
    for name, array in alone.arrays.items():
        assert array.tobytes() == bundle.arrays[name].tobytes(), name
    for name in own:
        assert apart.arrays[name].tobytes() == bundle.arrays["march." + name].tobytes(), name
    assert bundle.settings == frame.settings and bundle.more == {"march": march.settings}
    assert bundle.manifest["content_sha256"] != alone.manifest["content_sha256"]
    counts = bundle.manifest["methods"]["march"]
    assert (
        counts
        == {k: v for k, v in apart.manifest["statistics"].items() if k != "raster"}
        != bundle.manifest["statistics"]
    )

    channels = read_exr(path / "golden.exr")
    assert np.array_equal(channels["march.status"], other.hits.status)
    assert np.array_equal(channels["march.R"], other.resolved.composite[..., 0])
    assert np.array_equal(channels["march.hit.U"], apart.arrays["hit_uv"][..., 0], equal_nan=True)
    pictures = {p.name for p in (path / "previews" / "march").iterdir()}
    assert {"status.png", "composite.png", "overview.png"} <= pictures
    assert not pictures & {"depth.png", "albedo.png", "object_id.png"}

    # Its settings are part of the identity.
    seeded = replace(march, settings=replace(march.settings, seed=7))
    third = write_bundle(replace(frame, more={"march": seeded}), tmp_path / "c", previews=False)
    assert load_bundle(third).manifest["content_sha256"] != bundle.manifest["content_sha256"]


def test_every_nan_is_stored_as_the_same_bits(frame):
    strange = frame.hits.hit_depth.copy()
    strange[np.isnan(strange)] = np.array([0xFFF8_0000_DEAD_BEEF], np.uint64).view(np.float64)[0]
    other = replace(frame, hits=replace(frame.hits, hit_depth=strange))
    mine, theirs = (manifest_module.stored_arrays(f)["hit_depth"] for f in (frame, other))
    assert np.isnan(mine).any() and mine.tobytes() == theirs.tobytes()


def test_float64_buffers_stay_float64_in_the_npz_and_are_rounded_in_the_exr(tmp_path):
    frame = made_up_frame((9, 5), buffer_dtype="float64")
    path = write_bundle(frame, tmp_path / "b", previews=False)
    arrays = load_bundle(path).arrays
    floats = {name for name, a in arrays.items() if a.dtype.kind == "f"}
    assert all(arrays[name].dtype == np.float64 for name in floats)
    assert np.array_equal(arrays["hit_px"], frame.hits.hit_px, equal_nan=True)
    channels = read_exr(path / "golden.exr")
    assert np.array_equal(channels["Z"], frame.gbuffer.depth.astype(np.float32))


def test_two_buffers_of_one_name_are_refused(frame, monkeypatch):
    class Twin:
        def arrays(self):
            return {"depth": np.zeros((23, 37), np.float32)}

    with pytest.raises(BundleError, match="two buffers are named depth"):
        manifest_module.stored_arrays(replace(frame, resolved=Twin()))


def test_buffers_that_nothing_asked_for_are_left_out(tmp_path, frame):
    less = replace(frame, gbuffer=replace(frame.gbuffer, back_depth=None, roughness=None))
    bundle = load_bundle(write_bundle(less, tmp_path / "b", previews=False))
    assert not {"back_depth", "roughness"} & {*bundle.arrays, *bundle.manifest["channels"]}


def test_exr_holds_the_same_values_as_the_npz_through_the_manifests_table(written):
    bundle = load_bundle(written)
    channels = read_exr(written / "golden.exr")
    assert set(channels) == set(bundle.manifest["channels"])
    seen = set()
    for name, told in bundle.manifest["channels"].items():
        array = bundle.arrays[told["array"]]
        plane = array[..., told["component"]] if array.ndim == 3 else array
        assert channels[name].dtype == np.dtype(told["dtype"]), name
        assert np.array_equal(
            channels[name].astype(np.float64),
            plane.astype(np.float64) + told["plus"],
            equal_nan=True,
        ), name
        seen.add(told["array"])
    assert seen == set(bundle.arrays) - {"hit_px"}
    assert channels["object_id"].min() == 0  # none
    assert channels["object_id"].max() == bundle.arrays["object_id"].max() + 1


# The folder and its JSON


def test_two_writes_give_the_same_bytes_but_for_the_run(tmp_path, frame):
    first = files_of(write_bundle(frame, tmp_path / "one"))
    other = replace(frame, timings={"trace": 99.0})
    second = files_of(write_bundle(other, tmp_path / "deep" / "er" / "two"))
    assert {*first} == {*second}
    assert [n for n in first if first[n] != second[n]] == ["run.json"]


def test_the_folder_holds_what_the_contract_says(written):
    names = {n for n in files_of(written) if not n.startswith("previews/")}
    assert names == {
        "manifest.json", "golden.exr", "golden.npz", "scene.glb", "camera.json", "lights.json",
        "settings.json", "run.json",
    }  # fmt: skip
    assert any(n.startswith("previews/") and n.endswith(".png") for n in files_of(written))
    manifest = json.loads((written / "manifest.json").read_bytes())
    assert {*manifest["files"]} == {*files_of(written)} - {"manifest.json", "run.json"}
    for name, digest in manifest["files"].items():
        assert hashlib.sha256((written / name).read_bytes()).hexdigest() == digest


def test_the_identity_can_be_computed_with_sha256_alone(written):
    manifest = json.loads((written / "manifest.json").read_bytes())
    lines = [f"array {n} {a['content_sha256']}" for n, a in sorted(manifest["arrays"].items())]
    lines.append("scene " + manifest["scene"]["content_sha256"])
    lines += [
        f"{name} {hashlib.sha256((written / name).read_bytes()).hexdigest()}"
        for name in ("camera.json", "settings.json")
    ]
    text = "".join(line + "\n" for line in lines)
    assert hashlib.sha256(text.encode()).hexdigest() == manifest["content_sha256"]


def test_the_identity_changes_with_anything_that_matters_and_with_nothing_else(frame, tmp_path):
    def identity(changed, name):
        return load_bundle(write_bundle(changed, tmp_path / name, previews=False)).manifest[
            "content_sha256"
        ]

    composite = frame.resolved.composite.copy()
    composite[3, 4, 1] = np.nextafter(composite[3, 4, 1], np.float32(2))
    dark = ssr_ref.Lights(ambient=(0.0, 0.0, 0.0))
    moved = replace(frame.camera, near=frame.camera.near * 2)
    same = identity(frame, "a")
    assert identity(replace(frame, timings={}, warnings=()), "b") == same
    others = [
        replace(frame, resolved=replace(frame.resolved, composite=composite)),
        replace(frame, scene=frame.scene.with_lights(dark)),
        replace(frame, camera=moved),
        replace(frame, settings=replace(frame.settings, seed=5)),
    ]
    assert len({same, *(identity(f, f"o{i}") for i, f in enumerate(others))}) == 5


def test_json_is_sorted_ascii_without_nan_or_paths_or_time(written, frame):
    for path in written.glob("*.json"):
        text = path.read_text("ascii")

        def no_literal(name):
            raise AssertionError(f"{name} in a JSON file")

        data = json.loads(text, parse_constant=no_literal)
        assert text == json.dumps(data, sort_keys=True, indent=1) + "\n", path.name
        if path.name != "run.json":
            home = [str(written.parent), str(Path.home()), os.uname().nodename]
            assert not [word for word in home if len(word) > 5 and word in text], path.name
            assert not re.search(r"/tmp|/home|/root|20\d\d-\d\d", text), path.name
    run = json.loads((written / "run.json").read_bytes())
    assert run["seconds"]["trace"] == frame.timings["trace"] and run["seconds"]["write"] > 0
    assert run["versions"]["numpy"] == np.__version__ and run["threads"] >= 1


def test_the_manifest_says_what_is_needed(written, frame):
    manifest = load_bundle(written).manifest
    assert manifest["schema_version"] == 1 and manifest["size"] == [37, 23]
    assert manifest["package"] == {"name": "ssr_ref", "version": ssr_ref.__version__}
    assert manifest["names"]["status"] == {s.name: int(s) for s in Status}
    assert manifest["warnings"] == ["made-up buffers"]
    statistics = manifest["statistics"]
    assert sum(statistics["status"].values()) == statistics["pixels"] == 37 * 23
    assert statistics["hits"] == int((frame.hits.status == 1).sum()) > 0
    # A ray was walked where the status is a hit or one of those that a walk ends with.
    assert statistics["rays"] == int(((frame.hits.status == 1) | (frame.hits.status > 5)).sum())
    assert statistics["steps"] == sum(int(v) for v in frame.hits.steps.ravel())
    assert statistics["raster"]["culled"] == 2
    assert manifest["camera"]["world_from_view"] == frame.camera.world_from_view.tolist()
    lengths = {name: manifest["settings"][name] for name in ("thickness", "max_distance", "bias")}
    assert lengths == {
        "thickness": 8 / 64,
        "max_distance": 4 * 8,
        "bias": 0,
    }  # radius 8: 2⁻⁶ r, 4 r


def test_a_bundle_gives_back_what_went_in(written, frame):
    bundle = ssr_ref.load_bundle(written)
    assert np.array_equal(bundle.camera.world_from_view, frame.camera.world_from_view)
    assert np.array_equal(bundle.camera.clip_from_view, frame.camera.clip_from_view)
    assert (bundle.camera.near, bundle.camera.far) == (frame.camera.near, np.inf)
    assert bundle.settings == frame.settings and bundle.lights == frame.scene.lights
    assert bundle.scene.content_sha256() == frame.scene.content_sha256()
    assert bundle.scene is bundle.scene and bundle.scene.name == "box"
    with pytest.raises(AttributeError):
        bundle.manifest = {}


def test_infinite_lengths_survive(tmp_path):
    frame = made_up_frame((9, 7), max_distance=np.inf, thickness=np.inf)
    bundle = load_bundle(write_bundle(frame, tmp_path / "b", previews=False))
    assert bundle.settings.max_distance == np.inf == bundle.settings.thickness


@pytest.mark.parametrize("size", [(1, 1), (9, 1), (1, 9), (53, 37)])
def test_odd_sizes(tmp_path, size):
    bundle = load_bundle(write_bundle(made_up_frame(size), tmp_path / "b", previews=False))
    assert bundle.arrays["composite"].shape == (size[1], size[0], 3)


# Damage


def test_one_flipped_byte_in_any_file_is_noticed(copy):
    for name, data in sorted(files_of(copy).items()):
        if name == "run.json":  # not part of the golden
            continue
        for at in (0, len(data) // 3, len(data) - 1):
            damaged = bytearray(data)
            damaged[at] ^= 1
            (copy / name).write_bytes(damaged)
            with pytest.raises(BundleError) as caught:
                load_bundle(copy)
            assert name in str(caught.value) and "\n" not in str(caught.value)
        (copy / name).write_bytes(data)
    load_bundle(copy)


def test_a_cut_or_missing_file_is_noticed_and_named(copy):
    for name, data in sorted(files_of(copy).items()):
        for damage in (
            lambda p: p.unlink(),
            lambda p, d=data: p.write_bytes(d[:-7]),
            lambda p: p.write_bytes(b""),
        ):
            damage(copy / name)
            if name == "run.json":
                load_bundle(copy)
            else:
                with pytest.raises(BundleError, match=re.escape(name)):
                    load_bundle(copy)
            (copy / name).write_bytes(data)


def edit_manifest(folder: Path, change) -> None:
    """Edit a manifest as someone would who also repairs its own hash."""
    data = json.loads((folder / "manifest.json").read_bytes())
    change(data)
    data.pop("manifest_sha256", None)
    (folder / "manifest.json").write_bytes(manifest_module.encode(data))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda m: m["arrays"]["depth"].update(content_sha256="0" * 64), "array depth"),
        (lambda m: m["arrays"].pop("status"), "array status"),
        (lambda m: m["arrays"].update(extra=m["arrays"]["depth"]), "array extra"),
        (lambda m: m["files"].pop("golden.exr"), "golden.exr"),
        (lambda m: m["files"].update({"../other": "0" * 64}), "outside the bundle"),
        (lambda m: m["files"].update({"/etc/hostname": "0" * 64}), "outside the bundle"),
        (lambda m: m.update(content_sha256="0" * 64), "content_sha256"),
        (lambda m: m["scene"].update(content_sha256="0" * 64), "content_sha256"),
        (lambda m: m.update(schema_version=2), "schema version 2"),
        (lambda m: m.update(format="other"), "not that of a golden bundle"),
        (lambda m: m.pop("files"), "lacks what a reader needs"),
        (lambda m: m.update(arrays=[]), "manifest.json"),
    ],
)
def test_a_manifest_that_does_not_agree_is_noticed(copy, change, told):
    edit_manifest(copy, change)
    with pytest.raises(BundleError, match=re.escape(told)) as caught:
        load_bundle(copy)
    assert "\n" not in str(caught.value)


def test_a_scene_that_is_not_the_manifests_is_noticed(copy):
    other = json.loads((copy / "lights.json").read_bytes())
    other["ambient"] = [0.0, 0.0, 0.0]
    (copy / "lights.json").write_bytes(manifest_module.json_bytes(other))
    digest = hashlib.sha256((copy / "lights.json").read_bytes()).hexdigest()
    edit_manifest(copy, lambda m: m["files"].update({"lights.json": digest}))
    bundle = load_bundle(copy)
    with pytest.raises(BundleError, match="not the scene of the manifest"):
        _ = bundle.scene


@pytest.mark.parametrize("make", ["missing", "file", "empty", "not_json", "list", "nested"])
def test_what_is_no_bundle_is_one_line(tmp_path, make):
    path = tmp_path / "b"
    if make == "file":
        path.write_text("x")
    elif make != "missing":
        path.mkdir()
    texts = {"not_json": "{", "list": "[1, 2]", "nested": "[" * 100_000}
    if make in texts:
        (path / "manifest.json").write_text(texts[make])
    with pytest.raises(BundleError) as caught:
        load_bundle(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


# Whole or not at all


def fails_half_way(error: BaseException):
    """A writer that leaves half a file and then fails."""

    def write(path, *args, **kwargs):
        path = path if isinstance(path, Path) else args[-1]
        if path.suffix:
            path.write_bytes(b"half")
        raise error

    return write


WRITERS = [
    "_write_json", "_write_scene", "write_npz", "write_exr", "_write_previews", "file_sha256",
]  # fmt: skip
ERRORS = [
    OSError(errno.ENOSPC, "No space left on device"),
    OSError(errno.EFBIG, "File too large"),
    OSError(errno.EIO, "Input/output error"),
    KeyboardInterrupt(),
    RuntimeError("a bug"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__ + str(e)[:9])
@pytest.mark.parametrize("writer", WRITERS)
def test_a_failure_leaves_nothing_and_touches_nothing(frame, tmp_path, monkeypatch, writer, error):
    old = tmp_path / "old"
    write_bundle(made_up_frame((5, 3)), old, previews=False)
    before = files_of(tmp_path)
    monkeypatch.setattr(bundle_module, writer, fails_half_way(error))
    kind = FileError if isinstance(error, OSError) else type(error)
    for target in (old, tmp_path / "new", tmp_path / "made" / "on the" / "way"):
        with pytest.raises(kind) as caught:
            write_bundle(frame, target, force=True)
        if isinstance(error, OSError):
            assert "\n" not in str(caught.value)
            full = error.errno in (errno.ENOSPC, errno.EFBIG)
            assert ("disk full" in str(caught.value)) == full
        assert files_of(tmp_path) == before
        assert [p.name for p in tmp_path.iterdir()] == ["old"]


def test_a_full_disk_during_previews_is_told_like_any_other(frame, tmp_path, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, "No space left on device")

    from PIL import Image

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(FileError, match=r"disk full.*previews"):
        write_bundle(frame, tmp_path / "b")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("failing", [1, 2])
def test_a_failed_rename_puts_the_old_bundle_back(frame, tmp_path, monkeypatch, failing):
    old = tmp_path / "old"
    write_bundle(made_up_frame((5, 3)), old, previews=False)
    before = files_of(tmp_path)
    calls = []
    rename = Path.rename

    def failing_rename(self, target):
        calls.append(target)
        if len(calls) == failing:
            raise OSError(errno.EBUSY, "Device or resource busy")
        return rename(self, target)

    monkeypatch.setattr(folder_module.Path, "rename", failing_rename)
    with pytest.raises(FileError, match="busy"):
        write_bundle(frame, old, force=True, previews=False)
    assert files_of(tmp_path) == before and [p.name for p in tmp_path.iterdir()] == ["old"]


def test_force_replaces_a_bundle_whole(frame, tmp_path):
    target = write_bundle(frame, tmp_path / "b")
    with pytest.raises(FileError, match="exists"):
        write_bundle(frame, target)
    write_bundle(made_up_frame((5, 3)), target, force=True, previews=False)
    assert load_bundle(target).manifest["size"] == [5, 3]
    assert not (target / "previews").exists() and [p.name for p in tmp_path.iterdir()] == ["b"]


def test_force_fills_an_empty_folder_and_follows_a_link(frame, tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    write_bundle(frame, tmp_path / "link", force=True, previews=False)
    assert (tmp_path / "link").is_symlink()
    assert load_bundle(tmp_path / "real").manifest["size"] == [37, 23]


@pytest.mark.parametrize("found", ["photo.jpg", "manifest.json", "sub/notes.txt"])
def test_force_never_deletes_what_is_not_a_bundles(frame, tmp_path, found):
    kept = tmp_path / "b" / found
    kept.parent.mkdir(parents=True)
    kept.write_text('{"files": {}}')
    with pytest.raises(FileError, match="not a golden bundle"):
        write_bundle(frame, tmp_path / "b", force=True)
    assert files_of(tmp_path) == {f"b/{found}": b'{"files": {}}'}


def test_force_keeps_a_bundle_that_someone_put_files_into(frame, copy):
    (copy / "previews" / "mine.txt").write_text("notes")
    with pytest.raises(FileError, match=r"previews/mine\.txt"):
        write_bundle(frame, copy, force=True)
    assert (copy / "previews" / "mine.txt").read_text() == "notes"


def test_targets_that_cannot_be_are_refused_in_one_line(frame, tmp_path):
    (tmp_path / "file").write_text("x")
    targets = {
        tmp_path / "file": "is a file",
        tmp_path / "file" / "b": "is a file",
        tmp_path / "file" / "deep" / "b": "is a file",
        tmp_path / ("n" * 300): "File name too long",
        Path("/proc/ssr-ref/b"): "cannot write",
        Path("/dev/null/b"): "is a file",
    }
    for target, told in targets.items():
        for act in (check_target, lambda t: write_bundle(frame, t, force=True)):
            with pytest.raises(FileError, match=told) as caught:
                act(target)
            assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_an_unwritable_parent_is_refused(frame, tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(FileError, match="Permission denied"):
            check_target(tmp_path / "b")
    finally:
        tmp_path.chmod(0o700)


def test_check_target_leaves_no_trace(tmp_path):
    check_target(tmp_path / "a" / "b" / "c")
    assert not list(tmp_path.iterdir())


def test_others_may_read_a_bundle_as_the_umask_says(frame, tmp_path):
    old = os.umask(0o027)
    try:
        path = write_bundle(frame, tmp_path / "b", previews=False)
    finally:
        os.umask(old)
    assert path.stat().st_mode & 0o777 == 0o750


def test_progress_is_told_from_0_to_1(frame, tmp_path):
    told = []
    write_bundle(frame, tmp_path / "b", progress=lambda *step: told.append(step))
    assert {stage for stage, _ in told} == {"write"}
    shares = [share for _, share in told]
    assert shares[0] == 0.0 and shares[-1] == 1.0 and shares == sorted(shares)


def test_finite_range():
    assert finite_range(np.array([np.nan, 2.0, -np.inf, 1.0])) == (1.0, 2.0, 2)
    assert finite_range(np.array([np.nan])) == (None, None, 1)
    assert finite_range(np.array([[-1, 5]], np.int32)) == (-1, 5, 0)


def test_the_box_scene_is_what_the_helper_says():
    assert box_scene().triangle_count == 14 and len(box_scene().nodes) == 2


@pytest.mark.parametrize("size", [(960, 540), (1920, 1080), (37, 23), (1, 1), (16384, 3)], ids=str)
def test_stored_hits_stay_in_their_texel(size: tuple[int, int]) -> None:
    """Float32 rounding of a hit an ulp before a border must not name the neighbour's texel."""
    from ssr_ref.fileio.manifest import stored_arrays

    width, height = size
    rng = np.random.default_rng(3)
    frame = made_up_frame((37, 23))
    texel = np.stack(
        [rng.integers(0, width, (23, 37)), rng.integers(0, height, (23, 37))], axis=-1
    ).astype(np.float64)
    hit_px = np.nextafter(texel + 1.0, 0.0)  # the worst place: one float64 ulp inside
    hit_px[::3] = texel[::3]  # exactly on the near border
    hit_px[1::3] = texel[1::3] + rng.random((8, 37, 2))
    frame = replace(
        frame,
        hits=replace(frame.hits, hit_px=hit_px),
        settings=replace(frame.settings, size=size),
    )
    stored = stored_arrays(frame)
    scale = np.array([width, height])
    assert stored["hit_px"].dtype == np.float32
    assert np.array_equal(np.floor(stored["hit_px"]), texel)
    for product in (stored["hit_uv"] * scale.astype(np.float32), stored["hit_uv"] * scale):
        assert np.array_equal(np.floor(product), texel)
    # The move is of float32 rounding's own size: 2⁻²⁴ relative, a few times.
    assert np.abs(stored["hit_px"] - hit_px).max() <= 2.0**-22 * max(size)
