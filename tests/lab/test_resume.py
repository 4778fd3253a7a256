"""What a step makes does not depend on how often it was begun."""

import numpy as np

from scene.lights import Lights
from scene.store import Store
from tests.lab.test_foreign_files import make_session


def test_lights_that_are_moved_to_the_object_are_moved_once(tmp_path, run_rgbn):
    """A run that was killed after it had written them moved them again: other last digits."""
    session, out = tmp_path / "session", tmp_path / "out"
    make_session(session)
    positions = np.random.default_rng(10_003).uniform([-300, -300, -100], [300, 300, 300], (4, 3))
    reference = np.array([7.0, -3.0, -800.0])
    away = positions - reference
    lights = Lights(
        tuple(f"flash_{i}" for i in range(4)),
        away / np.linalg.norm(away, axis=1, keepdims=True),
        np.random.default_rng(10_004).uniform(0.6, 1.4, (4, 3)),
        positions,
        reference,
    )
    Store(session / "known").save_lights_json(lights)
    text = (session / "session.toml").read_text().replace("known/lights.lp", "known/lights.json")
    camera = "[camera]\nwidth = 32\nheight = 24\nfx = 40.0\nfy = 40.0\ncx = 15.5\ncy = 11.5\n"
    (session / "session.toml").write_text(text + camera)

    def aligned():
        assert run_rgbn("align", session, "--out", out)[0] == 0
        return (out / "lights.json").read_bytes()

    first = aligned()
    assert not np.allclose(Store(out).load_lights().reference_point_mm, reference), "they were moved"
    for _ in range(3):
        (out / "mask.png").unlink()
        assert aligned() == first
