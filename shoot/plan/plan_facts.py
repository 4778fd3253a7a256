"""A plan as plan.json has it: numbers with their units in their names."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.predicted_lights import UNKNOWN_INTENSITY
from scene.files import plain
from scene.normals import unit
from scene.spheres import Sphere
from shoot.plan.ball_places import BallChoice, shaded_shares
from shoot.plan.set_up import EXPOSURE, SetUp
from shoot.plan.shoot_plan import Predicted, ShootPlan

Array = NDArray[np.float64]
USED_FOR_BALLS = 60
"""Flashes at most of which it is told whether a ball lies in the object's shadow."""


def plan_facts(
    plan: ShootPlan, even: dict[int, Predicted], choices: list[BallChoice], accuracy_deg: float | None
) -> dict[str, Any]:
    """Return the plan; `even`: what as many flashes give that lie evenly; `choices` of balls that were looked at."""
    set_up, reach = plan.pixels.set_up, plan.reach
    result = plan.result
    rows = [
        _flash(plan, number, position, predicted)
        for number, (position, predicted) in enumerate(zip(plan.positions_mm, plan.predicted, strict=True), 1)
    ]
    used = rows[: plan.flashes]
    new = plan.flashes - plan.there
    facts = {
        "flashes": used,
        "next_flashes": rows[plan.flashes :],
        "there": plan.there,
        "predicted": None if result is None else result.summary(),
        "lights": _lights(plan),
        "even": {count: one.summary() for count, one in even.items()},
        "accuracy_deg": accuracy_deg,
        "stop_after": plan.stop_after,
        "helps_until": plan.helps_until,
        "minutes": reach.minutes(new),
        # Where a ball of unknown size stands nobody knows.
        "balls": [
            _ball(set_up, sphere, plan.positions_mm[:USED_FOR_BALLS]) for sphere in plan.spheres if sphere.diameter_mm
        ],
        "ball_choices": [
            {
                "chrome": choice.count,
                "diameter_mm": choice.diameter_mm,
                "radius_px": choice.radius_px,
                "direction_sigma_deg": choice.direction_sigma_deg,
            }
            for choice in choices
        ],
        "camera": _camera(set_up),
        "object": {
            "size_mm": set_up.size_mm,
            "depth_mm": float(np.ptp(set_up.mesh.vertices[:, 2])),
            "middle_mm": set_up.middle_mm,
            "table_z_mm": set_up.table_mm,
            "gloss": set_up.gloss,
            "albedo": set_up.albedo,
            "pixels": len(plan.pixels.points),
            "outline_mm": _outline(plan.pixels.points - set_up.middle_mm),
        },
        "exposure": {
            "white_ball_value": EXPOSURE,
            "object_value": float(set_up.white_value * np.median(plan.pixels.albedo)),
            "electrons_at_white": set_up.sensor.white_e,
            "read_noise_electrons": set_up.sensor.noise_e,
        },
        "reach": {
            "layout": reach.layout,
            "from_deg": reach.from_deg,
            "to_deg": reach.to_deg,
            "distance_mm": float(np.median(np.linalg.norm(plan.positions_mm - set_up.middle_mm, axis=1))),
            "azimuths_deg": list(reach.azimuths_deg),
            "seconds_per_flash": 60 * (reach.minutes(1) - reach.minutes(0)),
            "set_up_minutes": reach.minutes(0),
        },
        "said": list(set_up.said),
        "warnings": [*set_up.warnings, *_warnings(plan, accuracy_deg)],
    }
    return plain(facts)


def _flash(plan: ShootPlan, number: int, position: Array, predicted: Predicted | None) -> dict[str, Any]:
    """Return one flash: as the camera sees it, and for a tape measure."""
    set_up = plan.pixels.set_up
    away = position - set_up.middle_mm
    x, y, z = unit(away)
    azimuth = float(np.degrees(np.arctan2(y, x)) % 360)
    return {
        "number": number,
        "is_there": number <= plan.there,
        "direction": [x, y, z],
        "from_axis_deg": float(np.degrees(np.arctan2(np.hypot(x, y), z))),
        "azimuth_deg": azimuth,
        "clock": clock(azimuth),
        "position_mm": position,
        "distance_mm": float(np.linalg.norm(away)),
        "height_mm": float(position[2] - set_up.table_mm),
        "aside_mm": float(np.hypot(*away[:2])),
        "error_median_deg": None if predicted is None else predicted.error_deg,
        "minutes": plan.reach.minutes(max(number - plan.there, 0)),
    }


