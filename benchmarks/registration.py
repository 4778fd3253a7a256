"""The scan registered, against poses that others set or that are known: sessions and photographs by others, then ours.

Scenes by others lie beside the project (`SHARED`), and in out/scenes, where their generator wrote them:

    python ../shared/tools/blender_session.py out/scenes/blender --first 200 --count 8 --width 660   (needs bpy)
"""

import json
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from align.pose.photographed import Photographs
from align.pose.picks import misses_px, pose_of
from align.pose.register import Registration, register
from align.scan.mended_scan import load_scan
from align.truth import ground_truth
from benchmarks.align_sessions import FAULTS, apart_px, photographs_of, session, shape_names, with_fault
from benchmarks.harness import ROOT, SHARED, Figures, Scale, Table, markdown, opened
from benchmarks.real_surfaces import (
    DILIGENT,
    YCB,
    YCB_NAMES,
    Projection,
    RealObject,
    diligent_object,
    mirrored,
    moved_scan,
    sphere_center,
    ycb_objects,
)
from fixtures.mesh_shapes import NEARLY_SYMMETRIC, OWN_MIRROR_IMAGE, SYMMETRIC
from lab.run import STEPS
from scene.camera import Camera
from scene.clock import now, since
from scene.errors import SceneError
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from solve.solve import solve

FOUND_PX = 2.0
"""A pose whose picture of the scan is within this of the true one's (rms) was found."""
INSIDE = {False: 12.592, True: 11.070}
"""95 % quantile of chi-square with 6 degrees of freedom; of an orthographic camera, which tells no depth, with 5."""
OWN = "its own"
SIZE = {"width": 600, "height": 400, "flashes": 12, "faces": 20_000}
ORIENTATIONS = 5
SESSIONS, PHOTOGRAPHS, SHAPES = "others' sessions", "others' photographs", "our shapes"
PICKS, TRIALS = 8, 200


@dataclass(frozen=True)
class PoseRow:
    """One scan on one session's photographs; None: not known, or refused.

    `apart_px`: rms distance of the scan's pictures at our pose and at the given one; of a ball, whose turn cannot be
    known, of its centre's. `truth_deg`, `truth_at_given_deg`: median error of the ground truth at the two poses.
    `processor_s`: of the registration; of a session by others, of the whole step.
    """

    group: str
    name: str
    scan: str
    refused: str
    warnings: tuple[str, ...]
    ambiguous: bool
    apart_px: float | None = None
    turn_deg: float | None = None
    sigma_deg: float | None = None
    is_inside: bool | None = None
    truth_deg: float | None = None
    truth_at_given_deg: float | None = None
    under_two_sigma: float | None = None
    processor_s: float | None = None

    @property
    def is_found(self) -> bool:
        return self.apart_px is not None and self.apart_px < FOUND_PX

    @property
    def came(self) -> str:
        """What was said."""
        return (
            f"refused: {_short(self.refused)}" if self.refused else "; ".join(map(_short, self.warnings)) or "nothing"
        )

    @property
    def is_silent(self) -> bool:
        """Wrong, and nothing was said."""
        is_right = self.is_found and self.scan == OWN
        return not (is_right or self.refused or self.ambiguous or (self.warnings and self.scan != OWN))


def _short(text: str) -> str:
    """Return the first words of a message, up to its first colon after the field's name."""
    return text.removeprefix("scan: ").split(":")[0].split(" (")[0].split(" in the photographs all round")[0]


def _session(group: str, folder: str, place: str) -> list[PoseRow]:
    """Align a session by others as its user would."""
    scene = Path(folder)
    said = json.loads((scene / "truth.json").read_text())
    with tempfile.TemporaryDirectory() as out, opened(scene / place, Path(out)) as job:
        job.run(STEPS, "calibrate")
        start = now()
        try:
            job.run(STEPS, "align")
        except SceneError as error:
            return [PoseRow(group, scene.name, OWN, str(error), (), False)]
        spent = since(start)["processor_seconds"]
        store, warnings = job.store, tuple(job.done["align"]["warnings"])
        pose, true, camera = store.load_pose(), Pose(np.array(said["camera_from_scan"])), store.load_camera()
        error = None
        if (scene / "truth.npz").is_file():
            exact = np.load(scene / "truth.npz")["normals"]
            error = float(np.nanmedian(angular_error_deg(store.load_normals("truth"), exact)))
        scan = load_scan(job.session.scan, job.session.scan_unit)
        return [
            PoseRow(
                group, scene.name, OWN, "", warnings, any("two poses" in text for text in warnings),
                apart_px(camera, scan, pose, true), (pose @ true.inverse()).angle_deg(),
                store.read_json("pose.json")["sigma_deg"], truth_deg=error, processor_s=spent,
            )
        ]  # fmt: skip


