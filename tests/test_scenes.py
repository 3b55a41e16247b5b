"""Built-in scenes: closed and outward shapes, Newell's teapot, exact contact, framing, registry."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from solids import capped, check_normals, corners, loops, open_edges, project, volume, world_points

from ssr_ref import scenes, transforms
from ssr_ref.errors import SceneError, SettingsError
from ssr_ref.scene import Mesh, Node, Scene
from ssr_ref.scenes import shapes, teapot_patches
from ssr_ref.scenes.poles import POSTS, striped_wall
from ssr_ref.scenes.teapot import SCALE, evaluate, pot

PARTS = ("body", "lid", "handle", "spout")


# ---- shapes ------------------------------------------------------------------------------------


def test_box_is_closed_and_has_its_volume() -> None:
    shape = shapes.box((-1.0, 0.5, 2.0), (0.5, 0.75, 6.0))
    assert shape.faces.shape == (12, 3) and shape.normals is None
    assert open_edges(shape) == []
    assert volume(corners(shape)) == 1.5 * 0.25 * 4.0  # exact in binary


@pytest.mark.parametrize("frequency", [1, 2, 3, 7, 16])
@pytest.mark.parametrize("radius", [1.0, 0.28, 1.7e-6, 3.3e6])
def test_sphere_is_closed_and_on_its_radius(radius: float, frequency: int) -> None:
    shape = shapes.sphere(radius, frequency)
    assert len(shape.faces) == 20 * frequency**2
    assert len(shape.positions) == 10 * frequency**2 + 2  # Euler: V = 2 + F/2
    assert open_edges(shape) == []

    p = shape.positions.astype(np.float64)
    r = np.sqrt((p * p).sum(axis=1))
    assert np.abs(r - radius).max() <= np.spacing(np.float32(radius))
    assert shape.normals is not None
    assert np.abs(shape.normals - p / radius).max() < 1e-6

    # Every face looks away from the centre. Icosahedron: V = 5/12 (3 + √5) a³ with a = r/sin 72°
    # = 2.536 r³; the sphere is 4.189 r³.
    t = corners(shape)
    outward = (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) * t.sum(axis=1)).sum(axis=1)
    assert (outward > 0.0).all()
    v = volume(t) / radius**3
    if frequency == 1:
        assert v == pytest.approx(2.5361507, rel=1e-6)
    assert 2.536 < v < 4.0 * np.pi / 3.0
    if frequency == 16:
        assert v > 0.99 * 4.0 * np.pi / 3.0


@pytest.mark.parametrize("segments", [1, 4, 5, 16, 37])
def test_round_post_is_closed_and_smooth(segments: int) -> None:
    n = 4 * -(-segments // 4)
    shape = shapes.round_post(0.25, 1.5, segments)
    assert len(shape.faces) == 4 * n
    assert open_edges(shape) == []
    assert set(shape.positions[:, 1].tolist()) == {0.0, 1.5}

    ring = shapes.unit_circle(segments)
    after = np.roll(ring, -1, axis=0)
    area = 0.5 * (ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum()
    assert volume(corners(shape)) == pytest.approx(area * 0.25**2 * 1.5, rel=1e-6)
    check_normals(shape)


def test_unit_circle_is_on_the_circle_and_turns_exactly() -> None:
    ring = shapes.unit_circle(44)
    assert np.abs((ring**2).sum(axis=1) - 1.0).max() < 4 * 2.0**-52
    assert ring[0].tolist() == [1.0, 0.0]
    turned = np.stack([-ring[:, 1], ring[:, 0]], axis=1)
    assert np.array_equal(turned, np.roll(ring, -11, axis=0))
    # Steps are nearly equal: dθ/dt = √2 / W with W from 1 down to (1 + √½)/2 in the middle.
    steps = np.sqrt(((np.roll(ring, -1, axis=0) - ring) ** 2).sum(axis=1))
    assert 1.0 < steps.max() / steps.min() < 2.0 / (1.0 + np.sqrt(0.5))


def test_grid_and_quad_face_up() -> None:
    floor = shapes.grid(1.5, 0.5, 3, 2)
    assert len(floor.faces) == 12 and len(floor.positions) == 12
    t = corners(floor)
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    assert (normal[:, 1] > 0.0).all() and (normal[:, [0, 2]] == 0.0).all()
    assert len(open_edges(floor)) == 2 * (3 + 2)
    assert normal[:, 1].sum() / 2.0 == pytest.approx(3.0 * 1.0, rel=1e-6)

    t = corners(shapes.quad([(0, 0, 1), (2, 0, 1), (2, 0, 0), (0, 0, 0)]))
    assert np.array_equal(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), [[0, 2, 0]] * 2)


# ---- the teapot --------------------------------------------------------------------------------


def test_the_table_has_32_patches() -> None:
    count = {name: sum(map(len, teapot_patches.patches(name))) for name in PARTS}
    # Crow 1987: rim 4, body 8, lid 8, handle 4, spout 4; the customary bottom 4.
    assert count == {"body": 4 + 8 + 4, "lid": 8, "handle": 4, "spout": 4}


@pytest.mark.parametrize("n", [1, 2, 10, 16])
def test_pot_triangle_count(n: int) -> None:
    # 32 patches of 2n², less the 4n triangles that vanish at the knob's tip and as many below.
    # n = 10 gives the 6,320 of the common OBJ file of the teapot.
    assert sum(len(p.faces) for p in pot(n)) == 64 * n * n - 8 * n


@pytest.mark.parametrize("n", [2, 3, 16])
def test_pot_is_open_only_where_newells_data_is(n: int) -> None:
    """Rim and lid do not meet (radius 1.4 and 1.3 at z 2.4), and the tubes have two open ends."""
    for name, part in zip(PARTS, pot(n)):
        edges = open_edges(part)
        assert len(edges) == 4 * n, name  # 4 quarters of n, or 2 ends of 2 halves of n
        ends = loops(edges)
        assert sorted(map(len, ends)) == ([4 * n] if name in PARTS[:2] else [2 * n, 2 * n])
        if name in PARTS[:2]:
            (ring,) = ends
            radius = np.sqrt(ring[:, 0] ** 2 + ring[:, 2] ** 2) / SCALE
            # A cubic arc with handles of 0.56 r leaves the circle by at most 0.6 %.
            assert np.abs(radius - (1.4 if name == "body" else 1.3)).max() < 0.006 * 1.4
            assert np.array_equal(ring[:, 1], np.full(4 * n, np.float32(2.4 * SCALE)))


def test_neighbouring_patches_share_bits() -> None:
    n = 7
    for name in PARTS:
        grid = [[evaluate(c, n)[0] for c in row] for row in teapot_patches.patches(name)]
        for i, row in enumerate(grid):
            for j, p in enumerate(row):
                assert np.array_equal(p[:, n], row[(j + 1) % len(row)][:, 0])
                if i + 1 < len(grid):
                    assert np.array_equal(p[n], grid[i + 1][j][0])


def de_casteljau(control: np.ndarray, t: float) -> np.ndarray:
    """A cubic's point by repeated halves-and-weights; control (4, ...)."""
    while len(control) > 1:
        control = control[:-1] * (1.0 - t) + control[1:] * t
    point: np.ndarray = control[0]
    return point


