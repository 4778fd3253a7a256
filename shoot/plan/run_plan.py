"""`rgbn plan`: the set-up read or put together, the flashes chosen; plan.json, tables, words, and one page to print."""

from json import dumps
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import escape

from align.scan.mended_scan import load_scan
from compare.report.page import environment, table, whole_page
from draw.light_charts import directions
from formats.meshes.scan_files import SUFFIXES
from lab.progress import is_quiet, say
from lab.run import open_job
from lab.terminal_tables import cells_of, number_table, show
from scene.errors import SceneError
from scene.files import plain, write_json, write_text
from scene.lights import Lights, known_median
from scene.mesh import Mesh
from scene.origin import Origin
from scene.output_folder import open_record, own_folder
from scene.record import Record
from shoot.plan.plan_options import PlanOptions
from shoot.plan.set_up import (
    EXPOSURE,
    FILLS,
    GOOD_PX,
    LEAST_PX,
    ObjectPixels,
    before_camera,
    corner_balls,
    lens_camera,
    pixels_of,
)
from shoot.plan.shoot_plan import Predicted, plan_shoot
from shoot.plan.under_way import UnderWay, session_so_far
from twin.camera.virtual_camera import Sensor
from twin.description.object_mesh import built_in

MOST_ROWS = 36
"""Flashes in the page's table: a page has no room for more; plan.json has all."""


def show_plan(facts: dict[str, Any], *, as_json: bool) -> None:
    """Print what `run_plan` returned."""
    if as_json:
        print(dumps(facts, indent=1))
        return
    tables = [number_table("flashes, the most useful first", "flashes", facts["flashes"])]
    if facts["balls"]:
        tables.append(number_table("balls, from the object's middle", "planned balls", facts["balls"]))
    show(*tables, answer_of(facts))
    for name in () if is_quiet() else ("plan.html", "plan.json"):
        print(f"written  {Path(facts['folder']) / name}")
    for text in facts["warnings"]:
        say(f"warning: {text}", always=True)


def run_plan(source: Path | None, options: PlanOptions, *, out: Path | None = None) -> dict[str, Any]:
    """Plan a shoot; write plan.json and plan.html into the output folder, and return the first.

    Parameters
    ----------
    source : Path or None
        A scan; a session or an output folder, whose flashes so far count; None: a sphere.
    options : PlanOptions
        What `source` does not tell.
    out : Path, optional
        Default: a session's own; out/plan-NAME by the scan's name.

    Raises
    ------
    SceneError
        An option or the source is at fault.
    """
    name = f"sphere of {options.size_mm:g} mm" if source is None else source.resolve().stem
    if source is not None and (source.is_dir() or source.suffix == ".toml"):
        with open_job(source, out=out) as job:
            so_far = session_so_far(job)
            return _written(job.record, so_far, so_far.within(options), name, source)
    pixels = _new_pixels(source, options)
    usual, origin = Path("out") / "plan-sphere", "plan"
    if source is not None:
        origin = Origin("scan", source.resolve())
        usual = own_folder(Path("out") / f"plan-{source.stem}", origin)
    with open_record(out or usual, origin=origin, inputs=[] if source is None else [source]) as record:
        begun = UnderWay(pixels, corner_balls(pixels, options.ball_mm))
        return _written(record, begun, options, name, source)


def _written(record: Record, so_far: UnderWay, options: PlanOptions, name: str, source: Path | None) -> dict[str, Any]:
    facts = plan_facts(so_far, *plan_shoot(so_far, options)) | {
        "name": name,
        "source": None if source is None else str(source),
    }
    with record.part_of("plan"):
        write_json(record.folder / "plan.json", facts)
        write_text(record.folder / "plan.html", plan_page(facts))
    return facts | {"folder": str(record.folder)}


def _new_pixels(source: Path | None, options: PlanOptions) -> ObjectPixels:
    if source is None:
        ball = built_in("sphere")
        mesh = Mesh(ball.vertices * options.size_mm / 2, ball.faces)
        told = f"object: a sphere of {options.size_mm:g} mm"
    else:
        if not source.exists():
            raise SceneError(f"{source}: there is no such scan or session.")
        unit = options.unit or "unknown"
        if unit == "unknown" and source.suffix.lower() in SUFFIXES:
            raise SceneError(f"{source}: a scan's file does not tell its unit. Give it: --unit mm (or cm, m, inch).")
        mesh = load_scan(source, unit)
        told = f"object: {source.name}, {len(mesh.faces):,} faces, {options.seen_from} toward the camera"
    lens = lens_camera(options.focal_mm, options.sensor_mm, options.pixels)
    mesh = before_camera(mesh, lens, options.seen_from)
    said = (
        told,
        f"camera: {options.focal_mm:g} mm on {options.sensor_mm:g} mm, {lens.width} x {lens.height} px; "
        f"{-mesh.center_mm[2]:.0f} mm from the object's middle, which fills {FILLS:.0%} of the picture",
        f"noise of a usual sensor at ISO {Sensor().iso:g}",
    )
    return pixels_of(lens, mesh, albedo=options.albedo, said=said)