def register_on(
    photographs: Photographs, normals: Any, scan: Mesh, pose: Pose, *, is_ball: bool = False, from_there: bool = False
) -> dict:
    """Register a scan as its user would; return the fields of `PoseRow` that the pose alone tells, and `found`.

    from_there: it is sought from the given pose on.
    """
    start = now()
    try:
        found = register(scan, photographs, normals, start=pose if from_there else None)
    except SceneError as error:
        return {"refused": str(error), "warnings": (), "ambiguous": False}
    spent, camera = since(start)["processor_seconds"], photographs.camera
    off, middle = found.pose @ pose.inverse(), pose.apply(scan.center_mm)
    twist = np.concatenate([Rotation.from_matrix(off.rotation).as_rotvec(), off.apply(middle) - middle])
    if camera.is_orthographic:
        twist[5] = 0.0
    square = twist @ np.linalg.pinv(found.covariance, rcond=1e-14, hermitian=True) @ twist
    center = sphere_center(scan.vertices)[None]
    return {
        "refused": "", "warnings": tuple(found.warnings),
        "ambiguous": any("nearly symmetric" in text for text in found.warnings),
        "apart_px": apart_px(camera, Mesh(center, scan.faces[:0]) if is_ball else scan, found.pose, pose),
        "turn_deg": None if is_ball else off.angle_deg(), "sigma_deg": None if is_ball else found.sigma_deg,
        "is_inside": None if is_ball else bool(square < INSIDE[camera.is_orthographic]), "processor_s": spent,
        "found": found,
    }  # fmt: skip


def _truth(found: Registration | None, pose: Pose, scan: Mesh, camera: Camera, exact: Any) -> dict:
    """Return the errors of the ground truth at the pose found, and at the given one."""
    if found is None:
        return {}
    ours = ground_truth(scan, found.pose, camera, covariance=found.covariance)
    error = angular_error_deg(ours.normals, exact)
    known = np.isfinite(error) & np.isfinite(ours.sigma_deg)
    at_given = angular_error_deg(ground_truth(scan, pose, camera).normals, exact)
    return {
        "truth_deg": float(np.median(error[known])), "truth_at_given_deg": float(np.nanmedian(at_given)),
        "under_two_sigma": float(np.mean(error[known] < 2 * ours.sigma_deg[known])),
    }  # fmt: skip


def surface_of(made: RealObject, name: str, projection: Projection, scan: str) -> Mesh:
    """Return a surface for a real object: its own, or one that must be refused."""
    if scan == "its own, mirrored":
        return mirrored(made.surface)
    if scan == "its own, a fifth wider":
        return Mesh(made.surface.vertices * [1.2, 1.0, 1.0], made.surface.faces)
    other = "ball" if name == "cat" else "cat"
    return made.surface if scan == OWN else diligent_object(other, projection, shots=1).surface


def _photographs(group: str, name: str, projection: Projection, scan: str, shots: int) -> list[PoseRow]:
    """Register a surface, turned anyhow, on DiLiGenT's photographs, with the set's mask and lights."""
    made = diligent_object(name, projection, shots=shots)
    surface, pose = moved_scan(surface_of(made, name, projection, scan), 1)
    normals = solve("iterative", made.frames, made.lights, made.camera, made.mask).normals
    photographs = Photographs(made.camera, made.frames, made.lights, made.mask)
    told = register_on(photographs, normals, surface, pose, is_ball=name == "ball")
    more = _truth(told.pop("found", None), pose, surface, made.camera, made.normals)
    return [PoseRow(group, f"{name}, {projection}", scan, **told, **more)]


def _shape(
    group: str, name: str, scan: str, seed: int, size: Sequence[tuple[str, int]], from_there: bool = False
) -> list[PoseRow]:
    """Register a shape of ours; `scan`: its own, or a fault."""
    made = session(name, seed, **dict(size))
    made = made if scan == OWN else with_fault(made, name, scan)
    try:
        photographs, normals = photographs_of(made)
    except SceneError as error:
        return [PoseRow(group, name, scan, str(error), (), False)]
    told = register_on(photographs, normals, made.scan, made.pose, from_there=from_there)
    found, camera = told.pop("found", None), made.scene.camera
    exact = ground_truth(made.scene.mesh, made.scene.pose, camera).normals if scan == OWN and found else None
    more = {} if exact is None else _truth(found, made.pose, made.scan, camera, exact)
    return [PoseRow(group, name, scan, **told, **more)]