def test_patches_agree_with_de_casteljau() -> None:
    n = 5
    for name in PARTS:
        for row in teapot_patches.patches(name):
            for control in row:
                points, normals = evaluate(control, n)
                for i, j in ((0, 3), (2, 1), (4, 4), (5, 2)):
                    u, v = i / n, j / n
                    expected = de_casteljau(de_casteljau(control, u), v)
                    assert np.abs(points[i, j] - expected).max() < 1e-14
                    # Differences of 1e-5: the surface's curvature is below 100 per unit.
                    h = 1e-5
                    du = de_casteljau(de_casteljau(control, u + h), v) - expected
                    dv = de_casteljau(de_casteljau(control, u), v + h) - expected
                    across = np.cross(du, dv)
                    size = np.sqrt((across**2).sum())
                    if size > 1e-6 * h:  # not at a pole
                        assert (across / size * normals[i, j]).sum() > 1.0 - 1e-5


def test_pot_has_the_bounds_of_the_common_file() -> None:
    # a public teapot.obj, tessellated 10 × 10 from the same patches: (-3, 0, -2) to
    # (3.434, 3.15, 2), six decimals. All its 3,644 vertices lie on this table's to 8e-7.
    p = np.concatenate([part.positions for part in pot(10)]).astype(np.float64) / SCALE
    assert np.abs(p.min(axis=0) - [-3.0, 0.0, -2.0]).max() < 1e-6
    assert np.abs(p.max(axis=0) - [3.434, 3.15, 2.0]).max() < 1e-6
    assert p.min(axis=0)[1] == 0.0


