"""Generated normals against closed forms: cube, cylinder, sphere, cone; what must not be joined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mesh_files import only, same_bits, write

from ssr_ref.errors import SettingsError
from ssr_ref.meshfiles import normals as normals_module
from ssr_ref.meshfiles.meshes import load_mesh, with_normals
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import Mesh, Node, Primitive, Scene
from ssr_ref.scenes import shapes


def scene_of(*primitives: Primitive) -> Scene:
    return Scene((Mesh("m", primitives),), (Node("m", 0),))


def changed(normals: str, *primitives: Primitive) -> tuple[Primitive, ...]:
    return with_normals(scene_of(*primitives), normals).meshes[0].primitives  # type: ignore[arg-type]


def face_normals(primitive: Primitive) -> np.ndarray:
    a, b, c = (primitive.positions[primitive.faces[:, k]].astype(np.float64) for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.sqrt((n**2).sum(axis=1))[:, None]


def cylinder(segments: int, *, radius: float = 1.5, height: float = 2.0) -> Primitive:
    """Side quads first, then two caps as fans; 2 · segments vertices, shared by side and cap."""
    angle = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([radius * np.cos(angle), 0 * angle, radius * np.sin(angle)], axis=1)
    positions = np.concatenate([ring, ring + np.array([0, height, 0])]).astype(np.float32)
    i = np.arange(segments)
    j = (i + 1) % segments
    side = shapes.split_quads(np.stack([i, i + segments, j + segments, j], axis=1))
    k = np.arange(1, segments - 1)
    low = np.stack([0 * k, k, k + 1], axis=1)
    high = np.stack([0 * k, k + 1, k], axis=1) + segments
    return Primitive(positions, np.concatenate([side, low, high]))


def sphere(columns: int, rows: int) -> Primitive:
    """Latitude and longitude, one vertex at each pole."""
    polar = np.pi * np.arange(1, rows)[:, None] / rows
    around = 2 * np.pi * np.arange(columns) / columns
    y = np.cos(polar) + 0 * around
    ring = np.stack([np.sin(polar) * np.cos(around), y, np.sin(polar) * np.sin(around)], axis=2)
    positions = np.concatenate([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]])
    i = np.arange(columns)
    j = (i + 1) % columns
    faces = [np.stack([0 * i, 1 + j, 1 + i], axis=1)]
    for row in range(rows - 2):
        a = 1 + row * columns
        quads = np.stack([a + i, a + j, a + columns + j, a + columns + i], axis=1)
        faces.append(shapes.split_quads(quads))
    a = 1 + (rows - 2) * columns
    faces.append(np.stack([0 * i + a + columns, a + i, a + j], axis=1))
    return Primitive(positions.astype(np.float32), np.concatenate(faces))


def test_a_cube_stays_faceted():
    cube = shapes.box((-1, -1, -1), (1, 1, 1))
    (found,) = changed("crease", cube)
    assert len(found.positions) == 24
    assert same_bits(found.positions[found.faces], cube.positions[cube.faces])
    expected = np.repeat(face_normals(cube), 3, axis=0).astype(np.float32)
    assert same_bits(found.normals[found.faces].reshape(-1, 3), expected)


def test_a_smooth_cube_points_to_its_corners():
    """Whatever the diagonals: the angles of a face's triangles at a corner sum to a right angle."""
    (found,) = changed("smooth", shapes.box((-1, -1, -1), (1, 1, 1)))
    assert len(found.positions) == 8
    assert np.abs(found.normals - found.positions / np.sqrt(3.0)).max() < 1e-7


@pytest.mark.parametrize("segments", [12, 13, 16, 64])
def test_a_cylinder_is_smooth_round_its_side_and_sharp_at_its_caps(segments):
    """By symmetry the side's normal is radial; 12 segments are facets of just 30°."""
    shape = cylinder(segments)
    (found,) = changed("crease", shape)
    assert len(found.positions) == 4 * segments
    side, caps = found.faces[: 2 * segments], found.faces[2 * segments :]
    radial = shape.positions[shape.faces[: 2 * segments]] * [1, 0, 1] / 1.5
    # One side quad's triangles meet a vertex with different angles: the sum is radial only for
    # both neighbours together, each with a right angle and the same area.
    assert np.abs(found.normals[side] - radial).max() < 4e-7
    axis = np.repeat([[0, -1, 0], [0, 1, 0]], 3 * (segments - 2), axis=0)
    assert np.abs(found.normals[caps].reshape(-1, 3) - axis).max() < 1e-7


