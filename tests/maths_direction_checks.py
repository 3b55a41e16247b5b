"""Checks of directions to environment maps, shared by their tests and the mutations.

Each takes the module of public functions, real or broken, and raises AssertionError where it fails.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from maths_b_checks import INF, NAN, U, infos, worst_error

from ssr_ref.study.sampling_maps import SAMPLES

CLASSES = [(0, 0, 0), (-0.0, 0.0, -0.0), (NAN, 1, 1), (1, NAN, 1), (1, 1, NAN), (INF, 0, 0),
           (0, -INF, 1), (1, 1, INF)]  # fmt: skip
LAYOUTS = ("cube", "cross", "latlong", "ball")

# OpenGL 4.6, table 8.19, as written there: face, s_c, t_c as (sign, axis).
TABLE = {
    (1, 0): (0, (-1, 2), (-1, 1)),
    (-1, 0): (1, (1, 2), (-1, 1)),
    (1, 1): (2, (1, 0), (1, 2)),
    (-1, 1): (3, (1, 0), (-1, 2)),
    (1, 2): (4, (1, 0), (-1, 1)),
    (-1, 2): (5, (-1, 0), (-1, 1)),
}


def no_direction(m: ModuleType) -> None:
    """Zero, NaN and infinite directions: face −1, NaN coordinates; and back."""
    face, uv = m.cube_face(CLASSES)
    assert (face == -1).all() and np.isnan(uv).all()
    for name in ("cross_uv", "latlong_uv", "ball_uv"):
        assert np.isnan(getattr(m, name)(CLASSES)).all(), name
    assert np.isnan(m.cube_direction([-1, 0, 0], [(0.5, 0.5), (NAN, 0), (0, INF)])).all()
    for name in ("cross", "latlong", "ball"):
        back = getattr(m, f"{name}_direction")
        bad = [(NAN, 0.5), (0.5, NAN), (0.5, -0.1), (0.5, 1.1), (INF, 0.5)]
        assert np.isnan(back(bad)).all(), name
    assert np.isnan(m.cross_direction([(0.1, 0.1), (0.6, 0.2), (0.9, 0.9), (-0.1, 0.5)])).all()
    assert np.isnan(m.ball_direction([(0.1, 0.1), (0.0, 0.5 + 2.0**-30)])).all()


def cube_table(m: ModuleType) -> None:
    """Each face by the specification's table, with components that tell the axes apart."""
    for (sign, axis), (face, (ss, sa), (ts, ta)) in TABLE.items():
        d = np.array([0.25, 0.5, 0.125])
        d[axis] = sign * 2.0
        got, uv = m.cube_face(d)
        assert got == face, f"{d}: {got}"
        expected = [0.5 * (ss * d[sa] / 2.0 + 1.0), 0.5 * (ts * d[ta] / 2.0 + 1.0)]
        assert uv.tolist() == expected, f"face {face}: {uv}"
        assert m.cube_direction(face, uv).tolist() == (d / 2.0).tolist()


def cube_ties(m: ModuleType) -> None:
    """Equal magnitudes: z before y before x, exactly on edges and corners, whatever the signs."""
    for x in (-4.0, 4.0):
        for y in (-4.0, 4.0):
            for z in (-4.0, 4.0):
                z_face, y_face = (4 if z > 0 else 5), (2 if y > 0 else 3)
                cases = [(x, y, z), (x, 1, z), (1, y, z), (x, y, 1)]
                assert m.cube_face(cases)[0].tolist() == [z_face, z_face, z_face, y_face]
                face, uv = m.cube_face(cases)
                assert ((uv >= 0.0) & (uv <= 1.0)).all()
                assert np.array_equal(m.cube_direction(face, uv) * 4.0, cases)
                crossed = m.cross_direction(m.cross_uv(cases)) * 4.0
                assert np.abs(crossed - cases).max() <= 4 * 8 * U  # v = 1/3 is not exact


GLYPH = np.array([[1, 1, 1], [1, 0, 0], [1, 1, 0], [1, 0, 0], [1, 0, 0]], bool)  # F


def _seen(m: ModuleType, flip: str, face: int, n: int) -> np.ndarray:
    """What a right-handed camera sees that looks at a face's middle, its top row up; F on each."""
    image = np.zeros((n, n), bool)
    image[2:7, 3:6] = GLYPH
    ahead = m.cube_direction(face, (0.5, 0.5), flip=flip)
    up = ahead - m.cube_direction(face, (0.5, 1.0), flip=flip)
    right = np.array([ahead[1] * up[2] - ahead[2] * up[1], ahead[2] * up[0] - ahead[0] * up[2],
                      ahead[0] * up[1] - ahead[1] * up[0]])  # fmt: skip
    at = (np.arange(n) + 0.5) / n * 2.0 - 1.0
    d = ahead + at[None, :, None] * right - at[:, None, None] * up
    got, uv = m.cube_face(d, flip=flip)
    assert (got == face).all()
    texel = np.floor(uv * n).astype(int)
    return image[texel[..., 1], texel[..., 0]]