def test_pot_has_the_moments_of_the_common_file() -> None:
    # A typing error in any row of the table changes these. From a public teapot.obj: its
    # different vertices, rounded to 4 digits, and their sums of x, y, x², y², z², xy, x³, y³, xz².
    expected = [
        132.444,
        5618.713,
        8027.79,
        12919.901,
        2208.401,
        747.79,
        2871.562,
        31765.996,
        13.706,
    ]
    p = np.concatenate([part.positions for part in pot(10)]).astype(np.float64) / SCALE
    x, y, z = p = np.unique(np.round(p, 4) + 0.0, axis=0).T
    assert p.shape[1] == 3241
    terms = (x, y, x * x, y * y, z * z, x * y, x**3, y**3, x * z * z)
    assert [t.sum() for t in terms] == pytest.approx(expected, rel=5e-6, abs=2e-3)
    assert abs(z.sum()) < 1e-3


@pytest.mark.parametrize("n", [8, 16, 33])
def test_pot_normals_are_unit_and_outward(n: int) -> None:
    for part in pot(n):
        check_normals(part)


def test_pot_is_outward_and_has_the_volume_of_its_profile() -> None:
    parts = dict(zip(PARTS, pot(16)))
    for part in parts.values():
        assert volume(capped(part)) > 0.0
    # The body as a solid of revolution: π ∫ r² dz along the profile, 2,000 steps a patch. The
    # quarter arcs are not quite circles (+0.5 % of area), and 64 sides cut off 0.2 %.
    rings = np.array([(r, z) for r, _, z in teapot_patches.RINGS_BODY])
    t = np.arange(2001) / 2000
    total = 0.0
    for i in range(0, 12, 3):
        r, z = np.array([de_casteljau(rings[i : i + 4], u) for u in t]).T
        total -= np.pi * (((r[1:] + r[:-1]) / 2) ** 2 * np.diff(z)).sum()
    assert volume(capped(parts["body"])) / SCALE**3 == pytest.approx(total, rel=0.01)


def test_poles_of_the_pot_have_the_axis_as_normal() -> None:
    body, lid = pot(4)[:2]
    for part, height, up in ((body, 0.0, -1.0), (lid, 3.15 * SCALE, 1.0)):
        at = np.flatnonzero(
            (part.positions == np.array([0.0, height, 0.0], np.float32)).all(axis=1)
        )
        assert len(at) == 1  # one vertex, shared by 16 triangles
        assert part.normals is not None and part.normals[at[0]].tolist() == [0.0, up, 0.0]
        assert (part.faces == at[0]).sum() == 16


