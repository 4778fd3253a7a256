"""What the output folder holds to be shown; a part that is missing is None, and nothing breaks."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.facts import by_error, light_rows, method_names, sphere_rows
from compare.report.pictures import Box, Exposure
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.store import Store

Summary = dict[str, Any]


@dataclass(frozen=True)
class Material:
    """What the folder holds to be shown; None where it is not there."""

    store: Store
    frames: Frames | None
    exposure: Exposure | None
    camera: Camera | None
    lights: Summary | None
    directions: NDArray[np.float64] | None
    spheres: list[Summary]
    methods: list[str]
    mask: NDArray[np.bool_] | None

    @classmethod
    def load(cls, store: Store, summary: Summary) -> "Material":
        """Read what the report shows; `summary` may lack any part."""

        def there(load: Callable[[], Any]) -> Any:
            # A part that is missing or that a killed run left unreadable is reported absent, not as a failure.
            with suppress(SceneError):
                return load()
            return None

        compared, exposure = summary.get("compare") or {}, None
        frames, camera, lights = there(store.load_frames), there(store.load_camera), there(store.load_lights)
        mask = there(store.load_mask) if store.path("mask.png").exists() else None
        if frames is not None:
            exposure = Exposure.for_frames(frames, white_value=None if lights is None else lights.white_value)
        return cls(
            store,
            frames,
            exposure,
            camera,
            compared.get("lights") or light_rows(store),
            None if lights is None else lights.directions,
            compared.get("spheres") or sphere_rows(store),
            by_error(compared) if "methods" in compared else method_names(store),
            mask,
        )

    def photograph(self, index: int, box: Box, width: int) -> pictures.Image:
        assert self.frames is not None
        assert self.exposure is not None
        return self.exposure.develop(pictures.thumbnail(self.frames, index, width, box))

    def photographs_of_ball(self, index: int) -> tuple[Frames | None, Exposure | None]:
        """Return the frames that show a ball: the session's, or its own where it was shot apart."""
        apart = [i for i, row in enumerate(self.spheres) if row.get("apart")]
        if index not in apart:
            return self.frames, self.exposure
        folders = sorted(self.store.path("spheres").glob("*/frames"), key=lambda path: int(path.parent.name))
        # Balls that share their photographs share a folder: which is whose is then not known here.
        if len(folders) != len(apart):
            return None, None
        frames = Store(folders[apart.index(index)].parent).load_frames()
        return frames, Exposure.for_frames(frames)

    def map_of(self, place: str, name: str) -> NDArray[np.float32] | None:
        path = self.store.path(place, f"{name}.npy")
        return self.store.read_array(place, f"{name}.npy") if path.exists() else None