def test_eleven_facets_are_sharp():
    (found,) = changed("crease", cylinder(11))  # 32.7° between neighbours
    side = found.normals[found.faces[:22]]
    assert np.abs(side - side[:, :1]).max() < 1e-7


# The greatest angle between a vertex normal and the analytic one, measured; it falls with the
# square of the step, as the error of a facet's plane does.
@pytest.mark.parametrize(
    ("columns", "rows", "degrees"), [(16, 8, 2.3), (32, 16, 0.66), (64, 32, 0.18)]
)
def test_a_spheres_normals(columns, rows, degrees):
    shape = sphere(columns, rows)
    (found,) = changed("crease", shape)
    assert same_bits(found.positions, shape.positions)  # nothing is split
    cosine = (found.normals.astype(np.float64) * shape.positions).sum(axis=1)
    assert np.degrees(np.arccos(np.minimum(cosine, 1.0))).max() < degrees
    assert np.abs(found.normals[[0, -1]] - [[0, 1, 0], [0, -1, 0]]).max() < 1e-7


def test_weights_are_area_times_angle():
    """A roof of 20°: at the ridge's end the two sums have areas 1, 2 and angles 45°, 90°."""
    c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
    a = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]  # area ½, 90° at the origin, 45° at the end
    positions = np.float32([*a, [0, -2 * c, -2 * s]])
    (found,) = changed("crease", Primitive(positions, [[0, 1, 2], [0, 3, 1]]))
    n1, n2 = np.array([0, 0, 1.0]), np.array([0, -s, c])
    first = np.pi / 2 * 0.5 * n1 + np.pi / 2 * n2
    second = np.pi / 4 * 0.5 * n1 + np.arctan2(2, 1) * n2
    for vertex, total in ((0, first), (1, second)):
        assert np.abs(found.normals[vertex] - total / np.sqrt((total**2).sum())).max() < 1e-7


def test_primitives_of_a_mesh_join_and_meshes_do_not():
    """Two halves of a cylinder as two materials: no seam; apart in two meshes: a seam."""
    whole = cylinder(16)
    halves = tuple(
        replace(whole, faces=whole.faces[part], material=0)
        for part in (slice(0, 16), slice(16, None))
    )
    joined = changed("crease", *halves)
    (expected,) = changed("crease", whole)
    assert same_bits(
        np.concatenate([p.normals[p.faces] for p in joined]), expected.normals[expected.faces]
    )
    meshes = tuple(Mesh(str(i), (half,)) for i, half in enumerate(halves))
    apart = with_normals(Scene(meshes, (Node("0", 0), Node("1", 1))), "crease")
    seam = only(replace(apart, meshes=apart.meshes[:1], nodes=apart.nodes[:1]))
    flat = face_normals(halves[0])[0]
    assert np.abs(seam.normals[seam.faces[0, 0]] - flat).max() < 1e-7


def test_split_vertices_keep_their_other_attributes():
    cube = shapes.box((0, 0, 0), (1, 1, 1))
    rng = np.random.default_rng(1)
    extra = {
        "colors": rng.random((8, 3), np.float32),
        "uv0": rng.random((8, 2), np.float32),
        "uv1": rng.random((8, 2), np.float32),
        "alphas": rng.random(8, np.float32),
    }
    (found,) = changed("crease", replace(cube, **extra))
    assert same_bits(found.positions[:8], cube.positions)  # the first corner keeps its number
    for name, array in extra.items():
        assert same_bits(getattr(found, name)[found.faces], array[cube.faces])