def _measured(group: str, *case: Any) -> list[PoseRow]:
    measure = {SESSIONS: _session, PHOTOGRAPHS: _photographs, SHAPES: _shape}[group]
    return measure(group, *case)


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(SHAPES, "coarse", OWN, 0, (("width", 200), ("height", 140), ("flashes", 6), ("faces", 9000)), True)]
    others: list[tuple] = []
    for folder in (SHARED / "sessions", ROOT / "out" / "scenes" / "blender"):
        scenes = [truth.parent for truth in sorted(folder.glob("*/truth.json"))]
        others += [(SESSIONS, str(one), "whole" if (one / "whole").is_dir() else "") for one in scenes]
    names, size = shape_names(), tuple(SIZE.items())
    right = [(SHAPES, name, OWN, seed, size) for seed in range(ORIENTATIONS) for name in names]
    wrong = [
        (SHAPES, name, fault, 200, size)
        for fault in FAULTS
        for name in [name for name in names if fault != "mirrored" or name not in OWN_MIRROR_IMAGE][::3]
    ]
    if scale == "gates":
        others = [one for one in others if one[1].endswith(("blender_0", "bunny"))]
        return [*others, *_real_cases(24)[:1], *right[2:5:2], *wrong[5:6]]
    return [*others, *_real_cases(96), *right, *wrong]


def _real_cases(shots: int) -> list[tuple]:
    """Return right surfaces on so many photographs, and wrong ones on 24."""
    both: tuple[Projection, ...] = ("perspective", "orthographic")
    right = [(name, way, OWN, shots) for name in ("cat", "ball") for way in both]
    wrong = [("cat", way, scan, 24) for scan in ("the ball's", "its own, mirrored") for way in both]
    wrong += [("cat", both[0], "its own, a fifth wider", 24), ("ball", both[0], "the cat's", 24)]
    return [(PHOTOGRAPHS, *one) for one in [*right, *wrong]] if DILIGENT.is_dir() else []


def _summary(rows: Sequence[PoseRow]) -> dict[str, Any]:
    """Return counts, and medians over what was found; of a symmetric shape, whose turn is nobody's, over all."""
    good = [row for row in rows if row.is_found or (row.name in SYMMETRIC and not row.refused)]
    found: dict[str, Any] = {
        "sessions": len(rows), "found": sum(row.is_found for row in rows),
        "ambiguous": sum(row.ambiguous for row in rows), "refused": sum(bool(row.refused) for row in rows),
        "warned": sum(bool(row.warnings) for row in rows), "silent": sum(row.is_silent for row in rows),
    }  # fmt: skip
    for key in ("apart_px", "turn_deg", "truth_deg", "truth_at_given_deg", "under_two_sigma", "processor_s"):
        known = [value for row in good if (value := getattr(row, key)) is not None]
        found[key] = float(np.median(known)) if known else None
    inside = [row.is_inside for row in good if row.is_inside is not None and row.name not in SYMMETRIC]
    return found | {"inside": float(np.mean(inside)) if inside else None}


def _grouped(rows: Iterable[PoseRow], name_of: Callable[[PoseRow], str]) -> dict[str, list[PoseRow]]:
    groups: dict[str, list[PoseRow]] = {}
    for row in rows:
        groups.setdefault(name_of(row), []).append(row)
    return groups


