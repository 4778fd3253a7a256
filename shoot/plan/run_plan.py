"""`rgbn plan`: the set-up read or put together, the flashes chosen, plan.json and plan.html written."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from align.scan.mended_scan import SUFFIXES, load_scan
from lab.run import open_job
from lab.session_place import is_output, is_session
from scene.errors import SceneError
from scene.files import write_json, write_text
from scene.mesh import Mesh
from scene.origin import Origin
from scene.output_folder import open_record, own_folder
from scene.record import Record
from shoot.plan.plan_options import PlanOptions
from shoot.plan.plan_page import plan_facts, plan_page
from shoot.plan.set_up import SetUp, before_camera, corner_balls, lens_camera, pixels_of
from shoot.plan.shoot_plan import ShootPlan, plan_shoot
from shoot.plan.under_way import UnderWay, session_so_far
from twin.camera.virtual_camera import Sensor
from twin.description.object_mesh import built_in

PLAN = "plan"


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
    if source is not None and (source.is_dir() or is_output(source) or source.suffix == ".toml"):
        if source.is_dir() and not (is_session(source) or is_output(source)):
            raise SceneError(
                f"{source}: a folder without session.toml. Give the scan itself; or rgbn init {source}, if it holds a "
                "session's photographs."
            )
        with open_job(source, out=out) as job:
            so_far = session_so_far(job)
            return _written(job.record, plan_shoot(so_far, so_far.within(options)), name, source)
    set_up = _new_set_up(source, options)
    usual, origin = Path("out") / "plan-sphere", "plan"
    if source is not None:
        origin = Origin("scan", source.resolve())
        usual = own_folder(Path("out") / f"plan-{source.stem}", origin)
    with open_record(out or usual, origin=origin, inputs=[] if source is None else [source]) as record:
        begun = UnderWay.begun(pixels_of(set_up), corner_balls(set_up, options.ball_mm))
        return _written(record, plan_shoot(begun, options), name, source)


def _written(record: Record, plan: ShootPlan, name: str, source: Path | None) -> dict[str, Any]:
    facts = plan_facts(plan) | {"name": name, "source": None if source is None else str(source)}
    with record.part_of(PLAN):
        write_json(record.folder / "plan.json", facts)
        write_text(record.folder / "plan.html", plan_page(facts))
    return facts | {"folder": str(record.folder)}


def _new_set_up(source: Path | None, options: PlanOptions) -> SetUp:
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
    mesh, where = before_camera(mesh, lens, options.distance_mm, options.seen_from)
    said = (
        told,
        f"camera: {options.focal_mm:g} mm on {options.sensor_mm:g} mm, {lens.width} x {lens.height} px; {where}",
        f"noise of a usual sensor at ISO {options.iso:g}",
    )
    return SetUp(lens, mesh, replace(Sensor(), iso=options.iso), options.albedo, said=said)
