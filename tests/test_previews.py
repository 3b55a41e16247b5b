"""Previews: exact colours, pictures in place, honest scales, nothing modified."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssr_ref.buffers import STATUS_OF_END, End, Flag, GBuffer, HitBuffer, Resolved, Status
from ssr_ref.camera import Camera
from ssr_ref.errors import FileError
from ssr_ref.pipeline import Frame
from ssr_ref.report import colors, legend, previews
from ssr_ref.report.previews import write_previews
from ssr_ref.scene import Material, Mesh, Node, Primitive, Scene
from ssr_ref.settings import Settings

SIZES = [(1, 1), (1, 9), (9, 1), (37, 53), (53, 37), (400, 3)]


def tiny_scene() -> Scene:
    triangle = Primitive([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    nodes = tuple(
        Node(n, 0) for n in ("floor", "ball\u00e9 \u2603", "a ball with a long name " * 4)
    )
    materials = tuple(Material(n) for n in ("floor mirror", "red", "green"))
    return Scene((Mesh("m", (triangle,)),), nodes, materials, name="discs")


def synthetic(width: int, height: int) -> Frame:
    """A mirror floor under the horizon and two discs, with every status in a band of its own."""
    y, x = np.mgrid[:height, :width].astype(np.float64)
    u, v = (x + 0.5) / width, (y + 0.5) / height
    aspect = width / height
    floor = v > 0.4
    discs = [((0.3, 0.45), 0.18, 4.0), ((0.7, 0.4), 0.14, 6.0)]

    depth = np.where(floor, 1.2 / np.maximum(v - 0.38, 1e-9), np.inf)
    object_id = np.where(floor, 0, -1).astype(np.int32)
    normal = np.where(floor[..., None], [0.0, 0.8, 0.6], 0.0)
    back = np.full_like(depth, np.inf)
    for i, ((cu, cv), radius, z) in enumerate(discs):
        a, b = (u - cu) * aspect / radius, (v - cv) / radius
        inside = a * a + b * b < 1.0
        bulge = np.sqrt(np.maximum(0.0, 1.0 - a * a - b * b))
        depth = np.where(inside, z - bulge, depth)
        back = np.where(inside, z + bulge, back)
        object_id[inside] = i + 1
        normal = np.where(inside[..., None], np.stack([a, -b, bulge], -1), normal)

    drawn = object_id >= 0
    tint = np.array([[0.9, 0.9, 0.9], [0.8, 0.1, 0.05], [0.1, 0.6, 0.2]])
    albedo = np.where(drawn[..., None], tint[np.maximum(object_id, 0)], 0.0)
    radiance = albedo * (0.2 + 0.9 * np.maximum(0.0, normal[..., 1:2]))
    mirror = object_id == 0

    # Bands across the floor: a hit first, then every status that a walk can end with.
    ends = [Status.INVALID_INPUT, Status.BELOW_SURFACE, *(s for s in Status if s >= Status.BLOCKED)]
    band = np.minimum((u * 2 * len(ends)).astype(int), 2 * len(ends) - 1)
    miss = np.array([Status.HIT] * len(ends) + ends, np.uint8)[band]
    status = np.full(depth.shape, Status.BACKGROUND, np.uint8)
    status[drawn] = Status.NOT_REFLECTIVE
    status[mirror] = miss[mirror]
    hit = status == Status.HIT
    end = np.where(status >= Status.LEFT_SCREEN_L, status - STATUS_OF_END, 0).astype(np.uint8)
    flags = np.where(mirror, (x.astype(int) // 7) % 32, 0).astype(np.uint8)
    walked = hit | (status >= Status.BLOCKED)

    def at_hits(values: np.ndarray) -> np.ndarray:
        mask = hit.reshape(hit.shape + (1,) * (values.ndim - hit.ndim))
        return np.where(mask, values, np.nan)

    steps = np.where(walked, (v * 200 + u * 40).astype(np.uint32), 0).astype(np.uint32)
    confidence = np.where(hit, np.clip(1.0 - (2 * np.abs(u - 0.5)) ** 3, 0, 1), 0.0)
    reflection = np.where(hit[..., None], np.stack([u, 1 - v, 0.5 + 0 * u], -1), 0.0)
    reflectivity = np.where(mirror[..., None], 0.8, 0.0) * np.ones(3)

    def f32(a: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(a, np.float32)

    gbuffer = GBuffer(
        depth=f32(depth),
        triangle_id=np.where(drawn, (x // 5 + 97 * (y // 5)).astype(np.int32), -1).astype(np.int32),
        object_id=object_id,
        material_id=object_id.copy(),
        back_depth=f32(back),
        geo_normal_vs=f32(normal),
        normal_vs=f32(normal),
        albedo=f32(albedo),
        reflectivity=f32(reflectivity),
        roughness=f32(np.where(drawn, 0.3, 0.0)),
        radiance=f32(radiance),
    )
    hits = HitBuffer(
        status=status,
        end=end,
        flags=flags,
        hit_px=at_hits(np.stack([x + 0.25, (1 - v) * height], -1)),
        hit_depth=at_hits(depth * 1.1),
        residual=at_hits(0.01 * v),
        length=at_hits(3 * u),
        steps=steps,
        fetches=steps * 2,
    )
    resolved = Resolved(
        edge_fade=f32(confidence),
        distance_fade=f32(np.where(hit, 1.0, 0.0)),
        confidence=f32(confidence),
        reflection=f32(reflection),
        composite=f32(radiance * (1 - reflectivity) + reflectivity * reflection),
    )
    camera = Camera.perspective(np.eye(4), 40.0, width / height, near=0.01)
    settings = Settings(size=(width, height)).resolved(1.0)
    return Frame(tiny_scene(), camera, settings, gbuffer, hits, resolved, ("a warning",))


def empty(width: int, height: int) -> Frame:
    """A frame in which nothing was drawn."""
    shape = (height, width)
    zeros = np.zeros((*shape, 3), np.float32)
    one, nan = np.zeros(shape, np.float32), np.full(shape, np.nan)
    none = np.full(shape, -1, np.int32)
    infinite = np.full(shape, np.inf, np.float32)
    gbuffer = GBuffer(infinite, none, none, none, infinite, zeros, zeros, zeros, zeros, one, zeros)
    zero8 = np.zeros(shape, np.uint8)
    status = np.full(shape, Status.BACKGROUND, np.uint8)
    steps = np.zeros(shape, np.uint32)
    hit_px = np.full((*shape, 2), np.nan)
    hits = HitBuffer(status, zero8, zero8, hit_px, nan, nan, nan, steps, steps)
    resolved = Resolved(one, one, one, zeros, zeros)
    return replace(synthetic(width, height), gbuffer=gbuffer, hits=hits, resolved=resolved)


def with_buffers(frame: Frame, **arrays: np.ndarray | None) -> Frame:
    """The frame with some buffers replaced, whichever group they are in."""
    groups = {}
    for group in ("gbuffer", "hits", "resolved"):
        old = getattr(frame, group)
        names = set(old.arrays()) & set(arrays)
        groups[group] = replace(old, **{name: arrays[name] for name in names})
    return replace(frame, **groups)


def picture(frame: Frame, name: str) -> previews.Picture:
    return dict(previews.pictures(frame))[name]


def read(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        assert image.mode == "RGB"
        return np.asarray(image)


def arrays_of(frame: Frame) -> dict[str, np.ndarray]:
    return {**frame.gbuffer.arrays(), **frame.hits.arrays(), **frame.resolved.arrays()}


def content_hash(frame: Frame) -> str:
    digest = hashlib.sha256()
    for name, array in sorted(arrays_of(frame).items()):
        digest.update(f"{name}{array.dtype}{array.shape}".encode() + array.tobytes())
    return digest.hexdigest()


def cielab(rgb8: np.ndarray, simulate: np.ndarray | None = None) -> np.ndarray:
    """CIELAB (D65) of sRGB bytes, by IEC 61966-2-1 and CIE 15; optionally through a CVD matrix."""
    c = np.asarray(rgb8, np.float64) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    if simulate is not None:
        linear = np.clip(linear @ simulate.T, 0.0, 1.0)
    to_xyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750]]
    to_xyz.append([0.0193339, 0.1191920, 0.9503041])
    xyz = linear @ np.array(to_xyz).T / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    lab = [116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])]
    return np.stack(lab, axis=-1)


def least_distance(palette: list[colors.Rgb8], simulate: np.ndarray | None = None) -> float:
    lab = cielab(np.array(palette), simulate)
    return min(float(np.linalg.norm(a - b)) for a, b in combinations(lab, 2))


# Machado, Oliveira & Fernandes 2009, severity 1, on linear RGB.
BLINDNESS = {
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


# Colours.


def test_srgb_known_values() -> None:
    # 0.5: 1.055 · 0.5^(1/2.4) − 0.055 = 0.735357, times 255 = 187.52. 0.2140: the old 18 % rule's
    # neighbour, sRGB byte 127 → linear 0.212231, 128 → 0.215861.
    image = np.array([[[0.0, 0.5, 1.0], [0.212231, 0.215861, 7.0], [-1.0, 1.0, 0.0]]])
    assert colors.srgb_bytes(image).tolist() == [[[0, 188, 255], [127, 128, 255], [0, 255, 0]]]


def test_srgb_meets_at_the_boundary() -> None:
    # Both branches of IEC 61966-2-1 give 0.0404499 at 0.0031308, to the standard's own rounding.
    below, above = 0.0031308, np.nextafter(0.0031308, 1.0)
    assert colors.srgb_encode(below) == 12.92 * 0.0031308
    assert abs(float(colors.srgb_encode(above)) - 12.92 * 0.0031308) < 3e-8
    assert colors.srgb_encode(0.003) == 12.92 * 0.003
    assert colors.srgb_encode(0.004) == pytest.approx(1.055 * 0.004 ** (1 / 2.4) - 0.055, rel=1e-15)


def test_every_byte_survives_decode_and_encode() -> None:
    c = np.arange(256) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    image = np.repeat(linear[:, None, None], 3, axis=2)
    assert np.array_equal(colors.srgb_bytes(image)[:, 0, 1], np.arange(256))
    assert np.array_equal(colors.srgb_bytes(image.astype(np.float32))[:, 0, 1], np.arange(256))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_one_bad_channel_makes_the_pixel_loud(bad: float, channel: int) -> None:
    image = np.full((3, 5, 3), 0.25, np.float32)
    image[1, 2, channel] = bad
    out = colors.srgb_bytes(image)
    loud = (out == np.array(colors.LOUD)).all(axis=-1)
    assert np.argwhere(loud).tolist() == [[1, 2]]
    assert np.isnan(colors.srgb_encode(np.nan))


def test_blocks_of_rows_join() -> None:
    image = np.random.default_rng(3).random((301, 331, 3))
    whole = colors.to_bytes(colors.srgb_encode(image))
    assert image.size > 2 * colors._BLOCK
    assert np.array_equal(colors.srgb_bytes(image), whole)


def test_statuses_are_far_apart_for_everyone() -> None:
    assert set(colors.STATUS_COLORS) == set(Status)
    palette = [*colors.STATUS_COLORS.values(), colors.LOUD]
    assert least_distance(palette) > 20.0
    for matrix in BLINDNESS.values():
        assert least_distance(palette, np.array(matrix)) > 14.0


def test_ends_have_the_colour_of_their_status() -> None:
    assert set(colors.END_COLORS) == set(End)
    for end in list(End)[1:]:
        assert colors.END_COLORS[end] == colors.STATUS_COLORS[Status[end.name]]


@pytest.mark.parametrize("ramp", [colors.HEAT, colors.GREY])
def test_ramps_rise_in_lightness(ramp: np.ndarray) -> None:
    lightness = cielab(ramp)[:, 0]
    assert (np.diff(lightness) > 0.0).all()
    assert lightness[-1] - lightness[0] > 75.0
    # Evenly: no quarter of the ramp has less than half its share of the range.
    quarters = np.diff(lightness[[0, 64, 128, 191, 255]])
    assert quarters.min() > 0.5 * (lightness[-1] - lightness[0]) / 4
    assert not ramp.flags.writeable


@pytest.mark.parametrize("ramp", [colors.HEAT, colors.GREY])
def test_messages_are_in_no_ramp(ramp: np.ndarray) -> None:
    lab = cielab(ramp)
    for message in (colors.LOUD, colors.BLANK, colors.OPEN):
        assert np.linalg.norm(lab - cielab(np.array(message)), axis=-1).min() > 20.0


def test_ids_have_distinct_stable_colours() -> None:
    out = colors.id_colors(np.arange(-1, 64, dtype=np.int32))
    assert out[0].tolist() == [0, 0, 0]
    assert len(np.unique(out, axis=0)) == 65
    near = [np.linalg.norm(a - b) for a, b in zip(cielab(out)[1:-1], cielab(out)[2:])]
    assert min(near) > 20.0  # neighbouring ids
    big = np.array([2**31 - 1, -(2**31)], np.int64)
    assert colors.id_colors(big)[1].tolist() == [0, 0, 0]
    assert np.array_equal(colors.id_colors(np.int32(7)), out[8])
    table = cielab(colors.id_colors(np.arange(50_000)))
    assert np.linalg.norm(table - cielab(np.array(colors.LOUD)), axis=-1).min() > 20.0


# Pictures.


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("make", [synthetic, empty])
def test_all_sizes(width: int, height: int, make: object, tmp_path: Path) -> None:
    """Every buffer has a file, its picture is in place, and nothing in the frame changes."""
    frame = make(width, height)  # type: ignore[operator]
    before = content_hash(frame)
    for array in arrays_of(frame).values():
        array.setflags(write=False)
    names = write_previews(frame, tmp_path / "new" / "folder")
    assert content_hash(frame) == before
    assert names == sorted(p.name for p in (tmp_path / "new" / "folder").iterdir())

    renamed = {"normal_vs": "normal", "geo_normal_vs": "geo_normal", "hit_px": "hit_uv"}
    expected = {renamed.get(name, name) for name in arrays_of(frame)} | {"thickness", "overview"}
    assert {name.removesuffix(".png") for name in names} == expected

    for name, made in previews.pictures(frame):
        stored = read(tmp_path / "new" / "folder" / f"{name}.png")
        assert made.rgb.shape == (height, width, 3) and made.rgb.dtype == np.uint8
        assert np.array_equal(stored[:height, :width], made.rgb)
        if made.legend is None:
            assert stored.shape == (height, width, 3)
        else:
            assert stored.shape[0] > height
            # To the right of a narrow picture there is paper only.
            assert (stored[:height, width:] == np.array(legend.PAPER)).all()
    sheet = read(tmp_path / "new" / "folder" / "overview.png")
    assert sheet.shape[1] <= 1600


@pytest.mark.parametrize(("width", "height"), [(1, 1), (37, 53), (400, 3)])
def test_legend_text_is_not_clipped(width: int, height: int) -> None:
    """A margin of paper surrounds every strip: ink at its border would be cut off."""
    for name, made in previews.pictures(synthetic(width, height)):
        if made.legend is None:
            continue
        strip = legend.with_legend(made.rgb, made.legend)[height:]
        paper = (strip == np.array(legend.PAPER)).all(axis=-1)
        assert paper[:3].all() and paper[-3:].all(), name
        assert paper[:, :3].all() and paper[:, -3:].all(), name
        assert not paper.all(), name


def test_status_pixels_have_the_palette_colour(tmp_path: Path) -> None:
    frame = synthetic(97, 41)
    write_previews(frame, tmp_path)
    stored = read(tmp_path / "status.png")
    for y in range(41):
        for x in range(97):
            expected = colors.STATUS_COLORS[Status(frame.hits.status[y, x])]
            assert tuple(stored[y, x]) == expected
    # Every colour of the picture has its key in the strip, and no other status has.
    strip = {tuple(c) for c in stored[41:].reshape(-1, 3)}
    present = set(np.unique(frame.hits.status).tolist())
    assert len(present) >= 15
    for status, color in colors.STATUS_COLORS.items():
        if status != Status.NOT_COMPUTED:  # black also occurs in blended text
            assert (color in strip) == (int(status) in present), status


def test_status_legend_counts() -> None:
    status = np.full((3, 7), Status.BACKGROUND, np.uint8)
    status[0, :5] = Status.HIT
    status[2, 6] = 99
    entries = picture(with_buffers(synthetic(7, 3), status=status), "status").legend.entries
    assert [(e.name, e.value.split()[0]) for e in entries] == [
        ("HIT", "5"),
        ("BACKGROUND", "15"),
        ("unknown status 99", "1"),
    ]
    assert entries[0].value == "5 px  23.8 %"  # 5 / 21
    assert entries[2].color == colors.LOUD


def test_shares_are_not_rounded_away() -> None:
    assert previews._count(1, 1_000_000) == "1 px  <0.1 %"
    assert previews._count(999_999, 1_000_000) == "999,999 px  >99.9 %"
    assert previews._count(0, 10) == "0 px  0.0 %"
    assert previews._count(10, 10) == "10 px  100.0 %"


def test_near_is_brighter_and_linear_in_inverse_depth() -> None:
    depth = np.array([[1.0, 4 / 3, 2.0, 4.0, np.inf]], np.float32)
    made = picture(with_buffers(synthetic(5, 1), depth=depth), "depth")
    # 1/z is 1, 3/4, 1/2, 1/4: shares 1, 2/3, 1/3, 0.
    assert made.rgb[0, :4, 0].tolist() == [255, 170, 85, 0]
    assert tuple(made.rgb[0, 4]) == colors.BLANK
    assert made.legend.lines[0] == "view depth, scene units: min 1, max 4"
    ticks = made.legend.bar.ticks
    assert (ticks[0], ticks[-1]) == ((0.0, "4"), (1.0, "1"))


@pytest.mark.parametrize("outlier", [1e-30, 1e30])
def test_depth_scale_ignores_one_outlier(outlier: float) -> None:
    depth = np.linspace(2.0, 5.0, 23 * 11, dtype=np.float32).reshape(11, 23)
    plain = picture(with_buffers(synthetic(23, 11), depth=depth), "depth")
    hurt = depth.copy()
    hurt[5, 11] = outlier
    made = picture(with_buffers(synthetic(23, 11), depth=hurt), "depth")
    keep = np.ones(depth.shape, bool)
    keep[5, 11] = False
    assert np.array_equal(made.rgb[keep], plain.rgb[keep])
    assert "beyond" not in plain.legend.lines[1]
    assert int(made.rgb[5, 11, 0]) == (255 if outlier < 1 else 0)
    assert "beyond the scale" in made.legend.lines[1]
    assert f"{np.float32(outlier):.4g}" in made.legend.lines[0]  # the true extreme is named


def test_range_drops_outliers_only() -> None:
    values = np.linspace(1.0, 2.0, 5000)
    assert previews.robust_range(values) == (1.0, 2.0)
    values[[3, 70, 900]] = [4.5, 0.4, 1e9]  # five may be dropped at either end
    low, high = previews.robust_range(values)
    assert 1.0 <= low < 1.01 and 1.99 < high <= 2.0
    assert previews.robust_range(np.array([1.0, 50.0])) == (1.0, 50.0)
    assert previews.robust_range(np.array([])) == (0.0, 0.0)


def test_wrong_depths_are_loud_and_counted() -> None:
    depth = np.full((3, 7), 2.0, np.float32)
    depth[0, :4] = [np.nan, -np.inf, 0.0, -1.0]
    depth[2, 0] = np.inf
    made = picture(with_buffers(synthetic(7, 3), depth=depth), "depth")
    assert (made.rgb[0, :4] == np.array(colors.LOUD)).all()
    assert tuple(made.rgb[1, 1]) == (255, 255, 255)  # one depth only: it is the nearest
    assert [(e.color, e.value.split()[0]) for e in made.legend.entries] == [
        (colors.BLANK, "1"),
        (colors.LOUD, "4"),
    ]


def test_thickness_is_back_minus_front() -> None:
    depth = np.array([[1.0, 1.0, 2.0, np.inf, 3.0]], np.float32)
    back = np.array([[1.5, 2.0, np.inf, np.inf, 2.0]], np.float32)
    made = picture(with_buffers(synthetic(5, 1), depth=depth, back_depth=back), "thickness")
    # Scale 0 to 1 (the greatest): 0.5 is byte 127.5, halves up.
    assert made.rgb[0, 0].tolist() == colors.HEAT[128].tolist()
    assert made.rgb[0, 1].tolist() == colors.HEAT[255].tolist()
    assert [tuple(c) for c in made.rgb[0, 2:]] == [colors.OPEN, colors.BLANK, colors.LOUD]
    assert made.legend.lines[0].endswith("min 0.5, mean 0.75, max 1")


def test_steps_grow_lighter() -> None:
    steps = np.arange(11, dtype=np.uint32)[None] * 10
    status = np.full((1, 11), Status.OUT_OF_STEPS, np.uint8)
    status[0, 4] = Status.NOT_REFLECTIVE
    made = picture(with_buffers(synthetic(11, 1), steps=steps, status=status), "steps")
    walked = status[0] != Status.NOT_REFLECTIVE
    assert (np.diff(cielab(made.rgb[0, walked])[:, 0]) > 0.0).all()
    assert tuple(made.rgb[0, 4]) == colors.BLANK
    # 0 + 10 + … + 100 without 40, over ten rays: (550 − 40) / 10.
    assert made.legend.lines[0] == "samples tested: min 0, mean 51, max 100"
    assert [t for _, t in made.legend.bar.ticks] == ["0", "20", "40", "60", "80", "100"]


@pytest.mark.parametrize("top", [1.0, 3.0, 7.3, 96.0, 1e-12, 12345.0])
@pytest.mark.parametrize("whole", [False, True])
def test_ticks_are_few_and_in_order(top: float, whole: bool) -> None:
    ticks = previews._linear_ticks(top, whole)
    places = [at for at, _ in ticks]
    assert 2 <= len(ticks) <= 8 and places == sorted(set(places))
    assert (places[0], places[-1]) == (0.0, 1.0)


def test_normals_are_not_gamma_encoded() -> None:
    frame = synthetic(5, 3)
    normal = np.zeros((3, 5, 3), np.float32)
    normal[2, :3] = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]
    normal[2, 3] = np.nan
    depth = np.full((3, 5), np.inf, np.float32)
    depth[2] = 1.0
    made = picture(with_buffers(frame, normal_vs=normal, depth=depth), "normal")
    expected = [[255, 128, 128], [128, 0, 128], [128, 128, 255], list(colors.LOUD), [128] * 3]
    assert made.rgb[2].tolist() == expected
    assert not made.rgb[:2].any()


def test_hit_uv_channels() -> None:
    frame = synthetic(10, 4)
    status = np.full((4, 10), Status.HIT, np.uint8)
    status[0] = Status.MAX_DISTANCE
    hit_px = np.full((4, 10, 2), [10.0, 1.0])  # stale numbers at misses are not shown
    hit_px[3, 0] = [11.0, 1.0]
    made = picture(with_buffers(frame, status=status, hit_px=hit_px), "hit_uv")
    assert not made.rgb[0].any()
    assert (made.rgb[1] == [255, 64, 0]).all()  # v = 1/4 is byte 63.75
    assert tuple(made.rgb[3, 0]) == colors.LOUD


def test_reflection_is_black_where_no_ray_was_asked_for() -> None:
    frame = synthetic(37, 23)
    ones = np.ones((23, 37, 3), np.float32)
    bad = ones.copy()
    bad[0, 0, 1] = np.nan
    status = frame.hits.status
    assert status[0, 0] == Status.BACKGROUND
    made = picture(with_buffers(frame, reflection=bad), "reflection")
    quiet = np.isin(status, [Status.BACKGROUND, Status.NOT_REFLECTIVE, Status.NOT_COMPUTED])
    assert (made.rgb[~quiet] == 255).all()
    assert tuple(made.rgb[0, 0]) == colors.LOUD
    quiet[0, 0] = False
    assert not made.rgb[quiet].any()


def test_bad_light_is_counted_and_clean_light_has_no_strip() -> None:
    frame = synthetic(19, 7)
    assert picture(frame, "composite").legend is None
    composite = frame.resolved.composite.copy()
    composite[0, :3] = np.nan
    composite[1, 0, 2] = -0.5
    made = picture(with_buffers(frame, composite=composite), "composite")
    assert made.legend.entries[0].value == "3 px  2.3 %"  # of 133
    assert made.legend.lines == ("1 px below 0 in a channel, shown as 0",)
    assert made.note == "1 px below 0, 3 px not finite"


def test_flags_and_ids_are_named() -> None:
    frame = synthetic(9, 7)
    both = int(Flag.PASSED_BEHIND | Flag.OVER_EMPTY)
    flags = np.zeros((7, 9), np.uint8)
    flags[0, :2] = both
    flags[0, 2] = 64
    ids = np.full((7, 9), -1, np.int32)
    ids[3, :4] = 1
    ids[4, 0] = 700
    made = with_buffers(frame, flags=flags, object_id=ids)
    assert [e.name for e in picture(made, "flags").legend.entries] == [
        "no flag",
        "PASSED_BEHIND + OVER_EMPTY",
        "unknown 0x40",
    ]
    entries = picture(made, "object_id").legend.entries
    assert entries[0].name.startswith("1 ball") and entries[0].value.startswith("4 px")
    assert entries[1].name == "700 (no such id in the scene)"
    assert entries[2].name == "none"
    shown = picture(made, "object_id").rgb
    assert tuple(shown[3, 0]) == entries[0].color and not shown[0, 0].any()


def test_missing_buffers_are_skipped(tmp_path: Path) -> None:
    frame = synthetic(9, 7)
    bare = replace(frame, gbuffer=GBuffer(frame.gbuffer.depth, frame.gbuffer.triangle_id))
    names = write_previews(bare, tmp_path)
    gone = ("radiance", "albedo", "normal", "back_depth", "thickness", "object_id", "roughness")
    assert not {f"{name}.png" for name in gone} & set(names)
    assert {"composite.png", "depth.png", "overview.png", "triangle_id.png"} <= set(names)


def test_float64_buffers_give_the_same_pictures() -> None:
    frame = synthetic(37, 23)
    wide = {n: a.astype(np.float64) for n, a in arrays_of(frame).items() if a.dtype == np.float32}
    narrow = dict(previews.pictures(frame))
    for name, made in previews.pictures(with_buffers(frame, **wide)):
        worst = np.abs(made.rgb.astype(int) - narrow[name].rgb).max()
        assert worst <= 2, name


def test_written_twice_the_same(tmp_path: Path) -> None:
    frame = synthetic(53, 37)
    names = write_previews(frame, tmp_path / "a")
    assert write_previews(frame, tmp_path / "b") == names
    write_previews(frame, tmp_path / "b")
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileError, match="previews cannot be written to"):
        write_previews(synthetic(3, 5), tmp_path / "file")


def test_contact_sheet_of_wide_and_tall_panels() -> None:
    for width, height in [(3000, 2), (2, 3000), (3840, 7)]:
        wide = np.zeros((height, width, 3), np.uint8)
        panels = [legend.Panel(str(i), wide, "note") for i in range(8)]
        sheet = legend.contact_sheet(panels, legend.Legend(("t",)), legend.Legend())
        assert sheet.shape[1] <= 1600 and sheet.shape[0] < 1600


def test_importing_needs_no_pillow() -> None:
    code = (
        "import sys, ssr_ref.report.previews; "
        "assert not {'PIL', 'imageio', 'matplotlib'} & set(sys.modules), sorted(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
