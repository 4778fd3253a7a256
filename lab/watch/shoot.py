"""A shoot under way: each new photograph judged with all before it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from capture.survey.small_pictures import frames_of
from lab.init.answers import Asking
from lab.watch.judge import FramesSoFar, Told
from lab.watch.lights_so_far import LightsSoFar
from lab.watch.normals_so_far import Known, NormalsSoFar
from lab.watch.shots import Shot, Sorted, sort_shots
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights


@dataclass(frozen=True)
class Verdict:
    """What is said of a photograph.

    Parameters
    ----------
    name : str
        Its file.
    role : str
        flash, ambient, dark, flat, board, chrome, white, or left out.
    warnings : tuple of str
        What is new with it.
    light : dict or None
        Its row of `Lights.facts`, where balls tell it by now.
    seconds : float
        From when it was found whole to here.
    """

    name: str
    role: str
    warnings: tuple[str, ...]
    light: dict[str, Any] | None = None
    seconds: float = 0.0


class Shoot:
    """The photographs taken so far and what is known by them.

    Parameters
    ----------
    folder : Path
    asking : Asking
        What `init` is told of camera and balls; silent.
    """

    def __init__(self, folder: Path, asking: Asking) -> None:
        self.folder = folder
        self._shots: dict[str, Shot] = {}
        self._frames = FramesSoFar(folder)
        self._told = Told()
        self.lights_so_far = LightsSoFar(asking)
        self._normals = NormalsSoFar()
        self.sorted = Sorted()
        self.known: Known | None = None
        self._stack: Frames | None = None
        self.verdicts: list[Verdict] = []

    @property
    def shots(self) -> list[Shot]:
        """All photographs that count."""
        return list(self._shots.values())

    @property
    def lights(self) -> Lights | None:
        """The lights so far."""
        found = self.lights_so_far.found
        return found.lights if found else None

    @property
    def why_no_normals(self) -> str:
        """Why nothing is said of the normals yet."""
        return self._normals.why

    def take_back(self, digests: set[str]) -> None:
        """Leave out photographs that count no more: others stand in their place."""
        for digest in digests & set(self._shots):
            del self._shots[digest]

    def rename(self, digest: str, path: Path) -> None:
        """Note that a photograph has another name now."""
        shot = self._shots[digest]
        self._shots[digest] = replace(shot, path=path, small=replace(shot.small, path=path))

    def add(self, shots: Sequence[Shot], start: float) -> list[Verdict]:
        """Judge new photographs, all at once, and return what is to be said of each; `start`: when they came."""
        self._shots |= {shot.digest: shot for shot in shots}
        self.sorted = sort_shots(self.shots, self.folder)
        flash, ambient = self.sorted.flash, self.sorted.ambient
        said: list[str] = []
        if flash:
            self._stack, said = self._frames.frames(flash, ambient)
            said += self._frames.warnings(self._stack, flash, ambient)
            self.lights_so_far.update(self._stack, [shot.exif for shot in flash])
            said += self.lights_so_far.warnings
        paths = {shot.path.stem: shot.digest for shot in self.shots}
        fresh = self._told.new(said, paths)
        rows = {row["name"]: row for row in self.lights.facts()["frames"]} if self.lights else {}
        verdicts = []
        for shot in shots:
            name = self._frame_name(shot)
            own = self._told.new([self.sorted.told[shot.digest]], paths) if shot.digest in self.sorted.told else []
            own = [f"{shot.path.stem}: {text}" for text in own]
            mine = [text for text in fresh if name in text]
            fresh = [text for text in fresh if text not in mine]
            seconds = time.monotonic() - start
            verdicts.append(Verdict(shot.name, self._role(shot), (*own, *mine), rows.get(name), seconds))
        if fresh and verdicts:
            last = verdicts[-1]
            verdicts[-1] = replace(last, warnings=(*last.warnings, *fresh))
        self.verdicts += verdicts
        return verdicts

    def think(self) -> list[str]:
        """Do what takes seconds, while no photograph waits: balls, the object, its sigma; return new warnings."""
        flash = self.sorted.flash
        if self._stack is None or not flash:
            return []
        exif = [shot.exif for shot in flash]
        lights = self.lights_so_far
        if lights.is_due(len(flash)):
            lights.find_balls(self._stack, exif)
            said = list(lights.warnings)
            lights.update(self._stack, exif)
            return self._told.new([*said, *lights.warnings], [shot.path.stem for shot in self.shots])
        return []

    def look_at_object(self) -> None:
        """Bring what is known of the normals up to date; seconds where the object is looked for anew."""
        found, flash = self.lights_so_far.found, self.sorted.flash
        if found is None or found.camera is None or self._stack is None:
            return
        chosen = [shot for shot, name in zip(flash, self._stack.names, strict=True) if name in set(found.lights.names)]
        small = frames_of([shot.small for shot in chosen], [shot.small for shot in self.sorted.ambient])
        small = replace(small, names=found.lights.names)
        step = chosen[0].small.step
        camera = _reduced(found.camera, small, step)
        balls = [
            replace(one, center_px=(one.center_px + 0.5) / step - 0.5, radius_px=one.radius_px / step)
            for one in found.spheres
        ]
        if self._normals.is_due(len(small)):
            self._normals.find_object(small, camera, balls)
        self.known = self._normals.update(small, camera, found.lights)

    def _frame_name(self, shot: Shot) -> str:
        places = [one.digest for one in self.sorted.flash]
        if self._stack is not None and shot.digest in places:
            return self._stack.names[places.index(shot.digest)]
        return shot.path.stem

    def _role(self, shot: Shot) -> str:
        some = {"flash": self.sorted.flash, "ambient": self.sorted.ambient, **self.sorted.others}
        return next((role for role, shots in some.items() if shot in shots), "left out")


def _reduced(camera: Camera, small: Frames, step: int) -> Camera:
    return camera.scaled(small.width, small.height, 1 / step, 1 / step)
