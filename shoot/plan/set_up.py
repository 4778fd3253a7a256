"""What is photographed by what camera, with flashes and balls where; what each flash shows of pixels, how noisily."""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.light_layouts import cap, ring
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.spheres import WHITE_BALL_ALBEDO, Kind, Sphere
from shoot.plan.plan_options import AS_USUAL, FEWEST, PlanOptions, View
from solve.pixelwise.iterative import IterativeSettings
from solve.samples import GRAY
from twin.camera.virtual_camera import Sensor
from twin.visibility import Sight

Array = NDArray[np.float64]
FILLS = 0.4
"""Share of the picture's height that the object fills: the balls stand beside it."""
EXPOSURE = 0.7
"""Pixel value of the white ball where it faces the mean flash: the nearest flash may be a third brighter."""
PIXELS = 1500
"""Of the object, evenly in the picture, that a plan is made for."""
RIM = 0.15
"""Cosine to the view under which a pixel is not counted: at the outline, half of it is something else."""
LEFT_BY_MOSAIC = np.array([0.5625, 0.625, 0.5625])
"""Of a sample's variance, mean over a Bayer pattern, red, green, blue: measured, or the mean of two or four."""
CANDIDATES, MOST_TRIED = 60, 100_000
"""Places of the flash, and directions of a cap among which they are sought: a band too thin for that is a ring."""
NEAREST_SIZES, NEAREST_MM = 5.0, 700.0
"""How far the flash is by default: so many object sizes, and so many millimetres."""
IN_VIEW = 0.05
"""Share of the picture around it that a flash stays out of, too."""
USUAL_MM = 20.0
"""Diameter of small bearing balls that are sold."""
LEAST_PX, GOOD_PX = 20.0, 60.0
"""Radius under which some balls are not found, and from which all are: docs/guide/shopping-list.md."""
GAP = 0.3
"""Radii between a ball and the picture's border."""


def lens_camera(focal_mm: float, sensor_mm: float, pixels: tuple[int, int]) -> Camera:
    """Return the camera of a lens on a sensor of this width; the principal point in the middle."""
    width, height = pixels
    focal = focal_mm / sensor_mm * width
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, source="options")


def before_camera(mesh: Mesh, camera: Camera, seen_from: View = "+z") -> Mesh:
    """Return an object put before the camera, in its frame, so that it fills `FILLS` of the picture's height.

    `seen_from`: the axis of the scan that points to the camera; up in the picture is z, or y if z points there.
    """
    axis = np.eye(3)["xyz".index(seen_from[1])]
    toward, up = (-axis if seen_from[0] == "-" else axis), np.eye(3)[1 if seen_from[1] == "z" else 2]
    vertices = (mesh.vertices - mesh.center_mm) @ np.stack([np.cross(up, toward), up, toward]).T
    high = max(float(np.ptp(vertices[:, 1])), float(np.ptp(vertices[:, 0])) * camera.height / camera.width)
    distance_mm = camera.fy * high / (FILLS * camera.height) + float(vertices[:, 2].max())
    return replace(mesh, vertices=vertices - [0, 0, distance_mm])


class ShownObject(NamedTuple):
    """F flashes at P pixels, each sample divided by its flash's intensity."""

    vectors: Array  # (F, P, 3) light vectors of intensity 1
    noise: Array  # (F, P) standard deviation, in units of albedo x vector
    seen: NDArray[np.bool_]  # (F, P)

    def only(self, flashes: NDArray) -> "ShownObject":
        """Return some of the flashes."""
        return self._make(part[flashes] for part in self)


def lights_at(positions: Array, reference: Array) -> Lights:
    """Return near lights of equal energy at positions (F, 3): the nearer, the brighter."""
    away = positions - reference
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    names = tuple(f"flash_{number:03d}" for number in range(1, len(positions) + 1))
    intensities = np.broadcast_to(1 / distance**2, (len(positions), 3))
    return Lights(names, away / distance, intensities, positions, np.asarray(reference, np.float64)).normalised()