def test_degenerate_and_broken_faces_add_nothing():
    square = shapes.quad([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    positions = np.concatenate([square.positions, np.float32([[np.nan, 0, 0], [np.inf, 1, 1]])])
    faces = np.concatenate([square.faces, [[0, 0, 1], [0, 1, 4], [2, 3, 5], [1, 1, 1]]])
    (found,) = changed("crease", Primitive(positions, faces))
    assert len(found.positions) == 6  # and split nothing
    assert same_bits(found.normals[:4], np.float32([[0, 0, 1]] * 4))
    assert (found.normals[4:] == 0).all()


def test_edges_of_many_faces_are_sharp_and_both_sides_stay_apart():
    """A double-sided strip joins each side with itself; nine wings on one axis join nothing."""
    bend = np.float32([[0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 1], [2, 0.25, 0], [2, 0.25, 1]])
    quads = np.array([[0, 1, 3, 2], [2, 3, 5, 4]])
    faces = shapes.split_quads(np.concatenate([quads, quads[:, ::-1]]))
    (found,) = changed("crease", Primitive(bend, faces))
    front, back = found.normals[found.faces[:4]], found.normals[found.faces[4:]]
    assert (front[..., 1] > 0.9).all()
    assert (back[..., 1] < -0.9).all()
    angle = np.radians(np.arange(9) * 2.0)
    tips = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    wings = np.float32([[0, 0, 0], [0, 1, 0], *tips])
    (found,) = changed("crease", Primitive(wings, [[0, 1, 2 + i] for i in range(9)]))
    assert len(found.positions) == 27
    assert normals_module.MAX_FACES_OF_EDGE == 8


def test_many_faces_at_one_vertex_take_linear_time():
    """200,000 faces round a cone's tip: pairs of them would take hours. The tip points up."""
    n = 200_000
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    positions = np.concatenate([[[0, 2, 0]], ring]).astype(np.float32)
    i = np.arange(n)
    faces = np.stack([0 * i, 1 + (i + 1) % n, 1 + i], axis=1)
    (found,) = changed("crease", Primitive(positions, faces))
    assert len(found.positions) == n + 1
    assert np.abs(found.normals[0] - [0, 1, 0]).max() < 1e-6


def test_compiled_equals_interpreted():
    rng = np.random.default_rng(11)
    positions = (rng.normal(size=(30, 3)) * [1, 0.1, 1]).astype(np.float32)
    positions[7] = np.inf
    faces = rng.integers(0, 30, (60, 3)).astype(np.int32)
    group = normals_module._position_groups(np.concatenate([positions, positions]))
    assert (group[:30] == group[30:]).all()
    labels = normals_module._smooth_labels(positions, faces)
    drivers = [normals_module._face_normals, normals_module._sum_normals]
    outs = []
    for plain in (False, True):
        unit, out = np.zeros((60, 3)), np.zeros((int(labels.max()) + 1, 3), np.float32)
        face, total = (
            getattr(d.dispatcher, "py_func", d.dispatcher) if plain else d for d in drivers
        )
        with np.errstate(all="ignore"):
            face(positions, faces, unit)
            total(positions, faces, labels, np.zeros(out.shape), out)
        outs.append((unit, out))
    assert same_bits(outs[0][0], outs[1][0])
    assert same_bits(outs[0][1], outs[1][1])


ROOF = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 1\nvn 0 0.6 0.8\n"


def test_the_option_on_files(tmp_path):
    """One face with an authored normal, one without, 45° between them."""
    path = write(tmp_path / "a.obj", ROOF + "f 1//1 2//1 3//1\nf 1 4 2\n")
    authored, made = load_mesh(path).meshes[0].primitives
    assert same_bits(authored.normals, np.float32([[0, 0.6, 0.8]] * 3))
    tilted = np.float32([0, np.sqrt(0.5), np.sqrt(0.5)])
    assert np.abs(made.normals - tilted).max() < 1e-7
    for option, expected, count in (
        ("crease", [0, 0, 1], 2),
        ("flat", None, 0),
        ("smooth", None, 2),
        ("authored", [0, 0.6, 0.8], 1),
    ):
        scene = load_mesh(path, LoadOptions(normals=option))
        found = scene.meshes[0].primitives[0].normals
        assert scene.report is not None
        assert scene.report.generated_normals == count
        if option == "flat":
            assert found is None
        elif expected is not None:
            assert same_bits(found, np.float32([expected] * 3))
        else:  # at the first two vertices both faces count
            assert found[0, 1] > 0.1
            assert same_bits(found[2], np.float32([0, 0, 1]))
    with pytest.raises(SettingsError, match="'round'; expected one of authored, flat, smooth"):
        with_normals(scene, "round")  # type: ignore[arg-type]
    assert with_normals(scene, "authored") is scene
