# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Draws a picture of the robot from its URDF, with a small ray tracer for cylinders and boxes."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xacro
from matplotlib.image import imsave
from numpy.typing import NDArray
from urdf_parser_py.urdf import URDF, Box

Array = NDArray[np.float64]

DESCRIPTION = Path(__file__).parents[2] / "urdf" / "omnibot.urdf.xacro"
WIDTH, HEIGHT, BAND, FINER = 800, 560, 20, 2
"""``WIDTH``, ``HEIGHT``: size of the picture in pixels. ``BAND``: pixel rows that are computed at
once. Each pixel has ``FINER`` times ``FINER`` rays."""
EYE_M, LOOK_M, HALF_VIEW_RAD = np.array([0.62, 0.30, 0.42]), np.array([0.0, 0.0, 0.088]), 0.2138
FLOOR_M, FADE_M = 0.2, 0.35
LAMPS, LAMP_SIZE = 6, 0.06
SKIN_M = 1e-4


def unit(vectors: Any) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


LIGHT, FILL = unit(np.array([0.45, 0.25, 1.0])), unit(np.array([0.3, -0.8, 0.5]))


def pose(origin: Any) -> Array:
    """Return a URDF origin as a 4x4 matrix."""
    matrix = np.eye(4)
    if origin is not None:
        (sr, sp, sy), (cr, cp, cy) = np.sin(origin.rpy), np.cos(origin.rpy)
        matrix[:3, :3] = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
        matrix[:3, 3] = origin.xyz
    return matrix


@dataclass
class Hits:
    """The points where rays enter and leave a solid, and the normals of its surface there.

    ``rays``: for each element of the other arrays, the index of the ray. ``near``, ``far``:
    distances along the ray.
    """

    rays: NDArray[np.intp]
    near: Array
    near_normal: Array
    far: Array
    far_normal: Array


@dataclass
class Solid:
    """A box, or the cylinder about the box's own z axis that fits exactly into the box.

    ``half``: half the lengths of the box's sides. ``is_round``: whether the solid is the cylinder.
    """

    matrix: Array
    half: Array
    is_round: bool
    rgba: Array

    def hits(self, origins: Array, directions: Array) -> Hits:
        """Return where rays from outside meet the solid.

        ``origins`` and the unit vectors ``directions`` have the shape (n, 3).
        """
        rays = close(self.matrix[:3, 3], np.linalg.norm(self.half), origins, directions)
        start = (origins[rays] - self.matrix[:3, 3]) @ self.matrix[:3, :3]
        way = directions[rays] @ self.matrix[:3, :3]
        way = np.where(np.abs(way) < 1e-12, 1e-12, way)
        enter = (-np.sign(way) * self.half - start) / way
        leave = (np.sign(way) * self.half - start) / way
        if self.is_round:
            a = (way[:, :2] ** 2).sum(axis=1)
            b = (way[:, :2] * start[:, :2]).sum(axis=1)
            root = np.sqrt(
                np.maximum(b**2 - a * ((start[:, :2] ** 2).sum(axis=1) - self.half[0] ** 2), 0.0)
            )
            enter[:, 0], leave[:, 0] = (-b - root) / a, (-b + root) / a
            enter[:, 1], leave[:, 1] = enter[:, 0], leave[:, 0]
        near, far = enter.max(axis=1), leave.min(axis=1)
        met = (near < far) & (near > 0.0)
        normals = [
            self._normals(start[met], way[met], at[met], times[met].argmax(axis=1), sign)
            for at, times, sign in ((near, enter, -1.0), (far, -leave, 1.0))
        ]
        return Hits(rays[met], near[met], normals[0], far[met], normals[1])

    def _normals(self, start: Array, way: Array, at: Array, axis: Any, sign: float) -> Array:
        """Return the normals of the surface where rays enter or leave the solid.

        ``start``, ``way``: origins and directions of the rays, in the solid's own axes. ``at``:
        distances along the rays to the surface. ``axis``: for each ray, the axis across the face
        that it meets. ``sign``: 1 if the rays leave the solid, -1 if they enter.
        """
        rows = np.arange(len(at))
        local = np.zeros((len(at), 3))
        local[rows, axis] = sign * np.sign(way[rows, axis])
        if self.is_round:
            side = axis < 2
            local[side] = 0.0
            local[side, :2] = unit((start + at[:, None] * way)[side, :2])
        return np.asarray(local @ self.matrix[:3, :3].T)


def close(centre: Array, reach: Any, origins: Array, directions: Array) -> NDArray[np.intp]:
    """Return the indices of the rays that can meet a sphere.

    The result can contain a few rays that narrowly miss it.
    """
    to = centre - origins
    along = np.einsum("ij,ij->i", to, directions)
    passing = np.einsum("ij,ij->i", to, to) - along**2 < reach**2
    return np.flatnonzero(passing & (along > -reach))


@dataclass
class Link:
    """A link of the robot: a group of solids that are near each other, and a sphere around them."""

    solids: list[Solid]

    def __post_init__(self) -> None:
        centres = np.array([solid.matrix[:3, 3] for solid in self.solids])
        self.centre = centres.mean(axis=0)
        away = np.linalg.norm(centres - self.centre, axis=1)
        self.reach = max(away + [np.linalg.norm(solid.half) for solid in self.solids])


def meet(links: list[Link], origins: Array, directions: Array) -> Iterator[tuple[Solid, Hits]]:
    """Yield each solid that rays meet, and the places where the rays enter and leave it."""
    for link in links:
        rays = close(link.centre, link.reach, origins, directions)
        for solid in link.solids:
            hits = solid.hits(origins[rays], directions[rays])
            hits.rays = rays[hits.rays]
            yield solid, hits