@dataclass(frozen=True, eq=False)
class ObjectPixels:
    """An object before a camera, and those of its pixels for which a plan is made.

    `white_value`: of a pixel that shows a surface of reflectance 1 facing the mean flash. `is_mosaic`: two of three
    colours are interpolated, which averages noise. `scatter`: standard deviation of a sample about its shading beside
    the sensor's noise, as a share of it. `said`: where each of these comes from.
    """

    camera: Camera
    mesh: Mesh  # in the camera frame, mm
    points: Array  # (P, 3) mm
    normals: Array  # (P, 3) unit
    flat: Array  # (P, 3) the faces' own normals
    albedo: Array  # (P,) reflectance; a white ball has 0.8
    sensor: Sensor = field(default_factory=Sensor)  # whose photon and read noise the photographs have
    white_value: float = EXPOSURE / WHITE_BALL_ALBEDO
    is_mosaic: bool = True
    casts_shadows: bool = True
    scatter: float = 0.0
    said: tuple[str, ...] = ()

    @property
    def middle_mm(self) -> Array:
        """(3,) the object's middle, where directions are wanted."""
        return self.mesh.center_mm

    @property
    def table_mm(self) -> float:
        """Z of the table: the object's farthest point; the table is taken to face the camera."""
        return float(self.mesh.vertices[:, 2].min())

    @property
    def size_mm(self) -> float:
        """The object's largest extent across the view."""
        return float(np.ptp(self.mesh.vertices[:, :2], axis=0).max())

    @property
    def b(self) -> Array:
        """(P, 3) albedo x normal."""
        return self.albedo[:, None] * self.normals

    def under(self, lights: Lights) -> ShownObject:
        """Return what lights will show.

        Notes
        -----
        value = white x intensity x albedo n.l; white is `white_value`. Its variance is value /
        electrons + read^2; gray is the channels' mean by `GRAY`, each divided by the intensity.
        """
        sensor = self.sensor
        vectors = np.asarray(lights.toward(self.points))
        shade = np.einsum("fpi,pi->fp", vectors, self.normals)
        if self.casts_shadows:
            attached, cast = Sight(self.mesh, self.camera, lights).shadows(self.points, self.normals, self.flat)
            seen = ~(attached | cast).T
        else:
            seen = shade > 0
        body, white = self.albedo * np.maximum(shade, 0), self.white_value * lights.intensities.mean(1)[:, None]
        # As the default solver has it.
        seen &= shade > IterativeSettings().shadow_threshold * np.quantile(np.where(seen, shade, 0), 0.75, axis=0)
        neutral = np.array(sensor.neutral)
        value = white * body
        read = sensor.noise_e / sensor.white_e
        kept = LEFT_BY_MOSAIC if self.is_mosaic else np.ones(3)
        variance = np.einsum("c,fpc->fp", GRAY**2 * kept, value[..., None] * neutral / sensor.white_e + read**2)
        noise = np.hypot(np.sqrt(variance) / (white * (GRAY @ neutral)), self.scatter * body)
        seen &= value < 1
        return ShownObject(vectors, noise, seen)


def pixels_of(
    camera: Camera, mesh: Mesh, count: int = PIXELS, *, albedo: float = AS_USUAL.albedo, **known: Any
) -> ObjectPixels:
    """Return some of the pixels that show the object, evenly in the picture; `known`: fields of `ObjectPixels`."""
    corners = camera.project(mesh.vertices)
    low = np.floor(np.nanmin(corners, 0)).clip(0, [camera.width - 1, camera.height - 1])
    high = np.ceil(np.nanmax(corners, 0)).clip(1, [camera.width, camera.height])
    sight = Sight(mesh, camera, Lights.unknown(()))
    step = max(1.0, float(np.sqrt(np.prod(high - low) / (1.6 * count))))
    for _ in range(3):
        u, v = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
        face, weights, points = sight.at(np.stack([u, v], -1).reshape(-1, 2))
        hit = face >= 0
        if hit.sum() <= count or step == 1:
            break
        step *= float(np.sqrt(hit.sum() / count))
    if not hit.any():
        raise SceneError("plan: the camera does not see the object. Check --pixels, --focal-mm and --unit.")
    face, weights, points = face[hit], weights[hit], points[hit]
    normals = np.einsum("pc,pck->pk", weights, mesh.vertex_normals[mesh.faces[face]])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    flat = mesh.face_normals[face]
    toward = np.array([[0.0, 0.0, 1.0]]) if camera.is_orthographic else unit(-points)
    good = (np.sum(normals * toward, 1) > RIM) & (np.sum(flat * toward, 1) > 0)
    reflectances = np.full(int(good.sum()), albedo)
    return ObjectPixels(camera, mesh, points[good], normals[good], flat[good], reflectances, **known)


