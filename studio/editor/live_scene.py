"""A scene kept loaded in Mitsuba: after a change only what changed is loaded again, so that a picture comes at once.

New objects in Mitsuba cost twice: the rays' tree over all triangles, and kernels compiled anew for other counts of
materials. So a material's new numbers are put into the one that is there, and an object's new place into its vertices.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.display_mesh import display_mesh
from studio.editor.edits import start_scene
from twin.description.description import Environment, TwinObject, TwinScene
from twin.description.materials import Material
from twin.description.object_mesh import built_in
from twin.engines.film import Film

Picture = NDArray[np.float32]
SLICES = 4
"""In which a refined picture is rendered: between them another may be drawn."""
ROUGH_SAMPLES = 2
"""A pixel, of the first picture."""


class LiveScene:
    """What is loaded of one scene after the other.

    loads: How often everything had to be loaded: the first time, and when objects come and go.
    """

    def __init__(self) -> None:
        self._loaded: TwinScene | None = None
        self._mitsuba: Any = None
        self._parameters: Any = None
        self.loads = 0

    def picture(self, scene: TwinScene, light: int, *, width: int, height: int) -> Picture:
        """Return the light of one flash that meets one surface, (h, w, 3) linear, at most `width` x `height`.

        A disc is taken for a point, of a mirror nothing is seen, and a large mesh is a coarse one: `refining` shows
        them. The picture has the shape of the camera's. Raises RenderError: the camera sees nothing, or the vectorised
        variant does not run here.
        """
        from twin.engines.many import Many

        coarse = tuple(replace(one, mesh=display_mesh(one.mesh)) for one in scene.objects)
        small = fitted(replace(scene, objects=coarse), width, height)
        small.film()  # Whether the camera sees anything.
        film = whole_film(small)
        self._update(small)
        many = Many(self._mitsuba, film, scene.lights.only([light]), max_depth=2)
        return film.whole(many.band(slice(0, film.size[0]), ROUGH_SAMPLES)[0, 0])

    def _update(self, scene: TwinScene) -> None:
        from twin.engines.variant import import_mitsuba

        mi = import_mitsuba()
        was = self._loaded
        if was is None or not _alike(was, scene) or not self._adopt(mi, was, scene):
            self._load(mi, scene)
        self._loaded = scene

    def _load(self, mi: Any, scene: TwinScene) -> None:
        from twin.engines.mitsuba_scene import mitsuba_scene

        # Let go first: two scenes at a time would be another count of materials.
        self._mitsuba = self._parameters = None
        self._mitsuba = mitsuba_scene(replace(scene, environment=Environment()))
        self._parameters = mi.traverse(self._mitsuba)
        self.loads += 1

    def _adopt(self, mi: Any, was: TwinScene, scene: TwinScene) -> bool:
        """Put what changed into what is loaded; False where that cannot be."""
        shapes = {shape.id(): shape for shape in self._mitsuba.shapes()}
        for index, one in enumerate(scene.objects):
            material = scene.materials[one.material]
            is_same = material is was.materials[one.material]
            if not (is_same or _take_over(mi, shapes[f"object_{index}"].bsdf(), material)):
                return False
        pairs = zip(was.objects, scene.objects, strict=True)
        moved = [index for index, (old, new) in enumerate(pairs) if not np.array_equal(old.matrix, new.matrix)]
        for index in moved:
            now = scene.objects[index].placed
            for name, values in (("positions", now.vertices), ("normals", now.normals)):
                if values is not None:
                    flat = np.ascontiguousarray(values, np.float32).ravel()
                    self._parameters[f"object_{index}.vertex_{name}"] = mi.Float(flat)
        if moved:
            self._parameters.update()
        return True


def _alike(a: TwinScene, b: TwinScene) -> bool:
    """Whether the same meshes, turned out the same side, have materials of the same names and kinds."""
    return len(a.objects) == len(b.objects) and all(
        one.mesh is two.mesh
        and one.material == two.material
        and type(a.materials[one.material]) is type(b.materials[two.material])
        and np.linalg.det(one.matrix[:3, :3]) * np.linalg.det(two.matrix[:3, :3]) > 0
        for one, two in zip(a.objects, b.objects, strict=True)
    )


def _take_over(mi: Any, loaded: Any, material: Material) -> bool:
    """Give a loaded material the numbers and pictures of another; False where they do not fit."""
    import drjit as dr

    now, wanted = mi.traverse(loaded), mi.traverse(_loaded_material(material))
    keys = sorted(wanted.keys())
    if sorted(now.keys()) != keys or any(_shape(now[key]) != _shape(wanted[key]) for key in keys):
        return False
    for key in keys:
        value = wanted[key]
        if not isinstance(value, bool | int | float | str):
            # As data, not as a number in the kernel's code, which would be compiled for each.
            dr.make_opaque(value)
        now[key] = value
    now.update()
    return True


def _loaded_material(material: Material) -> Any:
    from twin.engines.mitsuba_scene import mitsuba_scene

    square = TwinObject("square", built_in("square"), "it", np.eye(4))
    return mitsuba_scene(replace(start_scene(), objects=(square,), materials={"it": material})).shapes()[0].bsdf()


def _shape(value: Any) -> tuple:
    return tuple(getattr(value, "shape", ()))


def fitted(scene: TwinScene, width: int, height: int) -> TwinScene:
    """Return the scene before a camera of at most width x height pixels that sees the same."""
    camera = scene.camera
    scale = min(1.0, width / camera.width, height / camera.height)
    across, down = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    return replace(scene, camera=camera.scaled(across, down, across / camera.width, down / camera.height))


def whole_film(scene: TwinScene) -> Film:
    """Return a film of the camera's whole picture, whatever stands before it: kernels are compiled for its size."""
    camera = scene.camera
    return Film.of_pinhole(camera, slice(0, camera.height), slice(0, camera.width))


def refining(scene: TwinScene, light: int, *, width: int, height: int, samples: int = 16) -> Iterator[Picture | None]:
    """Render everything under one light in slices: interreflection, environment, mirrors, discs, wax.

    samples: Paths a pixel, where any are needed. Yields None after each slice, and the picture in the end. What stock
    Mitsuba must render is one slice. Raises RenderError: the scene is at fault, all faults told.
    """
    from twin.description.description_check import check_scene
    from twin.engines.engine_choice import choose_engine
    from twin.engines.layers import Piece, PieceRenderer, standing_light

    check_scene(scene)
    small = fitted(scene, width, height)
    lit = replace(small, lights=scene.lights.only([light]), radii_mm=scene.radii_mm[[light]])
    film = lit.film()
    engine = choose_engine(lit)[0] if lit.environment.is_dark else "mitsuba"
    renderer, rows = PieceRenderer(lit, film, engine), film.size[0]
    step = rows if engine == "mitsuba" else -(-rows // SLICES)
    bands = []
    for row in range(0, rows, step):
        yield None
        piece = Piece(slice(0, 1), slice(row, min(row + step, rows)))
        bands.append(renderer.render(piece, samples).frames()[0])
    frame, standing = np.concatenate(bands), standing_light(lit, film, engine)
    yield film.whole(np.asarray(frame if standing is None else frame + standing, np.float32))