def links() -> Iterator[Link]:
    """Yield all visible parts of the robot, which stands on the floor."""
    robot = URDF.from_xml_string(xacro.process_file(str(DESCRIPTION)).toxml())
    colours = {material.name: material.color.rgba for material in robot.materials}
    places = {"base_link": np.linalg.inv(pose(robot.joint_map["base_footprint_joint"].origin))}
    for joint in robot.joints:
        places[joint.child] = places["base_link"] @ pose(joint.origin)
    for link in robot.links:
        solids = []
        for visual in link.visuals:
            shape = visual.geometry
            boxed = isinstance(shape, Box)
            size = shape.size if boxed else [2 * shape.radius, 2 * shape.radius, shape.length]
            matrix = places[link.name] @ pose(visual.origin)
            colour = np.array(colours[visual.material.name])
            solids.append(Solid(matrix, np.array(size) / 2, not boxed, colour))
        if solids:
            yield Link(solids)


def lit(robot: list[Link], points: Array, random: np.random.Generator) -> Array:
    """Return how much light each point gets, from 0 (in the robot's shadow) to 1."""
    light = np.zeros(len(points))
    for _ in range(LAMPS):
        towards = unit(LIGHT + random.normal(0.0, LAMP_SIZE, points.shape))
        free = np.ones(len(points))
        for solid, hits in meet(robot, points, towards):
            free[hits.rays] *= 1.0 - solid.rgba[3] ** 2
        light += free / LAMPS
    return light


def render(rays: Array, robot: list[Link], random: np.random.Generator) -> Array:
    """Return the colour that the camera sees along each of these rays."""
    eyes = np.broadcast_to(EYE_M, rays.shape)
    depth = np.where(rays[:, 2] < 0.0, -EYE_M[2] / np.minimum(rays[:, 2], -1e-9), np.inf)
    colour = np.ones(rays.shape)
    floor = np.flatnonzero(np.isfinite(depth))
    points = EYE_M + depth[floor, None] * rays[floor]
    far = np.clip((np.hypot(points[:, 0], points[:, 1]) - FLOOR_M) / FADE_M, 0.0, 1.0)
    floor, points, far = floor[far < 1.0], points[far < 1.0], far[far < 1.0]
    grey = 0.96 * (0.62 + 0.38 * lit(robot, points, random))
    colour[floor] = (grey + (1.0 - grey) * far)[:, None]

    normal, paint = np.zeros(rays.shape), np.zeros(rays.shape)
    seen = np.zeros(len(rays), dtype=bool)
    glass = []
    for solid, hits in meet(robot, eyes, rays):
        if solid.rgba[3] < 1.0:
            glass.append((solid, hits))
            continue
        first = hits.near < depth[hits.rays]
        index = hits.rays[first]
        depth[index], normal[index] = hits.near[first], hits.near_normal[first]
        paint[index], seen[index] = solid.rgba[:3], True
    faces, ways = normal[seen], rays[seen]
    shown = lit(robot, EYE_M + depth[seen, None] * ways + SKIN_M * faces, random)
    bright = 0.39 + 0.09 * faces[:, 2] + 0.16 * np.clip(faces @ FILL, 0.0, 1.0)
    bright += 0.62 * np.clip(faces @ LIGHT, 0.0, 1.0) * shown
    gleam = 0.35 * shown * np.clip((faces * unit(LIGHT - ways)).sum(axis=1), 0.0, 1.0) ** 40
    colour[seen] = np.clip(paint[seen] * bright[:, None] + gleam[:, None], 0.0, 1.0)
    return glaze(colour, depth, rays, glass)


def glaze(colour: Array, depth: Array, rays: Array, glass: list[tuple[Solid, Hits]]) -> Array:
    """Draw transparent solids over the colours behind them, from the lowest to the highest.

    Each face hides 10 to 42 % of the colour behind it. Steep faces hide the most.
    """
    for solid, hits in sorted(glass, key=lambda item: item[0].matrix[2, 3]):
        for at, normal in ((hits.far, hits.far_normal), (hits.near, hits.near_normal)):
            before = at < depth[hits.rays]
            index, faces = hits.rays[before], normal[before]
            facing = np.abs((faces * rays[index]).sum(axis=1))
            cover = np.where(np.abs(faces[:, 2]) < 0.5, 0.42, 0.10 + 0.30 * (1.0 - facing) ** 3)
            tint = solid.rgba[:3] * (0.78 + 0.22 * np.clip(faces @ LIGHT, 0.0, 1.0))[:, None]
            colour[index] += cover[:, None] * (tint - colour[index])
    return colour


def main(folder: Path) -> None:
    """Write ``omnibot_urdf.png``."""
    robot, random = list(links()), np.random.default_rng(1)
    ahead = unit(LOOK_M - EYE_M)
    right = unit(np.cross(ahead, [0.0, 0.0, 1.0]))
    up = np.cross(right, ahead)
    size = np.tan(HALF_VIEW_RAD)
    across = (np.arange(WIDTH * FINER) + 0.5) / (WIDTH * FINER) * 2.0 - 1.0
    bands = []
    for first in range(0, HEIGHT, BAND):
        line = first * FINER + np.arange(BAND * FINER) + 0.5
        x, y = np.meshgrid(across * WIDTH / HEIGHT, 1.0 - line / (HEIGHT * FINER) * 2.0)
        rays = unit(ahead + size * (x[..., None] * right + y[..., None] * up)).reshape(-1, 3)
        shades = render(rays, robot, random).reshape(BAND, FINER, WIDTH, FINER, 3)
        bands.append(shades.mean(axis=(1, 3)))
    picture = np.clip(np.concatenate(bands), 0.0, 1.0)
    imsave(folder / "omnibot_urdf.png", picture, pil_kwargs={"optimize": True})
