"""The synthetic counterpart of a setup: the object alone, as the recipe has it, solved with the true lights."""

import numpy as np

from experiments.counterparts.captures import exposed, object_maps, standing, whole
from experiments.counterparts.four_experiments import METHODS, Setup
from experiments.counterparts.scenes import object_scene
from scene.frames import Frames
from scene.store import Store
from twin.camera.virtual_camera import Sensor

PATHS = 64


def write_rendering(folder: Store, setup: Setup, name: str) -> None:
    """Render a setup's object, photograph it by a sensor of its ISO, and solve it.

    Parameters
    ----------
    folder : Store
        Gets a session with its true lights, and normals/, as a session's twin/ has.
    setup : Setup
    name : str
    """
    from capture.photographs.decode import decode
    from capture.session.session import load_session
    from solve.solve import solve
    from twin.twin_session import Shooting, write_session

    scene = object_scene(setup)
    mask, truth = object_maps(setup)
    images = whole(scene, "direct" if scene.sampling.max_depth == 2 else "many", PATHS)
    if setup.ambient:
        images += np.float32(setup.ambient) * standing(scene)
    frames = Frames.from_linear(scene.lights.names, exposed(images, mask))
    # Neither lens nor colour filter: what the recipe says is the noise.
    sensor = Sensor(iso=setup.iso, cfa="none", blur_px=0.0)
    lights = scene.lights.normalised()
    path = write_session(
        folder, frames, scene.camera, lights, mask, truth, shooting=Shooting(sensor, seed=setup.seed), name=name
    )
    session = load_session(path)
    taken, _ = decode(session, folder)
    folder.save_camera(scene.camera)
    for method in METHODS:
        folder.save_estimate(solve(method, taken, lights, scene.camera, mask))
