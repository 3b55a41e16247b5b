"""Named closed-form scenes, each made to ask a tracer one question.

Every function takes `orthographic` and returns a scene with a view. Numbers are short decimals or
halves; turned boxes use the quaternion (0, 0.6, 0, 0.8), a 3-4-5 triangle, so that no function but
the square root is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .. import transforms
from ..camera import View
from ..errors import SceneError
from ..scene import Material
from ..vecmath.elementary import sincos_host
from .scene import AnalyticScene
from .shapes import Box, Disc, Plane, Shape, Sphere

MIRROR, MATT, RED, GLOSSY, BLUE, INSIDE = 0, 1, 2, 3, 4, 5
MATERIALS = (
    Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0),
    Material("matt", (0.7, 0.7, 0.65), roughness=1.0),
    Material("red", (0.8, 0.2, 0.1), roughness=1.0),
    Material("glossy", (0.8, 0.7, 0.3), metallic=0.5, roughness=0.0),
    Material("blue", (0.2, 0.4, 0.8), roughness=1.0),
    Material("inside", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0, double_sided=True),
)
EYE = (2.0, 1.5, 5.0)
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), MIRROR, "floor")


def _scene(name: str, shapes: tuple[Shape, ...], view: View, orthographic: float) -> AnalyticScene:
    """A scene; orthographic: height of a parallel view, 0 for the view as it is."""
    if orthographic:
        view = replace(view, orthographic_height=orthographic, fov_y_degrees=None)
        view = replace(view, focal_length=None)
    return AnalyticScene(shapes, MATERIALS, view=view, name=name)


def _view(
    eye: tuple[float, float, float] = EYE, target: tuple[float, float, float] = (0.0, 0.4, 0.0)
) -> View:
    return View(eye, target, fov_y_degrees=40.0, near=0.01)


def marker(*, orthographic: bool = False) -> AnalyticScene:
    """A small marker behind a mirror floor: its reflected pixel is known by mirroring a point.

    The eye is at the origin and looks down −Z with an image exactly 2 depths high, so that every
    coordinate is rational. The marker is a disc at z = −4 that faces the eye; a pixel's ray turns
    over at y = −1 and meets it at the mirror image of where it would have met z = −4. The parallel
    view looks down at 45°.
    """
    shapes = (
        Plane((0.0, -1.0, -4.0), (0.0, 1.0, 0.0), MIRROR, "floor"),
        Disc((0.5, -0.25, -4.0), (0.0, 0.0, 1.0), 0.125, RED, "marker"),
    )
    straight = View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), focal_length=12.0, near=2.0**-6)
    if not orthographic:
        return _scene("marker", shapes, straight, 0.0)
    tilted = View((0.0, 2.0, 0.0), (0.0, 0.0, -2.0), near=2.0**-6)
    return _scene("marker", shapes, tilted, 4.0)


def sphere_over_plane(*, orthographic: bool = False) -> AnalyticScene:
    """A ball that floats a tenth of its radius over a mirror: the gap must stay open."""
    ball = Sphere((0.0, 0.55, 0.0), 0.5, RED, "ball")
    return _scene("sphere_over_plane", (FLOOR, ball), _view(), 2.5 * orthographic)


def sphere_on_plane(*, orthographic: bool = False) -> AnalyticScene:
    """A glossy ball that touches a mirror in one point: the gap must close."""
    ball = Sphere((0.0, 0.5, 0.0), 0.5, GLOSSY, "ball")
    return _scene("sphere_on_plane", (FLOOR, ball), _view(), 2.5 * orthographic)


def sphere_reflecting_sphere(*, orthographic: bool = False) -> AnalyticScene:
    """A mirror ball beside a matt one: curved mirror, curved target."""
    shapes = (
        Sphere((-0.5, 0.0, 0.0), 0.5, MIRROR, "mirror ball"),
        Sphere((0.6, 0.1, -0.6), 0.5, RED, "ball"),
    )
    view = _view((0.0, 0.25, 3.0), (0.0, 0.0, 0.0))
    return _scene("sphere_reflecting_sphere", shapes, view, 1.5 * orthographic)


def grazing_floor(degrees: float = 89.0, *, orthographic: bool = False) -> AnalyticScene:
    """A mirror floor seen at an angle from its normal, up to 89.99°, with a box far behind.

    The floor is level and the eye goes down: at `degrees` the view axis meets the floor 4 units
    away. Raises SceneError for an angle not within 0 to 90.
    """
    if not 0.0 < degrees < 90.0:
        raise SceneError(f"an angle of {degrees:g} degrees; expected more than 0, less than 90")
    sine, cosine = sincos_host(degrees * (3.141592653589793 / 180.0))
    box = Box.between((-0.5, 0.0, -3.0), (0.5, 0.75, -2.0), RED, "box")
    # The eye may be 0.0007 above the floor: near must not cut off what lies below it.
    view = replace(_view((0.0, 4.0 * cosine, 4.0 * sine), (0.0, 0.0, 0.0)), near=2.0**-12)
    return _scene("grazing_floor", (FLOOR, box), view, 2.5 * orthographic)


def along_the_axis(*, orthographic: bool = False) -> AnalyticScene:
    """A mirror square to the view: the ray of the middle pixel comes straight back to the eye."""
    shapes = (
        Plane((0.0, 0.0, -4.0), (0.0, 0.0, 1.0), MIRROR, "mirror"),
        Sphere((0.9, 0.3, -3.0), 0.4, RED, "ball"),
        Disc((-0.8, 0.2, -2.5), (0.5, 0.0, 1.0), 0.4, BLUE, "disc"),
    )
    view = View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), focal_length=12.0, near=2.0**-6)
    return _scene("along_the_axis", shapes, view, 3.0 * orthographic)


def rows_columns_diagonals(*, orthographic: bool = False) -> AnalyticScene:
    """Rays exactly along a row, a column and a diagonal, the last through corners of pixels.

    Three tilted disc mirrors lie on the left, below and below left of the middle of the image and
    throw their rays across it at a wall. In the parallel view every ray of a mirror has the same
    direction; in perspective those of the middle row, column or diagonal have it.
    """
    shapes = (
        Plane((0.0, 0.0, -5.0), (0.0, 0.0, 1.0), BLUE, "wall"),
        Disc((-1.25, 0.0, -4.0), (3.0, 0.0, 1.0), 0.375, MIRROR, "row"),
        Disc((0.0, -1.25, -4.0), (0.0, 3.0, 1.0), 0.375, MIRROR, "column"),
        Disc((-1.125, -1.125, -4.0), (2.0, 2.0, 1.0), 0.375, MIRROR, "diagonal"),
        Sphere((0.375, 0.0, -4.75), 0.1875, RED, "right ball"),
        Sphere((0.0, 0.375, -4.75), 0.1875, RED, "upper ball"),
        Sphere((0.5, 0.5, -4.75), 0.1875, RED, "corner ball"),
    )
    view = View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), focal_length=24.0, near=2.0**-6)
    return _scene("rows_columns_diagonals", shapes, view, 4.0 * orthographic)


def clutter(*, orthographic: bool = False) -> AnalyticScene:
    """Seven balls, six boxes, four thin posts, a back wall and a mirror floor: everything at once.

    Most objects stand on the floor, some float, some hide others.
    """
    balls = (
        ((-1.5, 0.5, -0.5), 0.5, RED), ((0.2, 0.35, 0.9), 0.35, GLOSSY),
        ((1.3, 0.6, -0.8), 0.6, BLUE), ((-0.5, 0.25, 1.4), 0.25, MATT),
        ((2.3, 0.3, 0.6), 0.3, RED), ((-2.4, 0.4, 0.7), 0.4, GLOSSY),
        ((0.4, 1.4, -1.2), 0.3, RED),
    )  # fmt: skip
    boxes = (
        ((-0.5, 0.5, -1.5), (0.4, 0.5, 0.3), GLOSSY), ((0.9, 0.2, 0.2), (0.2, 0.2, 0.2), RED),
        ((-1.3, 0.15, 0.9), (0.3, 0.15, 0.2), BLUE), ((2.2, 0.7, -1.6), (0.3, 0.7, 0.3), MATT),
        ((1.4, 0.1, 1.3), (0.25, 0.1, 0.15), BLUE), ((-2.6, 1.1, -1.4), (0.3, 0.2, 0.3), RED),
    )  # fmt: skip
    posts = ((-0.9, -0.3), (0.6, -0.4), (1.8, -0.1), (-1.9, 1.5))
    turn = transforms.from_quaternion(0.0, 0.6, 0.0, 0.8)
    shapes: list[Shape] = [FLOOR, Plane((0.0, 1.0, -2.5), (0.0, 0.0, 1.0), MATT, "wall")]
    shapes += [Sphere(c, r, m, f"ball {i}") for i, (c, r, m) in enumerate(balls)]
    for i, (center, half, material) in enumerate(boxes):
        place = transforms.translation(*center)
        pose = transforms.multiply(place, turn) if i % 2 else place
        shapes.append(Box(half, pose, material, f"box {i}"))
    for i, (x, z) in enumerate(posts):
        shapes.append(
            Box.between((x - 0.015, 0.0, z - 0.015), (x + 0.015, 1.2, z + 0.015), MATT, f"post {i}")
        )
    view = _view((0.8, 1.6, 6.0), (0.0, 0.5, 0.0))
    return _scene("clutter", tuple(shapes), view, 3.6 * orthographic)


def box_over_plane(*, orthographic: bool = False) -> AnalyticScene:
    """A box that floats over a mirror: its lower side shows in it alone and must not be guessed."""
    box = Box.between((-0.5, 0.1, -0.5), (0.5, 1.1, 0.5), RED, "box")
    return _scene("box_over_plane", (FLOOR, box), _view(), 3.0 * orthographic)


def box_on_plane(*, orthographic: bool = False) -> AnalyticScene:
    """A turned box that stands on a mirror along its lower edges."""
    pose = transforms.multiply(
        transforms.translation(0.0, 0.5, 0.0), transforms.from_quaternion(0.0, 0.6, 0.0, 0.8)
    )
    box = Box((0.5, 0.5, 0.4), pose, GLOSSY, "box")
    return _scene("box_on_plane", (FLOOR, box), _view(), 3.0 * orthographic)


def corner(*, orthographic: bool = False) -> AnalyticScene:
    """A concave edge: a glossy box against a mirror wall, on a mirror floor; each shows the others.

    Rays leave from within a pixel of the edge where the surfaces meet.
    """
    shapes = (
        FLOOR,
        Plane((0.0, 1.0, -1.0), (0.0, 0.0, 1.0), MIRROR, "wall"),
        Box.between((-1.0, 0.0, -1.0), (0.0, 1.0, 0.5), GLOSSY, "box"),
    )
    return _scene("corner", shapes, _view((2.5, 1.8, 3.5), (0.0, 0.4, -0.4)), 3.0 * orthographic)


def inside_a_sphere(*, orthographic: bool = False) -> AnalyticScene:
    """The eye inside a double-sided mirror ball, with a small ball to see in it."""
    shell = Sphere((0.0, 0.0, 0.0), 2.0, INSIDE, "shell")
    ball = Sphere((0.4, -0.2, -0.8), 0.25, RED, "ball")
    view = View((0.0, 0.1, 0.9), (0.0, 0.0, -1.0), fov_y_degrees=60.0, near=0.01)
    return _scene("inside_a_sphere", (shell, ball), view, 1.5 * orthographic)


def planet(*, orthographic: bool = False) -> AnalyticScene:
    """A mirror ball of 6.4e6 under an eye at height 10, with a box on it: float32 sees noise."""
    radius = 6.4e6
    shapes = (
        Sphere((0.0, -radius, 0.0), radius, MIRROR, "planet"),
        Box.between((-2.0, 0.0, -32.0), (2.0, 6.0, -28.0), RED, "box"),
    )
    view = View((0.0, 10.0, 0.0), (0.0, 4.0, -30.0), fov_y_degrees=40.0, near=0.125)
    return _scene("planet", shapes, view, 24.0 * orthographic)


SCENES: dict[str, Callable[..., AnalyticScene]] = {
    make.__name__: make
    for make in (
        marker, sphere_over_plane, sphere_on_plane, sphere_reflecting_sphere, grazing_floor,
        along_the_axis, rows_columns_diagonals, clutter, box_over_plane, box_on_plane, corner,
        inside_a_sphere, planet,
    )
}  # fmt: skip
"""The functions above by name."""