def _shown(rows: Sequence[PoseRow]) -> str:
    ours, wrong = ([row for row in rows if row.group == SHAPES and (row.scan == OWN) == own] for own in (True, False))
    words = {True: "yes", False: "no", None: ""}
    others = [{**vars(row), "came": row.came, "inside": words[row.is_inside]} for row in rows if row.group != SHAPES]
    kinds: dict[str, str] = {
        **dict.fromkeys(SYMMETRIC, "symmetric"),
        **dict.fromkeys(NEARLY_SYMMETRIC, "nearly symmetric"),
    }
    shapes = _grouped(ours, lambda row: row.name)
    shapes["**all but the symmetric**"] = [row for row in ours if row.name not in SYMMETRIC]
    tables = (
        (
            {
                "photographs by others": "{name}", "scan": "{scan}", "pose off": "{apart_px:.2f} px",
                "turned": "{turn_deg:.2f}°", "stated sigma": "{sigma_deg:.2f}°", "in the 95 % region": "{inside}",
                "ground truth off": "{truth_deg:.2f}°", "at the given pose": "{truth_at_given_deg:.2f}°",
                "said": "{came}", "processor, s": "{processor_s:.0f}",
            },
            others,
        ),
        (
            {
                "our shapes": "{name}", "": "{kind}", "sessions": "{sessions}", "found": "{found}",
                "said to be ambiguous": "{ambiguous}", "refused": "{refused}", "wrong, and not said": "{silent}",
                "pose off": "{apart_px:.2f} px", "turned": "{turn_deg:.2f}°", "in the 95 % region": "{inside:.0%}",
                "ground truth off": "{truth_deg:.2f}°", "at the true pose": "{truth_at_given_deg:.2f}°",
                "under 2 sigma": "{under_two_sigma:.0%}", "processor, s": "{processor_s:.0f}",
            },
            [{"name": name, "kind": kinds.get(name, ""), **_summary(some)} for name, some in shapes.items() if some],
        ),
        (
            {
                "our shapes, wrong scan": "{scan}", "sessions": "{sessions}", "refused": "{refused}",
                "warned of": "{warned}", "accepted in silence": "{silent}",
            },
            [{"scan": scan, **_summary(some)} for scan, some in _grouped(wrong, lambda row: row.scan).items()],
        ),
    )  # fmt: skip
    return "\n".join(markdown(columns, lines) for columns, lines in tables if lines)


def _figures(rows: Sequence[PoseRow]) -> Figures:
    kept = ("sessions", "found", "refused", "silent", "apart_px", "turn_deg", "inside", "truth_deg", "under_two_sigma")
    groups = _grouped(
        [row for row in rows if row.name not in SYMMETRIC],
        lambda row: row.group if row.scan == OWN else f"{row.group}, wrong scans",
    )
    summaries = {name: _summary(some) for name, some in groups.items()}
    return {
        f"{name}: {key}": float(one[key]) for name, one in summaries.items() for key in kept if one[key] is not None
    }


@dataclass(frozen=True)
class PickRow:
    """The pose from picked points of one object: medians over trials, against the set's own pose."""

    object: str
    picks_off_px: float
    turn_deg: float
    shift_mm: float
    apart_px: float


def _picked(name: str, noise_px: float, trials: int) -> list[PickRow]:
    made = next(one for one in ycb_objects() if one.name == name)
    generator, (rows, columns), found = np.random.default_rng(1), np.nonzero(made.label), []
    center, radius = made.points.mean(0), float(np.ptp(made.points, axis=0).max() / 2)
    for _ in range(trials):
        chosen = generator.choice(len(rows), PICKS, replace=False)
        points = made.seen[rows[chosen], columns[chosen]]
        pixels = np.stack([columns, rows], -1)[chosen] + noise_px * generator.standard_normal((PICKS, 2))
        pose = pose_of(made.camera, points, pixels, radius, center)
        assert pose is not None
        misses = misses_px(pose, made.camera, made.points, made.camera.project(made.pose.apply(made.points)))
        shift = np.linalg.norm(pose.apply(center) - made.pose.apply(center))
        found.append(((pose @ made.pose.inverse()).angle_deg(), shift, np.sqrt(np.mean(misses**2))))
    return [PickRow(name, noise_px, *map(float, np.median(found, axis=0)))]


TABLES = (
    Table("registration", "poses", ("lab.run",), PoseRow, _cases, _measured, _shown, _figures),
    Table(
        "registration", "picks", ("align.pose.picks",), PickRow,
        lambda scale: [
            (name, noise, 5 if scale == "small" else TRIALS)
            for name in list(YCB_NAMES.values())[: 1 if scale == "small" else None]
            for noise in (0.5, 2.0)
        ],
        _picked,
        lambda rows: markdown(
            {
                "object": "{object}", "picks off": "{picks_off_px:g} px", "turned": "{turn_deg:.2f}°",
                "its middle off": "{shift_mm:.1f} mm", "pose off": "{apart_px:.2f} px",
            },
            rows,
        ),
        lambda rows: {f"{row.object}, picks {row.picks_off_px:g} px off: apart_px": row.apart_px for row in rows},
        needs=(YCB,),
    ),
)  # fmt: skip
