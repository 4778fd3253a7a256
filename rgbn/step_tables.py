"""The end of a run, for people at a terminal: what each step found, where it wrote it, and what comes next."""

import json
import math
import os
import shlex
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from compare.report.advice import advice
from compare.report.facts import all_warnings, sphere_rows
from compare.report.page import plain
from compare.report.verdict import trust_sentence, verdict
from compare.statistics.statistics import statistics_rows
from draw.readable import Readable, readable, share
from lab.job import Job
from lab.progress import say
from lab.terminal_tables import fact_table, number_table, show
from scene.camera import Camera
from scene.lights import Lights
from scene.store import Store

Values = Mapping[str, Any]


def check_tables(job: Job, summary: Values) -> Iterator[Any]:
    """Yield frames, brightness, clipping and the camera."""
    found = summary["capture"]
    rows = found["frames_table"]
    dark, bright = (one(rows, key=lambda row: row["brightness"]) for one in (min, max))
    clipped = max(rows, key=lambda row: row["saturated_share"])
    most = f"{share(clipped['saturated_share'], 1)} % of the pixels in {clipped['name']}, fewer in the others"
    # Beside the warning of it, as it was before the balls had their say.
    camera, told = Store(job.store.path("frames")).load_camera(), job.store.load_camera()
    by_balls = Readable().format("; by the balls and lights {fx:1px} ± {focal_sigma:1%}", **vars(told))
    words = {
        "ambient_words": "an ambient frame is subtracted" if found["ambient"] else "no ambient frame",
        "dark": dark,
        "bright": bright,
        "clipped": most if clipped["saturated_share"] else "no pixel",
        "camera_words": camera_text(camera) + (by_balls if told.fx != camera.fx and not told.is_orthographic else ""),
    }
    yield fact_table(f"{summary['name']}: check", "check", found | words)


def camera_text(camera: Camera) -> str:
    """Return focal length, field of view, and where they come from."""
    if camera.is_orthographic:
        return f"focal length not known, taken as orthographic ({camera.source})"
    across, down = (
        math.degrees(2 * math.atan(size / (2 * focal)))
        for size, focal in ((camera.width, camera.fx), (camera.height, camera.fy))
    )
    doubt = f" ± {share(camera.focal_sigma, 1)} %" if camera.focal_sigma else ""
    source = "taken as most cameras have it" if camera.source == "assumed" else f"from {camera.source}"
    return f"focal length {readable(camera.fx, 1)} px{doubt}, field of view {across:.1f} x {down:.1f} deg, {source}"


def calibrate_tables(job: Job, summary: Values) -> Iterator[Any]:
    """Yield the table of the lights, and that of the balls where there are any; of unknown lights that they are it."""
    lights = job.store.load_lights()
    if lights.is_unknown:
        words = f"{len(lights)}, unknown: no ball was found, and no file gives them"
        yield fact_table("calibrate", {"lights": words})
        return
    # `align` moves them.
    seen = "the object" if "align" in job.done else "amid the balls"
    yield light_table(f"calibrate: {len(lights)} {lights.model} lights, seen from {seen}", lights)
    if balls := sphere_rows(job.store):
        yield number_table("calibrate: balls", "told balls", balls)


def light_table(title: str, lights: Lights) -> Any:
    """Return the table of lights whose directions are known."""
    rows = [
        row | {"intensity": float(level)} for row, level in zip(lights.rows(), lights.intensities.mean(1), strict=True)
    ]
    caption, sigmas = "elevation 90: on the camera's axis; azimuth 0: right, 90: up", lights.direction_sigma_deg
    if np.isfinite(sigmas).any():
        worst = lights.names[int(np.nanargmax(sigmas))]
        caption = (
            f"sigma {readable(float(np.nanmedian(sigmas)))} deg (median), {readable(float(np.nanmax(sigmas)))} deg at "
            f"worst ({worst}); {caption}"
        )
    return number_table(title, "told lights", rows, caption)


def align_tables(job: Job, summary: Values) -> Iterator[Any]:
    """Yield the registration, or that there is none."""
    found, session = summary["align"] or {}, job.session
    if found.get("residual_px") is None:
        known = "given normals" if session.normals else "none: the session names no scan and no normals"
        yield fact_table("align", {"ground truth": known})
        return
    yield fact_table("align", "align", found | {"scan": session.scan.name})


def solve_tables(job: Job, summary: Values) -> Iterator[Any]:
    """Yield the methods; where they were asked to, how well each predicts photographs, and what to take."""
    methods = summary["solve"]["methods"]
    yield number_table("solve", "solved", methods)

    if found := summary["trust"]:
        yield number_table("trust", "trust", found["methods"])
        yield fact_table("", {"trust": plain(trust_sentence(found)).strip()})


def twin_tables(job: Job, summary: Values) -> Iterator[Any]:
    """Yield the rendering, or that there is none."""
    if twin := summary["twin"]:
        yield fact_table("twin", "twin", twin["material"] | (twin.get("held_out") or {}) | twin)
    else:
        yield fact_table("twin", {"not rendered": "no scan is registered, or no material fits it"})


def compare_tables(job: Job, summary: Values) -> Iterator[Any]:
    """Yield the errors, and against a known truth what each step is off."""
    if rows := statistics_rows(summary["compare"]):
        yield number_table("compare: angular error, degrees", "told errors", rows)
    else:
        yield fact_table("compare", {"no errors": "there is no ground truth: no scan, no given normals"})
    if check := summary.get("truth_check"):
        yield number_table("against the known truth", "known truth", check)
    statements = verdict(dict(summary))
    said = {"verdict": f"{statements[0].word}: {statements[0].text}", "do": plain(advice(dict(summary), statements))}
    surface = (summary.get("results") or {}).get("surface")
    yield fact_table("", said | ({"surface": "by {method}; {scale}".format(**surface)} if surface else {}))


TABLES: dict[str, tuple[Callable[[Job, Values], Iterator[Any]], str]] = {
    "check": (check_tables, "rgbn calibrate {0}"),
    "calibrate": (calibrate_tables, "rgbn align {0}"),
    "align": (align_tables, "rgbn solve {0}"),
    "solve": (solve_tables, "rgbn twin {0}"),
    "twin": (twin_tables, "rgbn compare {0}"),
    "compare": (compare_tables, "look at {0}/report.html; rgbn studio {0}"),
}
"""Of each verb, and what comes next."""


def tell(job: Job, summary: dict[str, Any], *, verb: str, as_json: bool = False, whole: bool = False) -> None:
    """Print what a verb found, as tables or the whole summary as JSON.

    Parameters
    ----------
    job : Job
        Its output folder is read.
    summary : dict
        summary.json.
    verb : str
        The step that was asked for.
    as_json : bool
    whole : bool
        Show what every step found, not the verb's own alone.
    """
    tables = [table for step in (TABLES if whole else [verb]) for table in TABLES[step][0](job, summary)]
    # By the shorter way from here.
    folder, here = job.store.folder, Path(os.path.relpath(job.store.folder))
    near = str(folder if here.parts[:2] == ("..", "..") else here)
    has_twin = verb != "solve" or (folder / "pose.json").exists()
    command = TABLES[verb if has_twin else "twin"][1].format(shlex.quote(near))
    show(*tables, fact_table("", {"written": near, "next": command}), hidden=as_json)
    if as_json:
        print(json.dumps(summary, indent=1))
        return
    for step, text in all_warnings({"warnings": summary["warnings"]}):
        say(f"warning ({step}): {text}", always=True)