def places_in_reach(options: PlanOptions, middle: Array, size_mm: float, count: int = CANDIDATES) -> Array:
    """Return about `count` places (C, 3), mm, evenly over the reach of the flash around the object's middle.

    Raises SceneError: too few places are in reach.
    """
    start_deg, end_deg = options.from_deg, options.to_deg
    if start_deg > end_deg:
        raise SceneError(f"--from-deg {start_deg:g}, --to-deg {end_deg:g}: expected the first not to be larger.")
    inner, outer = np.cos(np.radians([start_deg, end_deg]))
    if (inner - outer) * MOST_TRIED <= count * (1 - outer):
        directions = ring(count, end_deg)
    else:
        directions = cap(round(count * (1 - outer) / (inner - outer)), end_deg)
        directions = directions[directions[:, 2] <= inner]
    azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0])) % 360
    start, end = options.azimuths_deg
    directions = directions[(azimuth - start) % 360 <= (end - start if end > start else end - start + 360)]
    if len(directions) < FEWEST:
        raise SceneError(
            f"--azimuths-deg {start:g} {end:g}: {len(directions)} places are in reach, {FEWEST} are needed at least. "
            "Normals need flashes from several sides."
        )
    return middle + (options.flash_mm or max(NEAREST_SIZES * size_mm, NEAREST_MM)) * directions


def out_of_view(camera: Camera, positions: Array) -> Array:
    """Return the positions (F, 3) that do not stand in the picture, between camera and object.

    An orthographic camera is one of which nothing is known: it tells nothing of its sides.

    Raises SceneError: none is left.
    """
    if camera.is_orthographic:
        return positions
    with np.errstate(invalid="ignore"):
        place = camera.project(positions) / [camera.width, camera.height]
    outside = positions[~np.all((place > -IN_VIEW) & (place < 1 + IN_VIEW), axis=1)]
    if not len(outside):
        raise SceneError(
            f"flashes: all {len(positions)} places in reach stand in the picture. Take a greater distance "
            "(--flash-mm), or larger angles (--from-deg, --to-deg)."
        )
    return outside


def corner_balls(pixels: ObjectPixels, diameter_mm: float | None) -> list[Sphere]:
    """Return three chrome balls and a white one on the table, in the picture's corners; None: large enough.

    Raises SceneError: there is no room for them.
    """
    camera, away = pixels.camera, -pixels.table_mm
    diameter = diameter_mm or max(USUAL_MM, float(np.ceil(2 * GOOD_PX * away / (camera.fx + GOOD_PX))))
    depth = away - diameter / 2
    radius = camera.fx * diameter / 2 / depth if depth > 0 else np.inf
    inset, far = (1 + GAP) * radius, np.array([camera.width, camera.height]) - 1
    if 2 * inset >= far.min():
        raise SceneError(f"balls: no room in the picture for four of {diameter:g} mm. Take smaller ones (--ball-mm).")
    corners = np.array([(0, 1), (1, 0), (1, 1), (0, 0)]) * (far - 2 * inset) + inset
    kinds: tuple[Kind, ...] = ("chrome", "chrome", "chrome", "white")
    return [Sphere(kind, corner, radius, diameter) for kind, corner in zip(kinds, corners, strict=True)]
