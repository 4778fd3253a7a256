"""`rgbn plan`: the set-up read or put together, the flashes chosen, plan.json and plan.html written."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scene.errors import SceneError
from shoot.plan.plan_options import CameraOptions, ObjectOptions, ShootOptions

if TYPE_CHECKING:
    from scene.spheres import Kind

EVEN = (4, 6, 8, 12, 16, 24, 36, 48, 60)
"""Flashes of the even arrangements that are told for comparison."""
GOOD_PX = 60.0
"""Radius of balls that are found surely: docs/guide/shoot.md."""
LIGHTS_SHARE, USUAL_LIGHTS_DEG = 0.5, 0.05
"""Of the wanted accuracy, that the lights may take; and what is wanted of the lights without one."""
PLAN = "plan"


def run_plan(
    source: Path | None,
    flashes: int,
    *,
    thing: ObjectOptions,
    camera: CameraOptions,
    shoot: ShootOptions,
    out: Path | None = None,
) -> dict[str, Any]:
    """Plan a shoot; write plan.json and plan.html into the output folder, and return the first.

    Parameters
    ----------
    source : Path or None
        A scan; a session or an output folder, whose flashes so far count; None: a simple shape.
    flashes : int
        In all.
    thing, camera, shoot
        What `source` does not tell.
    out : Path, optional
        Default: a session's own; out/NAME by the scan's or the shape's name.

    Raises
    ------
    SceneError
        An option or the source is at fault.
    """
    for options in (thing, camera):
        options.check()
    shoot.check(flashes)
    with _opened(source, thing, camera, out) as (record, under_way, set_up):
        from scene.files import write_json, write_text
        from shoot.plan.plan_page import plan_page

        facts = _planned(under_way, set_up, flashes, shoot)
        name = f"{thing.shape} of {thing.size_mm:g} mm" if source is None else source.resolve().stem
        facts |= {"name": name, "source": None if source is None else str(source)}
        with record.part_of(PLAN):
            write_json(record.folder / "plan.json", facts)
            write_text(record.folder / "plan.html", plan_page(facts))
        return facts | {"folder": str(record.folder)}


@contextmanager
def _opened(source: Path | None, thing: ObjectOptions, camera: CameraOptions, out: Path | None) -> Iterator[Any]:
    """Yield the output folder's record, and either what there is of a session or the set-up of a new one."""
    from lab.run import open_job
    from lab.session_place import is_output, is_session
    from scene.origin import Origin
    from scene.output_folder import open_record, own_folder

    if source is not None and (source.is_dir() or is_output(source) or source.suffix == ".toml"):
        from shoot.plan.under_way import session_so_far

        if source.is_dir() and not (is_session(source) or is_output(source)):
            raise SceneError(
                f"{source}: a folder without session.toml. Give the scan itself; or rgbn init {source}, if it holds a "
                "session's photographs."
            )
        with open_job(source, out=out) as job:
            yield job.record, session_so_far(job, thing.gloss), None
        return
    set_up = _new_set_up(source, thing, camera)
    usual, origin = Path("out") / f"plan-{thing.shape}", "plan"
    if source is not None:
        origin = Origin("scan", source.resolve())
        usual = own_folder(Path("out") / f"plan-{source.stem}", origin)
    with open_record(out or usual, origin=origin, inputs=[] if source is None else [source]) as record:
        yield record, None, set_up


def _new_set_up(source: Path | None, thing: ObjectOptions, camera: CameraOptions) -> Any:
    from shoot.plan.set_up import SetUp, before_camera, simple_shape, usual_camera
    from twin.camera.virtual_camera import Sensor

    if source is None:
        mesh, told = simple_shape(thing.shape, thing.size_mm), f"object: a {thing.shape} of {thing.size_mm:g} mm"
    else:
        from align.scan.mended_scan import SUFFIXES, load_scan

        if not source.exists():
            raise SceneError(f"{source}: there is no such scan or session.")
        unit = thing.unit or "unknown"
        if unit == "unknown" and source.suffix.lower() in SUFFIXES:
            raise SceneError(f"{source}: a scan's file does not tell its unit. Give it: --unit mm (or cm, m, inch).")
        mesh = load_scan(source, unit)
        told = f"object: {source.name}, {len(mesh.faces):,} faces, {thing.seen_from} toward the camera"
    lens = usual_camera(camera.focal_mm, camera.sensor_mm, camera.pixels)
    mesh, where = before_camera(mesh, lens, camera.distance_mm, thing.seen_from)
    lens_told = f"camera: {camera.focal_mm:g} mm on {camera.sensor_mm:g} mm, {lens.width} x {lens.height} px"
    noise_told = f"noise of a usual sensor at ISO {camera.iso:g}"
    said = (told, f"{lens_told}; {where}", noise_told)
    return SetUp(lens, mesh, replace(Sensor(), iso=camera.iso), thing.gloss, thing.albedo, said=said)


def _planned(under_way: Any, set_up: Any, flashes: int, shoot: ShootOptions) -> dict[str, Any]:
    from shoot.plan.ball_places import ball_choices, stand_balls
    from shoot.plan.flash_places import Reach
    from shoot.plan.flash_samples import pixels_of
    from shoot.plan.plan_facts import plan_facts
    from shoot.plan.shoot_plan import even_arrangement, plan_shoot

    reach = Reach(shoot.layout, shoot.from_deg, shoot.to_deg, shoot.flash_mm, shoot.azimuths_deg)
    choices = []
    if under_way is not None:
        pixels, spheres, reach = under_way.pixels, under_way.spheres, under_way.within(reach)
        flashes = max(flashes, len(under_way.lights))
    else:
        pixels = pixels_of(set_up)
        positions = reach.positions(set_up.middle_mm, set_up.size_mm)
        if shoot.chrome or shoot.white:
            kinds: list[tuple[Kind, float]] = [
                *(("chrome", one) for one in shoot.chrome),
                *(("white", one) for one in shoot.white),
            ]
            spheres = stand_balls(set_up, positions, kinds)
        else:
            choices = ball_choices(set_up, positions[::3])
            spheres = stand_balls(set_up, positions, _best_choice(choices, shoot.accuracy_deg))
    how = {"accuracy_deg": shoot.accuracy_deg, "so_far": under_way}
    plan = plan_shoot(pixels, spheres, reach, flashes, **how)
    while plan.flashes < plan.count:
        # Fewer are enough: the best set of so many, which may need still fewer.
        plan = plan_shoot(pixels, spheres, reach, plan.flashes, **how)
    counts = [count for count in EVEN if count <= len(plan.positions_mm)]
    even = {} if under_way is not None else {n: even_arrangement(pixels, spheres, reach, n) for n in counts}
    return plan_facts(plan, even, choices, shoot.accuracy_deg)


def _best_choice(choices: list[Any], accuracy_deg: float | None) -> list[Any]:
    """Return the kinds and diameters of the fewest, smallest balls that suffice, three of chrome if they fit in."""
    if not choices:
        raise SceneError(
            "balls: no usual ball of 20 px in radius or more has room in the picture beside the object. Take a greater "
            "--distance-mm, a longer lens, or say which balls there are: --chrome MM --white MM."
        )
    wanted = USUAL_LIGHTS_DEG if accuracy_deg is None else LIGHTS_SHARE * accuracy_deg
    good = [one for one in choices if one.direction_sigma_deg <= wanted and one.radius_px >= GOOD_PX and one.count >= 3]
    best = good[0] if good else min(choices, key=lambda one: one.direction_sigma_deg)
    return [*[("chrome", best.diameter_mm)] * best.count, ("white", best.diameter_mm)]
