"""A shoot under way: each new photograph judged with all before it."""

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from capture.audit.part_movement import Part, parts_of
from capture.survey.small_pictures import frames_of
from scene.frames import Frames
from scene.lights import Lights
from shoot.init.answers import Asking
from shoot.watch.judge import FramesSoFar, Told
from shoot.watch.lights_so_far import LightsSoFar
from shoot.watch.normals_so_far import Known, NormalsSoFar
from shoot.watch.shots import Shot, Sorted, sort_shots


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
    seconds : float
        From when it was found whole to here.
    """

    name: str
    role: str
    warnings: tuple[str, ...]
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
            self.lights_so_far.fit_all()

    def rename(self, digest: str, path: Path) -> None:
        """Note that a photograph has another name now."""
        shot = self._shots[digest]
        self.lights_so_far.fit_all()
        self._shots[digest] = replace(shot, path=path, small=replace(shot.small, path=path))

    def add(self, shots: Sequence[Shot], start: float) -> list[Verdict]:
        """Say of new photographs, all at once, what is seen at a glance; `start`: when they came.

        Did the flash fire, exposure, clipping, the same light twice, the numbering. `follow` says the rest.
        """
        self._shots |= {shot.digest: shot for shot in shots}
        self.sorted = sort_shots(self.shots, self.folder)
        flash, ambient = self.sorted.flash, self.sorted.ambient
        said: list[str] = []
        if flash:
            self._stack, said = self._frames.frames(flash, ambient)
            said += self._frames.warnings(self._stack, flash, ambient)
        fresh = self._new(said)
        verdicts = []
        for shot in shots:
            name = self._frame_name(shot)
            own = self._new([self.sorted.told[shot.digest]]) if shot.digest in self.sorted.told else []
            own = [f"{shot.path.stem}: {text}" for text in own]
            mine = [text for text in fresh if name in text]
            fresh = [text for text in fresh if text not in mine]
            verdicts.append(Verdict(shot.name, self._role(shot), (*own, *mine), time.monotonic() - start))
        if fresh and verdicts:
            verdicts[-1] = replace(verdicts[-1], warnings=(*verdicts[-1].warnings, *fresh))
        self.verdicts += verdicts
        return verdicts

    def follow(self) -> Iterator[list[str]]:
        """Say the rest of the photographs so far, part by part: lights, focus and movement, balls; yield new warnings.

        Lights are read from the reduced pictures: `process` reads them from the whole ones, and finer.
        """
        flash, lights = self.sorted.flash, self.lights_so_far
        if self._stack is None or not flash:
            return
        exif = [shot.exif for shot in flash]
        small, step = self._small(), flash[0].small.step
        with ThreadPoolExecutor(1) as beside:
            late = beside.submit(self._frames.late_warnings, self._stack, flash, self._parts())
            if not lights.is_due(len(flash)):
                lights.update(small, exif, step)
                yield self._new(lights.warnings)
            yield self._new(late.result())
        if lights.is_due(len(flash)):
            lights.find_balls(small, exif, step)
            said = list(lights.warnings)
            lights.update(small, exif, step)
            yield self._new([*said, *lights.warnings])

    def look_at_object(self) -> None:
        """Bring what is known of the normals up to date; seconds where the object is looked for anew."""
        found = self.lights_so_far.found
        if not self.sorted.flash or found is None or found.camera is None or self._stack is None:
            return
        named = set(found.lights.names)
        small = self._small().only([i for i, name in enumerate(self._stack.names) if name in named])
        if self._normals.is_due(len(small)):
            self._normals.find_object(small, found.camera, found.spheres)
        self.known = self._normals.update(small, found.camera, found.lights, found.spheres)

    def light_of(self, verdict: Verdict) -> dict[str, Any] | None:
        """Return the row of `Lights.facts` of a photograph; None where its light is not known."""
        shot = next((one for one in self.sorted.flash if one.name == verdict.name), None)
        if shot is None or self.lights is None:
            return None
        name = self._frame_name(shot)
        return next((row for row in self.lights.facts()["frames"] if row["name"] == name), None)

    def _new(self, texts: list[str]) -> list[str]:
        return self._told.new(texts, [shot.path.stem for shot in self.shots])

    def _parts(self) -> list[Part]:
        """Return what may move alone, as far as it is found."""
        found = self.lights_so_far.found
        if found is None or found.camera is None:
            return []
        return parts_of(found.spheres, found.camera, self.sorted.flash[0].small.step)

    def _small(self) -> Frames:
        assert self._stack is not None
        small = frames_of([shot.small for shot in self.sorted.flash], [shot.small for shot in self.sorted.ambient])
        return replace(small, names=self._stack.names, gain=self._stack.gain)

    def _frame_name(self, shot: Shot) -> str:
        places = [one.digest for one in self.sorted.flash]
        if self._stack is not None and shot.digest in places:
            return self._stack.names[places.index(shot.digest)]
        return shot.path.stem

    def _role(self, shot: Shot) -> str:
        some = {"flash": self.sorted.flash, "ambient": self.sorted.ambient, **self.sorted.others}
        return next((role for role, shots in some.items() if shot in shots), "left out")
