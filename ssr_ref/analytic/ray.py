"""One ray against every shape, in closed form and in world space.

A line goes into a shape through its front (t_in) and comes out through its back (t_out); a sheet is
met once, on one side. Every shape is convex, so a ray that leaves a front never meets that shape
again: own surfaces are told apart by their number, not by a distance.

    sphere  vecmath.sphere_distance: discriminant from the distance of the centre to the line,
            stable roots
    sheet   t = n·(p − o) / n·d, both products as if in twice the precision, so that 89.99° keeps
            its digits; a disc then asks |x − c|² ≤ r²
    box     slabs in its own axes (Kay and Kajiya 1986); an axis that the line is parallel to is
            asked for once, |o| ≤ h, so a line in the plane of a face meets no 0/0

Sources: Haines, Günther and Akenine-Möller, Ray Tracing Gems, chapter 7, 2019; Kay and Kajiya, Ray
Tracing Complex Scenes, SIGGRAPH 1986.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..raster.surface import load
from ..vecmath.exact import difference_of_points, dot_pairs, dot_twice
from ..vecmath.scaling import exponent, largest, times_power
from ..vecmath.sphere_distance import TWO, Frame, along_fused, intersect_by_distance
from ..vecmath.vec import Vec3, normalize, sub
from .arrays import BOX, DISC, SPHERE, ShapeArrays

NOTHING, IN, OUT = 0, 1, 2
NO_BACK, BACK_OF_SAME, BACK_OF_ANY = 0, 1, 2
ABOVE_ZERO = 5e-324
"""t ≥ this says t > 0 at any scale."""


class Meeting(NamedTuple):
    """Where a line passes through a shape; t is NaN where it does not. face: 0 to 5 of a box."""

    t_in: float
    t_out: float
    face_in: int
    face_out: int
    point_in: Vec3
    point_out: Vec3


class Hit(NamedTuple):
    """What a ray meets first; shape_id −1 and t inf: nothing. front: from the outside.

    back: t of the nearest back face behind it, inf if there is none. point: world space.
    """

    shape_id: int
    face: int
    t: float
    front: bool
    back: float
    point: Vec3


@kernel
def apart() -> Meeting:
    """No meeting."""
    nowhere = Vec3(np.nan, np.nan, np.nan)
    return Meeting(np.nan, np.nan, 0, 0, nowhere, nowhere)


@kernel
def drop_to_plane(p: Vec3, on: Vec3, n: Vec3, height: float) -> Vec3:
    """p moved along unit n to where n·(p − on) is `height`: takes off what o + t·d rounded."""
    off = dot_pairs(difference_of_points(p, on), n).hi - height
    return Vec3(p.x - off * n.x, p.y - off * n.y, p.z - off * n.z)


@kernel
def meet_sheet(o: Vec3, d: Vec3, on: Vec3, n: Vec3) -> Meeting:
    """A line against the plane through `on` with unit normal n."""
    slope = dot_twice(n, d).hi
    t = dot_pairs(difference_of_points(on, o), n).hi / slope
    if not (slope != 0.0 and np.isfinite(t)):
        return apart()
    p = drop_to_plane(along_fused(o, t, d), on, n, 0.0)
    if slope < 0.0:
        return Meeting(t, np.nan, 0, 0, p, p)
    return Meeting(np.nan, t, 0, 0, p, p)


@kernel
def meet_disc(o: Vec3, d: Vec3, center: Vec3, n: Vec3, radius: float) -> Meeting:
    """The same, within `radius` of the centre."""
    m = meet_sheet(o, d, center, n)
    off = sub(m.point_in, center)
    x, y, z = off.x / radius, off.y / radius, off.z / radius
    return m if x * x + y * y + z * z <= 1.0 else apart()


@kernel
def meet_sphere(o: Vec3, d: Vec3, center: Vec3, radius: float) -> Meeting:
    """A line through a ball; one that only touches it passes by."""
    f = sub(o, center)
    size_f, size_d = largest(f.x, f.y, f.z), largest(d.x, d.y, d.z)
    n, m = exponent(max(radius, size_f)), exponent(size_d)
    unit_d = Vec3(times_power(d.x, -m), times_power(d.y, -m), times_power(d.z, -m))
    h = intersect_by_distance(Frame(o, d, center, unit_d, times_power(radius, -n), n, m))
    if h.outcome != TWO:
        return apart()
    return Meeting(h.t0, h.t1, 0, 0, h.point0, h.point1)


@kernel
def meet_box(shapes: ShapeArrays, i: int, o: Vec3, d: Vec3) -> Meeting:
    """A line through box i; faces and edges belong to it. Ties go to the lower axis."""
    center = load(shapes.center, i)
    from_center = difference_of_points(o, center)
    t_in, t_out = -np.inf, np.inf
    face_in, face_out = 0, 0
    for axis in range(3):
        a = load(shapes.axes, 3 * i + axis)
        h = shapes.size[i, axis]
        start = dot_pairs(from_center, a).hi
        slope = dot_twice(a, d).hi
        if slope == 0.0:
            if abs(start) > h:
                return apart()
            continue
        enter, leave = (-h - start) / slope, (h - start) / slope
        low, high = 2 * axis, 2 * axis + 1
        if slope < 0.0:
            enter, leave = leave, enter
            low, high = high, low
        if enter > t_in:
            t_in, face_in = enter, low
        if leave < t_out:
            t_out, face_out = leave, high
    if not t_in <= t_out:
        return apart()
    point_in = on_face(shapes, i, face_in, along_fused(o, t_in, d))
    point_out = on_face(shapes, i, face_out, along_fused(o, t_out, d))
    return Meeting(t_in, t_out, face_in, face_out, point_in, point_out)


@kernel
def on_face(shapes: ShapeArrays, i: int, face: int, p: Vec3) -> Vec3:
    """p moved exactly onto a face of box i."""
    axis = face >> 1
    h = shapes.size[i, axis] if face & 1 else -shapes.size[i, axis]
    return drop_to_plane(p, load(shapes.center, i), load(shapes.axes, 3 * i + axis), h)


@kernel
def meet(shapes: ShapeArrays, i: int, o: Vec3, d: Vec3) -> Meeting:
    """Line o + t·d against shape i."""
    kind = shapes.kind[i]
    center = load(shapes.center, i)
    if kind == SPHERE:
        return meet_sphere(o, d, center, shapes.size[i, 0])
    if kind == BOX:
        return meet_box(shapes, i, o, d)
    n = load(shapes.axes, 3 * i + 2)
    if kind == DISC:
        return meet_disc(o, d, center, n, shapes.size[i, 0])
    return meet_sheet(o, d, center, n)


@kernel
def first_drawn(m: Meeting, own_from_inside: bool, double_sided: bool, t_least: float) -> int:
    """IN, OUT or NOTHING: the first of a shape's two surfaces that is drawn and has t ≥ t_least."""
    if m.t_in >= t_least and not own_from_inside:
        return IN
    return OUT if double_sided and m.t_out >= t_least else NOTHING