# ---- the scenes --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["teapot", "poles"])
@pytest.mark.parametrize("tessellation", [2, 5, 16])
def test_every_solid_is_closed_and_outward(name: str, tessellation: int) -> None:
    scene = scenes.build(name, tessellation)
    closed = 0
    for mesh in scene.meshes:
        if mesh.name == "teapot" or (name == "poles" and mesh.name == "floor"):
            continue  # open by design: Newell's pot, the flat grid
        for primitive in mesh.primitives:
            assert open_edges(primitive) == [], mesh.name
            assert volume(corners(primitive)) > 0.0, mesh.name
            closed += 1
    assert closed == {"teapot": 5, "poles": 1 + len(POSTS)}[name]
    for node in scene.nodes:
        assert transforms.determinant3(node.world_from_mesh) > 0.0


@pytest.mark.parametrize("tessellation", [1, 3, 8, 16])
def test_everything_stands_on_the_floor_exactly(tessellation: int) -> None:
    teapot = scenes.build("teapot", tessellation)
    assert world_points(teapot, "floor")[:, 1].max() == 0.0
    for name in ("teapot", "ball", "block", "back wall", "left wall"):
        assert world_points(teapot, name)[:, 1].min() == 0.0, name

    poles = scenes.build("poles", tessellation)
    assert set(world_points(poles, "floor")[:, 1].tolist()) == {0.0}
    for name in ("wall", *(post.name for post in POSTS)):
        assert world_points(poles, name)[:, 1].min() == 0.0, name


def test_teapot_view_shows_the_pot_the_right_way_round() -> None:
    scene = scenes.build("teapot")
    size = (960, 540)
    p = world_points(scene, "teapot")
    px = project(scene, p, size)
    spout, handle, knob = px[p[:, 0].argmax()], px[p[:, 0].argmin()], px[p[:, 1].argmax()]
    assert handle[0] + 150 < knob[0] < spout[0] - 150
    assert knob[1] < min(handle[1], spout[1])
    # Pot, ball and block are on screen as a whole, with their mirror images (y → −y).
    for name in ("teapot", "ball", "block"):
        p = world_points(scene, name)
        for q in (p, p * [1.0, -1.0, 1.0]):
            px = project(scene, q, size)
            assert px.min() > 0.0 and (px < size).all(), name
    # The mirror images are in the lower half for the most part.
    assert (project(scene, world_points(scene, "teapot") * [1, -1, 1], size)[:, 1] > 270).all()


def test_teapot_materials_reflect_as_the_scene_promises() -> None:
    scene = scenes.build("teapot")
    by_name = {node.name: scene.meshes[node.mesh].primitives for node in scene.nodes}
    reflects = {n: scene.materials[p[0].material].metallic for n, p in by_name.items()}
    assert 0.8 <= reflects["floor"] <= 0.9
    assert 0.3 <= reflects["teapot"] <= 0.5
    assert 0.0 < reflects["ball"] < 1.0
    assert reflects["block"] == reflects["back wall"] == reflects["left wall"] == 0.0
    assert not any(material.double_sided for material in scene.materials)
    colors = {material.base_color for material in scene.materials}
    assert len(colors) == len(scene.materials)


def test_poles_go_down_to_one_pixel() -> None:
    scene = scenes.build("poles")
    widths = [post.width for post in POSTS]
    assert widths == sorted(widths, reverse=True)
    px = project(scene, world_points(scene, POSTS[-1].name), (960, 540))
    # At half height: the mean width over the post's two rings, in pixels.
    p = world_points(scene, POSTS[-1].name)
    rings = [px[p[:, 1] == y][:, 0] for y in np.unique(p[:, 1])]
    assert 0.7 < np.mean([np.ptp(ring) for ring in rings]) < 1.5
    for post in POSTS:
        foot = project(scene, np.array([[post.x, 0.0, post.z]]), (960, 540))[0]
        assert 0.0 < foot[0] < 960.0 and 270.0 < foot[1] < 540.0, post.name


def test_stripes_differ_and_meet_without_a_crack() -> None:
    wall = striped_wall()
    assert open_edges(wall) == []
    assert wall.colors is not None
    colors = wall.colors[wall.faces]
    assert (colors == colors[:, :1]).all()  # no face blends two stripes
    assert len(np.unique(colors.reshape(-1, 3), axis=0)) == 3
    assert volume(corners(wall)) == pytest.approx(7.4 * 1.7 * 0.1, rel=1e-5)