def cube_letter(m: ModuleType) -> None:
    """An F is not mirrored in a right-handed world with one flip, and is without."""
    n = 9
    image = np.zeros((n, n), bool)
    image[2:7, 3:6] = GLYPH
    for face in range(6):
        for flip in ("x", "y", "z"):
            assert np.array_equal(_seen(m, flip, face, n), image), f"face {face} flip {flip}"
        assert np.array_equal(_seen(m, "none", face, n), image[:, ::-1]), f"face {face}"
    assert m.cube_face((0, 0, -1), flip="z")[0] == 4
    assert m.cube_face((1, 0, 0), flip="x")[0] == 1


def cross_seams(m: ModuleType) -> None:
    """Neighbours in the cross meet: one direction from both sides, no empty pixel on an edge."""
    t = np.linspace(0.0, 1.0, 33)
    for column in (1, 2, 3):  # edges between the four middle cells
        at = np.stack([np.full(33, column / 4.0), (1.0 + t) / 3.0], 1)
        left = m.cross_direction(at - [2.0**-52, 0.0])
        right = m.cross_direction(at)
        assert np.abs(left - right).max() < 1e-14
    for row in (1, 2):
        at = np.stack([(1.0 + t[:-1]) / 4.0, np.full(32, row / 3.0)], 1)
        above, below = m.cross_direction(at - [0.0, 2.0**-52]), m.cross_direction(at)
        assert np.abs(above - below).max() < 1e-14
    edges = np.concatenate([
        np.stack([np.full(33, 0.5), t / 3.0], 1), np.stack([np.full(33, 0.5), (2 + t) / 3.0], 1),
        np.stack([t / 4.0, np.full(33, 2 / 3)], 1), np.stack([0.5 + t / 2, np.full(33, 2 / 3)], 1),
        np.stack([np.ones(33), (1 + t) / 3.0], 1),
    ])  # fmt: skip
    assert np.isfinite(m.cross_direction(edges)).all()
    # Edges and corners of the cube point to texels that the cross has.
    sides = np.stack(np.meshgrid(*[[-4.0, -1.0, 0.0, 1.0, 4.0]] * 3), -1).reshape(-1, 3)
    sides = sides[(np.abs(sides) == 4.0).any(axis=1)]
    for n in (1, 7, 9, 16, 1000):
        texel_round_trip(m, "cross", sides, 4 * n, 3 * n)
    assert m.cross_uv((0, 0, 1)).tolist() == [0.375, 0.5]  # +Z: the middle of cell (1, 1)
    assert m.cross_direction((0.375, 1.0 / 6.0)).round(9).tolist() == [0.0, 1.0, 0.0]


def latlong_seam(m: ModuleType) -> None:
    """u in [0, 1) on both sides of the seam; poles without an azimuth; no −0."""
    for x in (1e-9, 1e-15, 1e-17, 1e-30, 5e-324):
        for y in (0.0, 0.5, -3.0):
            right, left = m.latlong_uv([(-x, y, 1.0), (x, y, 1.0)])
            assert 0.0 <= right[0] < 1.0 and 0.0 <= left[0] < 1.0, f"{x}: {left}"
            assert right[0] <= 1e-9 and min(left[0], 1.0 - left[0]) <= 1e-9
            seen = m.latlong_direction([right, left])
            assert np.abs(seen[0] - seen[1]).max() <= 2.1 * x + 1e-15
    for zeros in ((0.0, 0.0), (-0.0, 0.0), (0.0, -0.0), (-0.0, -0.0)):
        for y, v in ((2.0, 0.0), (-2.0, 1.0)):
            assert m.latlong_uv((zeros[0], y, zeros[1])).tolist() == [0.5, v]
        got = m.latlong_uv((zeros[0], 0.0, 1.0))
        assert got.tolist() == [0.0, 0.5] and not np.signbit(got).any()
        assert m.latlong_uv((zeros[0], 0.0, -1.0)).tolist() == [0.5, 0.5]
    u = np.linspace(-1.0, 2.0, 61)
    for v, y in ((0.0, 1.0), (1.0, -1.0)):
        pole = m.latlong_direction(np.stack([u, np.full(61, v)], 1))
        assert (pole == [0.0, y, 0.0]).all()
    # Near a pole the angle to it is v·π, with all its digits.
    for x in (1e-3, 1e-9, 1e-160, 1e-300):
        v = m.latlong_uv((0.0, 1.0, x))[1]
        assert abs(v * np.pi / x - 1.0) < 1e-6
    assert m.latlong_uv([(1, 0, 0), (0, 0, -1), (-1, 0, 0)])[:, 0].tolist() == [0.75, 0.5, 0.25]