@kernel
def nearest(
    shapes: ShapeArrays, o: Vec3, d: Vec3, t_least: float, own: int, own_front: bool, back_of: int
) -> Hit:
    """The first drawn surface with t ≥ t_least; the lower shape at equal t.

    own: the shape that the ray starts on, −1 for none; own_front: on its outside. Such a ray does
    not meet it again, nor a sheet from either side; from inside it meets the far wall.
    back_of: whose back face is looked for, of single-sided shapes behind what was found.
    """
    shape, face, t, front = -1, 0, np.inf, True
    point = Vec3(np.nan, np.nan, np.nan)
    back = np.inf
    # Two rounds with one call of `meet`: it is most of the code, and is compiled once.
    for wanted in range(1 if back_of == NO_BACK else 2):
        for i in range(shapes.kind.shape[0]):
            if wanted == 0:
                solid = shapes.kind[i] == SPHERE or shapes.kind[i] == BOX
                if i == own and (own_front or not solid):
                    continue
            elif shapes.double_sided[i] or (i != shape and back_of == BACK_OF_SAME):
                continue
            m = meet(shapes, i, o, d)
            if wanted == 1:
                if m.t_out > t and m.t_out < back:
                    back = m.t_out
                continue
            way = first_drawn(m, i == own, shapes.double_sided[i], t_least)
            if way == IN and m.t_in < t:
                shape, face, t, front, point = i, m.face_in, m.t_in, True, m.point_in
            elif way == OUT and m.t_out < t:
                shape, face, t, front, point = i, m.face_out, m.t_out, False, m.point_out
    return Hit(shape, face, t, front, back, point)


@kernel
def outward_normal(shapes: ShapeArrays, hit: Hit) -> Vec3:
    """Unit world normal of what was hit, out of the shape's front."""
    i = hit.shape_id
    if shapes.kind[i] == SPHERE:
        c, r = load(shapes.center, i), shapes.size[i, 0]
        off = sub(hit.point, c)
        return normalize(Vec3(off.x / r, off.y / r, off.z / r))
    if shapes.kind[i] == BOX:
        a = load(shapes.axes, 3 * i + (hit.face >> 1))
        return a if hit.face & 1 else Vec3(-a.x, -a.y, -a.z)
    return load(shapes.axes, 3 * i + 2)


@kernel
def side_normal(shapes: ShapeArrays, hit: Hit) -> Vec3:
    """The same on the side that was met."""
    n = outward_normal(shapes, hit)
    return n if hit.front else Vec3(-n.x, -n.y, -n.z)