@pytest.mark.parametrize("name", ["teapot", "poles"])
def test_builds_repeat_and_tessellation_counts(name: str) -> None:
    default = scenes.build(name)
    assert default.content_sha256() == scenes.build(name, 16).content_sha256()
    counts = [scenes.build(name, n).triangle_count for n in (4, 8, 16, 32)]
    assert counts == sorted(set(counts))
    assert counts[2] == default.triangle_count
    if name == "teapot":
        # pot 64n² − 8n, ball 20n², four boxes of 12
        assert counts == [84 * n * n - 8 * n + 48 for n in (4, 8, 16, 32)]
    assert default.view is not None
    default.view.camera((37, 23), default.radius() / 1024)
    assert default.name == name


# ---- registry ----------------------------------------------------------------------------------


def test_registry_lists_scenes_in_one_line_each() -> None:
    assert list(scenes.BUILTIN)[:2] == ["teapot", "poles"] and len(scenes.BUILTIN) == 8
    for entry in scenes.BUILTIN.values():
        assert entry.description and "\n" not in entry.description and len(entry.description) < 90
    with pytest.raises(SceneError, match=r"'kettle'.*expected one of corridor, .* water"):
        scenes.build("kettle")


@pytest.mark.parametrize("value", [0, -1, 257, 1.5, True, "16", float("nan")])
def test_tessellation_out_of_range(value: object) -> None:
    with pytest.raises(SettingsError, match="whole number, 1 to 256"):
        scenes.build("poles", value)  # type: ignore[arg-type]


def test_importing_the_registry_does_not_import_numba() -> None:
    code = "import sys, ssr_ref.scenes as s; print(len(s.BUILTIN), 'numba' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "8 False"


# ---- mirror floor and framing ------------------------------------------------------------------

# Scale and place of a small lopsided scene: ordinary, tiny, huge, far from the origin.
PLACES = [
    (1.0, (0.0, 0.0, 0.0)),
    (1e-6, (0.0, 0.0, 0.0)),
    (1e6, (3e5, -7e6, 1e6)),
    (1.0, (1e6, -1e6, 3e5)),
    (1e-6, (0.1, 0.2, -0.3)),
    (1e-30, (0.0, 0.0, 0.0)),
]


def lopsided(scale: float, place: tuple[float, float, float]) -> Scene:
    """A tall box, turned and scaled, whose lowest point is no round number."""
    shape = shapes.box((-0.3, -0.7, 0.1), (0.4, 1.9, 0.6))
    turn = transforms.from_quaternion(0.1, 0.3, -0.1, np.sqrt(0.89))
    m = transforms.multiply(transforms.scaling(scale, scale, scale), turn)
    m[:3, 3] = place
    return Scene((Mesh("box", (shape,)),), (Node("box", 0, m),), name="lopsided")


@pytest.mark.parametrize(("scale", "place"), PLACES)
def test_mirror_floor_lies_exactly_under_the_scene(
    scale: float, place: tuple[float, float, float]
) -> None:
    scene = lopsided(scale, place)
    low, high = scene.world_bounds()
    floored = scenes.with_mirror_floor(scene)
    assert len(floored.nodes) == 2 and floored.triangle_count == scene.triangle_count + 2
    p = world_points(floored, scenes.MIRROR_FLOOR)
    assert (p[:, 1] == low[1]).all()
    assert floored.world_bounds()[0][1] == low[1]

    size = p.max(axis=0) - p.min(axis=0)
    side = 8.0 * np.sqrt((((high - low) / 2.0) ** 2).sum())
    middle = (p.max(axis=0) + p.min(axis=0)) / 2.0
    slack = 4 * np.spacing(np.abs(p).max())
    assert size[0] == pytest.approx(side, rel=1e-12, abs=slack)
    assert size[2] == pytest.approx(side, rel=1e-12, abs=slack)
    assert middle[[0, 2]] == pytest.approx(((low + high) / 2.0)[[0, 2]], rel=1e-12, abs=slack)

    (square,) = floored.meshes[-1].primitives
    t = corners(square)
    assert (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 1] > 0.0).all()
    material = floored.materials[square.material]
    assert (material.metallic, material.roughness, material.double_sided) == (0.9, 0.0, False)
    # What was there keeps its meshes and materials; a second floor is not added.
    assert floored.materials[: len(scene.materials)] == scene.materials
    assert floored.meshes[0] is scene.meshes[0]
    assert scenes.with_mirror_floor(floored) is floored