def clock(azimuth_deg: float) -> str:
    """Return an azimuth, 0 right and 90 up, as the hour on a clock's face, to a quarter: 12:00 is up."""
    quarters = round(((90 - azimuth_deg) % 360) / 7.5) % 48
    return f"{(quarters // 4) or 12}:{15 * (quarters % 4):02d}"


def _lights(plan: ShootPlan) -> dict[str, float]:
    lights = plan.lights
    return {
        "direction_sigma_deg": float(np.median(lights.direction_sigma_deg)),
        "position_sigma_mm": float(np.median(lights.position_sigma_mm)),
        "range_sigma": float(np.median(lights.range_sigma)),
        "intensity_sigma": lights.intensity_sigma,
    }


def _ball(set_up: SetUp, sphere: Sphere, positions: Array) -> dict[str, Any]:
    center = sphere.center_mm(set_up.camera)
    away = center - set_up.middle_mm
    return {
        "kind": sphere.kind,
        "diameter_mm": sphere.diameter_mm,
        "radius_px": sphere.radius_px,
        "center_px": sphere.center_px,
        "center_mm": center,
        "right_mm": float(away[0]),
        "up_mm": float(away[1]),
        "shaded_share": float(shaded_shares(set_up, center[None], positions)[0]) if len(set_up.mesh.faces) else None,
    }


def _camera(set_up: SetUp) -> dict[str, Any]:
    camera = set_up.camera
    corners = camera.points_at_depth([[-0.5, -0.5], [camera.width - 0.5, camera.height - 0.5]], set_up.table_mm)
    return {
        "width": camera.width,
        "height": camera.height,
        "fx": camera.fx,
        "distance_mm": float(np.linalg.norm(set_up.middle_mm)),
        "mm_per_px": float(-set_up.middle_mm[2] / camera.fx),
        "field_mm": corners[:, :2] - set_up.middle_mm[:2],
    }


def _outline(points: Array) -> Array:
    """Return the corners (K, 2) of the hull of what is seen, as the camera sees it, mm."""
    import cv2

    hull = np.asarray(cv2.convexHull(np.ascontiguousarray(points[:, :2], np.float32)))
    return hull.reshape(-1, 2).astype(np.float64)


def _warnings(plan: ShootPlan, accuracy_deg: float | None) -> list[str]:
    """Return what is to be looked at before the shoot."""
    found, result, set_up = [], plan.result, plan.pixels.set_up
    if result is not None:
        told = float((result.sigma_deg < 90).mean())
        if told < 0.995:
            found.append(
                f"{1 - told:.1%} of the object is lit by fewer than three of the flashes, and has no normal: lower "
                "flashes (--to-deg), or a second view."
            )
        last = plan.predicted[-1]
        if accuracy_deg and plan.stop_after is None and last is not None:
            found.append(
                f"{accuracy_deg:g} degrees are not reached with {len(plan.predicted)} flashes (expected "
                f"{last.error_deg:.2g}): by noise alone {result.noise_deg:.2g}, by the lights alone "
                f"{result.lights_deg:.2g}. "
                + ("Larger balls." if result.lights_deg > result.noise_deg else "More light, or a lower ISO.")
            )
    if plan.lights.intensity_sigma >= UNKNOWN_INTENSITY:
        found.append("no white ball: how bright each flash was is then only known to some 10 %. Add one.")
    if sum(sphere.kind == "chrome" for sphere in plan.spheres) == 1:
        found.append("one chrome ball: the flashes have no distance. Add a second one on the object's other side.")
    small = [sphere for sphere in plan.spheres if sphere.radius_px < 20]
    if small:
        found.append(
            f"balls of {min(s.radius_px for s in small):.0f} px in radius are not found surely: 20 px are needed, 60 "
            "are good. Larger balls, or a nearer camera."
        )
    depth = float(np.ptp(plan.pixels.points[:, 2]))
    nearest = float(np.linalg.norm(plan.positions_mm - set_up.middle_mm, axis=1).min())
    if depth > 0.1 * nearest:
        found.append(
            f"the object is {depth:.0f} mm deep under flashes {nearest:.0f} mm away. Solve with --method near, which "
            "knows its depth; others add degrees of error that do not go away with more flashes."
        )
    return found