def plan_facts(so_far: UnderWay, lights: Lights, predictions: list[Predicted]) -> dict[str, Any]:
    """Return the plan."""
    pixels, result = so_far.pixels, predictions[-1]
    camera, middle = pixels.camera, pixels.middle_mm
    rows = lights.facts()["frames"]
    errors = [None] * (len(rows) - len(predictions)) + [one.error_deg for one in predictions]
    for number, (row, error) in enumerate(zip(rows, errors, strict=True), 1):
        away = row["position_mm"] - middle
        row |= {
            "number": number,
            "there": "there" if number <= len(so_far.lights) else "",
            "clock": clock(row["azimuth_deg"]),
            "height_cm": (row["position_mm"][2] - pixels.table_mm) / 10,
            "aside_cm": np.hypot(*away[:2]) / 10,
            "error_median_deg": error,
        }
    balls = []
    for sphere in so_far.spheres:
        # Where a ball of unknown size stands nobody knows.
        if sphere.diameter_mm:
            right, up, _ = (sphere.center_mm(camera) - middle) / 10
            told = {"kind": sphere.kind, "diameter_mm": sphere.diameter_mm, "radius_px": sphere.radius_px}
            balls.append(told | {"center_px": sphere.center_px, "right_cm": right, "up_cm": up})
    facts = {
        "flashes": rows,
        "there": len(so_far.lights),
        "error_median_deg": result.error_deg,
        "by_noise_deg": None if result.error_deg is None else np.median(result.by_noise_deg),
        "lights_sigma_deg": known_median(lights.direction_sigma_deg),
        "balls": balls,
        "camera": {"width": camera.width, "height": camera.height, "distance_mm": np.linalg.norm(middle)},
        "object": {
            "size_mm": pixels.size_mm,
            "mm_per_px": None if camera.is_orthographic else -middle[2] / camera.fx,
            "albedo": np.median(pixels.albedo),
        },
        "flash_mm": np.median([row["distance_mm"] for row in rows]),
        "white_ball_value": EXPOSURE,
        "said": pixels.said,
        "warnings": _warnings(so_far, min(row["distance_mm"] for row in rows), result),
    }
    return plain(facts)


def clock(azimuth_deg: float) -> str:
    """Return an azimuth, 0 right and 90 up, as the hour on a clock's face, to a quarter: 12:00 is up."""
    quarters = round(((90 - azimuth_deg) % 360) / 7.5) % 48
    return f"{(quarters // 4) or 12}:{15 * (quarters % 4):02d}"


def _warnings(so_far: UnderWay, nearest: float, result: Predicted) -> list[str]:
    """Return what is to be looked at before the shoot; `nearest`: of the flashes, mm."""
    found = []
    if (told := float((result.sigma_deg < 90).mean())) < 0.995:
        found.append(
            f"{1 - told:.1%} of the object is lit by fewer than three of the flashes, and has no normal: lower "
            "flashes (--to-deg), or a second view."
        )
    smallest = min((sphere.radius_px for sphere in so_far.spheres), default=LEAST_PX)
    if smallest < LEAST_PX:
        found.append(
            f"balls of {smallest:.0f} px in radius are not found surely: {LEAST_PX:g} px are needed, {GOOD_PX:g} are "
            "good. Larger balls, or a nearer camera."
        )
    depth = float(np.ptp(so_far.pixels.points[:, 2]))
    if depth > 0.1 * nearest:
        found.append(
            f"the object is {depth:.0f} mm deep under flashes {nearest:.0f} mm away. Solve with --method near, which "
            "knows its depth; others add degrees of error that do not go away with more flashes."
        )
    return found


def answer_of(facts: dict[str, Any]) -> str:
    """Return what the plan gives, in a few sentences."""
    flashes, there, error = facts["flashes"], facts["there"], facts["error_median_deg"]
    many = f"{there} flashes are there, {len(flashes) - there} more" if there else f"{len(flashes)} flashes"
    if error is None:
        return f"{many}: too few to tell the normals."
    sigma = facts["lights_sigma_deg"]
    lights = f" and by the lights' directions {sigma:.2g}°" if sigma is not None else ""
    text = (
        f"{many}: normals to {error:.2g}° (median error to be expected, of a matte surface, shadows left out), by the "
        f"photographs' noise {facts['by_noise_deg']:.2g}°{lights} a tangent axis."
    )
    if sigma is None:
        text += " How far the lights' directions are off is not known, and the error counts nothing of it."
    if 0 < there < len(flashes):
        now, row = flashes[there - 1]["error_median_deg"], flashes[there]
        gain = f", which brings {now:.2g}° to {row['error_median_deg']:.2g}°" if now else ""
        text += f" Next: {row['zenith_deg']:.0f}° from the axis at {row['clock']} o'clock{gain}."
    return text


def plan_page(facts: dict[str, Any]) -> str:
    """Return the page of a plan's facts."""

    def shown(name: str, rows: list[dict[str, Any]]) -> str:
        columns = cells_of(name, rows)
        return table(list(columns), zip(*columns.values(), strict=True), kind="numbers")

    flashes = [row for row in facts["flashes"] if not row["there"] or len(facts["flashes"]) <= MOST_ROWS]
    template = environment().from_string(Path(__file__).with_name("plan_page.html").read_text("utf-8"))
    body = template.render(
        facts,
        dome=directions({"frames": facts["flashes"]}),
        flash_table=shown("flashes", flashes[:MOST_ROWS]),
        left_out=len(flashes) - MOST_ROWS,
        ball_table=shown("planned balls", facts["balls"]),
    )
    return whole_page(facts["name"], "plan of a shoot", escape(answer_of(facts)), body)