def test_mirror_floor_scales_by_powers_of_two_exactly() -> None:
    a = scenes.with_mirror_floor(lopsided(1.0, (0.25, 1.5, -3.0)))
    b = scenes.with_mirror_floor(lopsided(2.0**-20, (2.0**-22, 1.5 * 2.0**-20, -3.0 * 2.0**-20)))
    m, k = a.nodes[-1].world_from_mesh[:3], b.nodes[-1].world_from_mesh[:3]
    assert np.array_equal(m * 2.0**-20, k)


@pytest.mark.parametrize("floor", [False, True])
@pytest.mark.parametrize(("scale", "place"), PLACES)
def test_framed_view_holds_the_bounding_sphere(
    scale: float, place: tuple[float, float, float], floor: bool
) -> None:
    scene = lopsided(scale, place)
    low, high = scene.world_bounds()
    centre, radius = (low + high) / 2.0, np.sqrt((((high - low) / 2.0) ** 2).sum())
    view = scenes.framed_view(scenes.with_mirror_floor(scene) if floor else scene)

    # In the camera's axes the frustum's sides pass through the eye; the sphere is inside a side if
    # its centre is a radius or more away: c · cos 20° − |a| · sin 20° ≥ r for depth c, offset a.
    eye, target = np.array(view.eye), np.array(view.target)
    forward = (target - eye) / np.sqrt(((target - eye) ** 2).sum())
    right = np.cross(forward, view.up)
    right /= np.sqrt((right**2).sum())
    up = np.cross(right, forward)
    assert view.fov_y_degrees == 40.0
    sin, cos = np.sin(np.radians(20.0)), np.cos(np.radians(20.0))

    def room(p: np.ndarray) -> float:
        """Least distance to a side of the square frustum, in radii."""
        d = p - eye
        return float(min(d @ forward * sin - abs(d @ axis) * cos for axis in (right, up)) / radius)

    assert room(centre) >= 1.0
    # A three-quarter view from slightly above.
    assert forward[1] == pytest.approx(-0.36, abs=1e-3)
    assert forward[0] == pytest.approx(-0.48, abs=1e-3)
    assert forward[2] < 0.0
    if not floor:
        assert room(centre) <= 1.1
        assert np.array_equal(target, centre) or target == pytest.approx(centre, rel=1e-15)
    else:
        # Room for the mirror image down to one radius below the floor, and no more than needed.
        assert room(np.array([centre[0], low[1] - radius, centre[2]])) >= 0.0
        assert room(centre) <= 2.0
        assert target[1] == pytest.approx((centre[1] + low[1]) / 2.0, rel=1e-12)
        assert eye[1] > low[1]


def test_framed_view_of_built_in_scenes_counts_everything() -> None:
    scene = scenes.build("poles", 4)
    low, high = scene.world_bounds()
    assert scenes.framed_view(scene).target == pytest.approx(tuple((low + high) / 2.0))


def test_framed_view_makes_a_camera() -> None:
    for scale, place in PLACES[:3]:
        scene = scenes.with_mirror_floor(lopsided(scale, place))
        camera = scenes.framed_view(scene).camera((37, 23), scene.radius() / 1024)
        assert camera.is_perspective
