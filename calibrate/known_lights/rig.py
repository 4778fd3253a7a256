"""The lamps of a fixed set-up, pooled from several sessions: one more file of lights, with what disagrees named."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Calibration
from calibrate.known_lights.lamp_changes import pooled_lamps
from calibrate.known_lights.measured_lights import MISSING, MeasuredLights, are_sure, of_one_set_up, order_of
from calibrate.known_lights.read_known import NO_INTENSITIES
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.files import write_json
from scene.light_text import lights_json
from scene.lights import Lights
from scene.normals import unit
from scene.reading import json_of, listed

Array = NDArray[np.float64]
WIDE = 2.0  # times their sigmas by which the sessions may disagree on the median lamp without a word
DARK = 0.8  # share of its light from whose loss on a lamp may be dead


@dataclass(frozen=True)
class Rig:
    """The lamps of a set-up.

    Parameters
    ----------
    lights : Lights
        Under the photographs' names, where these are the same in all sessions; else "lamp 1" and so on.
    camera : Camera
        In whose frame they are.
    covariance : (N, 3, 3) float64
        Of the positions, mm^2; of distant lights' unit directions.
    sessions : tuple of str
        Those that were pooled.
    warnings : tuple of str
        What changed from session to session, and which session was left out.
    """

    lights: Lights
    camera: Camera
    covariance: Array
    sessions: tuple[str, ...]
    warnings: tuple[str, ...]

    def write(self, path: str | Path) -> None:
        """Write rig.json: a lights.json that `[lights] file` reads, with covariances, camera, sessions and warnings.

        Raises CalibrationError: its name ends otherwise, or another file than a rig is there.
        """
        path, data, do = Path(path), lights_json(self.lights), "Choose another name with --out."
        if path.suffix != ".json":
            raise CalibrationError(f"{path}: lamps are written as JSON; the name must end in .json. {do}")
        there = json_of(path, error=CalibrationError, do=do) if path.exists() else {"sessions": ()}
        if not isinstance(there, dict) or "sessions" not in there:
            raise CalibrationError(f"{path}: is there already, and holds no lamps of rgbn. {do}")
        name = "position_covariance_mm2" if self.lights.model == "near" else "direction_covariance"
        for row, own in zip(data["frames"], self.covariance, strict=True):
            row[name] = own
        own = {"camera": asdict(self.camera), "sessions": self.sessions, "warnings": self.warnings}
        write_json(path, data | own)


def rig(folders: Sequence[str | Path]) -> Rig:
    """Pool the lights of output folders of one set-up, whose camera and lamps stayed while objects and balls changed.

    Parameters
    ----------
    folders : sequence of str or Path
        Output folders of `calibrate` or `process`, in the order in which they were photographed: it tells a drift.

    Raises
    ------
    SceneError
        Fewer than two sessions agree, or a folder has no lights of its own, or those of another folder.

    Examples
    --------
    >>> rgbn.rig(["out/vase", "out/bowl", "out/tile"]).write("rig.json")
    """
    sessions = [MeasuredLights.read(folder) for folder in folders]
    for one, other in combinations(sessions, 2):
        if np.array_equal(one.vectors, other.vectors):
            raise CalibrationError(
                f"{other.name}: its lights are those of {one.name}: the same photographs, which tell nothing twice. "
                "Leave this folder out."
            )
    found = pool_sessions(sessions)
    lacking = [name for name, s in zip(found.lights.names, found.lights.intensity_sigma, strict=True) if np.isnan(s)]
    said = f"{listed(lacking)}: of unknown strength: no session has a white ball that shows it."
    return replace(found, warnings=(*found.warnings, said)) if lacking else found


def pool_sessions(sessions: Sequence[MeasuredLights]) -> Rig:
    """Pool sessions, see `rig`: lamp by lamp the mean, weighted by the inverse covariances (`pooled_lamps`)."""
    warnings: list[str] = []
    sessions, base = of_one_set_up(sessions, warnings)
    orders = [order_of(base, one) for one in sessions]
    usual, keys = base.lights.names, [one.name for one in sessions]
    is_named = all({*one.lights.names} <= {*usual} for one in sessions)
    names = usual if is_named else tuple(f"lamp {i + 1}" for i in range(len(usual)))
    for one, order in zip(sessions, orders, strict=True):
        other = order[(order != np.arange(len(order))) & (order != MISSING)]
        if MISSING in order:
            lost = listed(names[i] for i in np.flatnonzero(order == MISSING))
            warnings.append(f"{one.name}: no frame shows {lost}: is the lamp dead, or was its frame left out?")
        elif len(other):
            shown, how = listed(one.lights.names[i] for i in sorted(other)), "exchanged" if len(other) == 2 else "mixed"
            warnings.append(f"{one.name}: {shown} are {how}, against {base.name}; matched by place.")

    def of_lamps(rows: Sequence[Array]) -> Array:
        """Return the sessions' rows in the order of the lamps, (S, N, ...), NaN where a session lacks one."""
        gap = [np.full((1, *row.shape[1:]), np.nan) for row in rows]
        return np.stack([np.concatenate(pair)[order] for *pair, order in zip(rows, gap, orders, strict=True)])

    reference = np.mean([one.lights.reference_point_mm for one in sessions], axis=0)
    lights, is_near = [one.lights.seen_from(reference) for one in sessions], base.lights.positions_mm is not None

    def moved(change: Array) -> str:
        size = float(np.linalg.norm(change))
        return f"{size:.3g} mm elsewhere" if is_near else f"{np.rad2deg(size):.2g} degrees elsewhere"

    def dimmed(change: Array) -> str:
        more = 100 * float(np.expm1(change.mean()))
        return f"{abs(more):.2g} % {'brighter' if more > 0 else 'weaker'}{', dead or hidden,' * (more < -100 * DARK)}"

    vectors, covariance = (of_lamps([getattr(one, name) for one in sessions]) for name in ("vectors", "covariance"))
    place, own, kept, wider, flags = pooled_lamps(vectors, covariance, 2 + is_near, keys, moved)
    if (wide := float(np.median(wider))) > WIDE:
        warnings.append(
            f"the sessions disagree on all lamps, {wide:.1f} times as much as their sigmas say; the rig's are as much "
            "wider. Did the camera move, or is a ball's diameter_mm wrong?"
        )
    turn = wider / np.sqrt(np.nansum(kept * of_lamps([one.direction_sigma_deg for one in lights]) ** -2.0, 0))
    levels, sigma = (of_lamps([getattr(one, name) for one in lights]) for name in ("intensities", "intensity_sigma"))
    # What is common to all lamps of a session is its exposure. Three channels are as sure as their mean.
    logs = np.log(levels) - np.nanmedian(np.log(levels / levels[:1]), axis=1, keepdims=True)
    logs[~are_sure(sigma)] = np.nan
    level, spread, *_, more = pooled_lamps(logs, 3 * sigma[..., None, None] ** 2 * np.eye(3), 1, keys, dimmed)
    sigma = np.where(spread[:, 0, 0] > 0, np.sqrt(spread[:, 0, 0] / 3), np.nan)
    unknown = f"the rig {NO_INTENSITIES}" if np.isnan(sigma).all() else "of unknown strength"
    dark = [(unknown,) * bool(lacks) for lacks in np.isnan(sigma)]
    changes = [one + two for one, two in zip(flags, more, strict=True)]
    warnings += [f"{name}: the lamp is {text}." for name, texts in zip(names, changes, strict=True) for text in texts]
    flags = tuple(one + two for one, two in zip(changes, dark, strict=True))
    toward, positions = (unit(place - reference), place) if is_near else (unit(place), None)
    pool = Lights(names, toward, np.exp(level), positions, reference, turn, sigma, flags=flags).normalised()
    return Rig(pool, base.camera, own, tuple(keys), tuple(warnings))


def against_balls(known: Lights, own: Calibration, camera: Camera) -> list[str]:
    """Return what the balls' own lights contradict of known ones: as a rig's second session does of the first."""
    lights, covariance = own.lights, own.position_covariance_mm2
    if known.positions_mm is None or lights.positions_mm is None:
        known = replace(known.seen_from(lights.reference_point_mm), positions_mm=None)
        lights, covariance = replace(lights, positions_mm=None), None
    photographs = MeasuredLights("these photographs", lights, camera, covariance)
    try:
        said = pool_sessions([MeasuredLights("the file", known, camera), photographs]).warnings
    except CalibrationError as error:
        said = (str(error).partition("photographs: ")[2].replace("; left out", ""),)
    do = "It is used as it stands. Put back what was moved, or pool the lights again (rgbn rig)."
    return [f"lights.file: the balls contradict it: {text} {do}" for text in said]