def ball_rim(m: ModuleType) -> None:
    """Middle, half way and rim of the ball; −Z is (1, ½) and comes back from all of the rim."""
    assert m.ball_uv((0, 0, 5)).tolist() == [0.5, 0.5]
    assert m.ball_uv((0, 0, -5)).tolist() == [1.0, 0.5]
    assert m.ball_uv((-0.0, 0.0, -1e-300)).tolist() == [1.0, 0.5]
    # At a right angle r = sin 45°; +X is right, +Y up.
    h = 0.5 * np.sqrt(0.5)
    expected = [(0.5 + h, 0.5), (0.5 - h, 0.5), (0.5, 0.5 - h), (0.5, 0.5 + h)]
    got = m.ball_uv([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
    assert np.abs(got - expected).max() <= 2 * U
    rim = [(0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0), (0.8, 0.9)]  # 0.3² + 0.4² = ½²
    seen = m.ball_direction(rim[:4])
    assert np.array_equal(np.abs(seen), [[0, 0, 1]] * 4) and (seen[:, 2] == -1.0).all()
    # Next to −Z from every side: on the rim, on the side of the direction.
    angle = np.linspace(0.1, 6.2, 17)
    for size in (1e-3, 1e-9, 1e-200, 1e-300):
        x, y = np.cos(angle) * size, np.sin(angle) * size
        uv = m.ball_uv(np.stack([x, y, np.full(17, -1.0)], 1)) * 2.0 - 1.0
        assert np.abs(uv[:, 0] - np.cos(angle)).max() < 1e-6
        assert np.abs(-uv[:, 1] - np.sin(angle)).max() < 1e-6


def ball_close_to_rim(m: ModuleType) -> None:
    """The stated bound where 1 − x² − y² is 10⁻⁶ to 10⁻¹⁵ and x, y have all their bits."""
    rng = np.random.default_rng(8)
    x = rng.random(200) * 1.8 - 0.9
    y = np.sqrt(1.0 - x * x) * (1.0 - 10.0 ** -rng.uniform(6, 15, 200))
    info = infos(m)["ball_direction"]
    error, args = worst_error(info, (np.stack([0.5 + 0.5 * x, 0.5 - 0.5 * y], 1),))
    assert error <= info.bound, f"{error} at {args}"


def to_uv(m: ModuleType, layout: str, d: Any) -> tuple[np.ndarray, np.ndarray]:
    if layout == "cube":
        return m.cube_face(d)
    uv = getattr(m, f"{layout}_uv")(d)
    return np.zeros(uv.shape[:-1], np.int32), uv


def to_direction(m: ModuleType, layout: str, face: Any, uv: Any) -> np.ndarray:
    if layout == "cube":
        return m.cube_direction(face, uv)
    return getattr(m, f"{layout}_direction")(uv)


def texel_round_trip(m: ModuleType, layout: str, d: Any, width: int, height: int) -> int:
    """Direction to texel to the direction of its centre: half a texel at most. Counts the cases.

    Cases whose texel has its centre off the ball are left out; u is compared modulo 1.
    """
    face, uv = to_uv(m, layout, d)
    assert ((uv >= 0.0) & (uv <= 1.0)).all() and (face >= 0).all()
    n = np.array([width, height])
    texel = np.minimum(np.floor(uv * n), n - 1)
    centre = (texel + 0.5) / n
    seen = to_direction(m, layout, face, centre)
    inside = np.isfinite(seen).all(axis=-1)
    assert layout == "ball" or inside.all()
    face_again, again = to_uv(m, layout, seen[inside])
    off = np.abs(again - uv[inside])
    if layout == "latlong":
        off[:, 0] = np.minimum(off[:, 0], 1.0 - off[:, 0])
    assert np.array_equal(face_again, face[inside])
    assert (off * n <= 0.5 + 1e-9 * n).all(), f"{layout}: {off.max(axis=0) * n} texels"
    return int(inside.sum())


def there_and_back(m: ModuleType, layout: str) -> None:
    """Direction to (u, v) and back: the same direction to 2⁻⁴⁹; for all layouts, all round."""
    (d,) = SAMPLES["ball_uv"](600, 3)
    d = d / np.abs(d).max(axis=1, keepdims=True)
    d /= np.sqrt((d * d).sum(axis=1, keepdims=True))
    if layout == "ball":  # the rim shows one direction: next to it uv no longer tells them apart
        d = d[d[:, 2] > -0.99]
    back = to_direction(m, layout, *to_uv(m, layout, d))
    back = back / np.sqrt((back * back).sum(axis=1, keepdims=True))
    assert np.abs(back - d).max() <= (2.0**-45 if layout == "ball" else 2.0**-49)
