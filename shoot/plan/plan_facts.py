"""A plan as plan.json has it: numbers with their units in their names."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.predicted_lights import UNKNOWN_INTENSITY
from scene.files import plain
from scene.normals import unit
from scene.spheres import Sphere
from shoot.plan.ball_places import GOOD_PX, LEAST_PX, shaded_shares
from shoot.plan.flash_places import minutes
from shoot.plan.set_up import EXPOSURE, SetUp
from shoot.plan.shoot_plan import Predicted, ShootPlan

Array = NDArray[np.float64]
USED_FOR_BALLS = 60
"""Flashes at most of which it is told whether a ball lies in the object's shadow."""


def brief(value: float) -> str:
    """Return a number to two digits, and to no fewer than its whole ones: 0.12, 3.4, 320."""
    return f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.2g}"


def plan_facts(plan: ShootPlan) -> dict[str, Any]:
    """Return the plan."""
    set_up, options, result, lights = plan.pixels.set_up, plan.options, plan.result, plan.lights
    rows = [
        _flash(plan, number, position, predicted)
        for number, (position, predicted) in enumerate(zip(plan.positions_mm, plan.predicted, strict=True), 1)
    ]
    camera = set_up.camera
    corners = camera.points_at_depth([[-0.5, -0.5], [camera.width - 0.5, camera.height - 0.5]], set_up.table_mm)
    facts = {
        "flashes": rows[: plan.flashes],
        "next_flashes": rows[plan.flashes :],
        "there": plan.there,
        "predicted": None if result is None else result.summary(),
        "lights": {
            "direction_sigma_deg": np.median(lights.direction_sigma_deg),
            "position_sigma_mm": np.median(lights.position_sigma_mm),
            "range_sigma": np.median(lights.range_sigma),
            "intensity_sigma": lights.intensity_sigma,
        },
        "accuracy_deg": options.accuracy_deg,
        "stop_after": plan.stop_after,
        "helps_until": plan.helps_until,
        "minutes": minutes(options.layout, plan.flashes - plan.there),
        # Where a ball of unknown size stands nobody knows.
        "balls": [
            _ball(set_up, sphere, plan.positions_mm[:USED_FOR_BALLS]) for sphere in plan.spheres if sphere.diameter_mm
        ],
        "camera": {
            "width": camera.width,
            "height": camera.height,
            "fx": camera.fx,
            "distance_mm": np.linalg.norm(set_up.middle_mm),
            "mm_per_px": -set_up.middle_mm[2] / camera.fx,
            "field_mm": corners[:, :2] - set_up.middle_mm[:2],
        },
        "object": {
            "size_mm": set_up.size_mm,
            "depth_mm": np.ptp(set_up.mesh.vertices[:, 2]),
            "middle_mm": set_up.middle_mm,
            "table_z_mm": set_up.table_mm,
            "gloss": set_up.gloss,
            "albedo": set_up.albedo,
            "pixels": len(plan.pixels.points),
            "outline_mm": _outline(plan.pixels.points - set_up.middle_mm),
        },
        "exposure": {
            "white_ball_value": EXPOSURE,
            "object_value": set_up.white_value * np.median(plan.pixels.albedo),
            "electrons_at_white": set_up.sensor.white_e,
            "read_noise_electrons": set_up.sensor.noise_e,
        },
        "reach": {
            "layout": options.layout,
            "from_deg": options.from_deg,
            "to_deg": options.to_deg,
            "distance_mm": np.median(np.linalg.norm(plan.positions_mm - set_up.middle_mm, axis=1)),
            "azimuths_deg": list(options.azimuths_deg),
        },
        "said": list(set_up.said),
        "warnings": _warnings(plan),
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
        "minutes": minutes(plan.options.layout, max(number - plan.there, 0)),
    }


def clock(azimuth_deg: float) -> str:
    """Return an azimuth, 0 right and 90 up, as the hour on a clock's face, to a quarter: 12:00 is up."""
    quarters = round(((90 - azimuth_deg) % 360) / 7.5) % 48
    return f"{(quarters // 4) or 12}:{15 * (quarters % 4):02d}"


def _ball(set_up: SetUp, sphere: Sphere, positions: Array) -> dict[str, Any]:
    center = sphere.center_mm(set_up.camera)
    away = center - set_up.middle_mm
    return {
        "kind": sphere.kind,
        "diameter_mm": sphere.diameter_mm,
        "radius_px": sphere.radius_px,
        "center_px": sphere.center_px,
        "center_mm": center,
        "right_mm": away[0],
        "up_mm": away[1],
        "shaded_share": shaded_shares(set_up, center[None], positions)[0] if len(set_up.mesh.faces) else None,
    }


def _outline(points: Array) -> Array:
    """Return the corners (K, 2) of the hull of what is seen, as the camera sees it, mm."""
    import cv2

    hull = np.asarray(cv2.convexHull(np.ascontiguousarray(points[:, :2], np.float32)))
    return hull.reshape(-1, 2).astype(np.float64)


def _warnings(plan: ShootPlan) -> list[str]:
    """Return what is to be looked at before the shoot."""
    found, result, wanted = [], plan.result, plan.options.accuracy_deg
    if plan.pixels.set_up.gloss != "matte":
        found.append(
            f"a {plan.pixels.set_up.gloss} object: the error counts the samples that lie neither in gloss nor in "
            "shadow. A method must leave those out too (iterative, rpca); what gloss it keeps, and light from part to "
            "part, come on top."
        )
    if result is not None:
        told = float((result.sigma_deg < 90).mean())
        if told < 0.995:
            found.append(
                f"{1 - told:.1%} of the object is lit by fewer than three of the flashes, and has no normal: lower "
                "flashes (--to-deg), or a second view."
            )
        last = plan.predicted[-1]
        if wanted and plan.stop_after is None and last is not None:
            found.append(
                f"{wanted:g} degrees are not reached with {len(plan.predicted)} flashes (expected "
                f"{brief(last.error_deg)}): by noise alone {brief(result.noise_deg)}, by the lights alone "
                f"{brief(result.lights_deg)}. "
                + ("Larger balls." if result.lights_deg > result.noise_deg else "More light, or a lower ISO.")
            )
    if plan.lights.intensity_sigma >= UNKNOWN_INTENSITY:
        found.append("no white ball: how bright each flash was is then only known to some 10 %. Add one.")
    if sum(sphere.kind == "chrome" for sphere in plan.spheres) == 1:
        found.append("one chrome ball: the flashes have no distance. Add a second one on the object's other side.")
    smallest = min((sphere.radius_px for sphere in plan.spheres), default=LEAST_PX)
    if smallest < LEAST_PX:
        found.append(
            f"balls of {smallest:.0f} px in radius are not found surely: {LEAST_PX:g} px are needed, {GOOD_PX:g} are "
            "good. Larger balls, or a nearer camera."
        )
    depth = float(np.ptp(plan.pixels.points[:, 2]))
    nearest = float(np.linalg.norm(plan.positions_mm - plan.pixels.set_up.middle_mm, axis=1).min())
    if depth > 0.1 * nearest:
        found.append(
            f"the object is {depth:.0f} mm deep under flashes {nearest:.0f} mm away. Solve with --method near, which "
            "knows its depth; others add degrees of error that do not go away with more flashes."
        )
    return found
