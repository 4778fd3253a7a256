"""A known truth: read whole, or refused in one message."""

import json

import numpy as np
import pytest

from compare.statistics.known_truth import read_truth
from scene.errors import SceneError

ROWS = {
    "object_centre_mm": [0, 0, -700],
    "directions_at_object": [[0, 0, 1], [0.6, 0, 0.8]],
    "relative_intensity_rgb_at_object": [[1, 1, 1], [0.9, 1, 1.1]],
    "camera_from_scan": np.eye(4).tolist(),
    "spheres": [{"kind": "chrome", "centre_px": [3, 4], "radius_px": 5}],
}


def write(folder, **changes):
    (folder / "truth.json").write_text(json.dumps(ROWS | changes))
    arrays = {"light_positions_mm": np.ones((2, 3)), "normals": np.ones((4, 5, 3)), "mask": np.eye(4, 5, dtype=bool)}
    np.savez(folder / "truth.npz", **arrays)


def test_what_is_written_is_read(tmp_path):
    write(tmp_path)
    truth = read_truth(tmp_path)
    assert (truth["object_centre_mm"] == [0, 0, -700]).all()
    assert truth["kinds"].tolist() == ["chrome"]
    assert truth["balls"].tolist() == [[3, 4, 5]]
    assert np.isfinite(truth["normals"]).sum() == 3 * 4


@pytest.mark.parametrize("damage", ["json", "cut", "no balls", "npz", "missing"])
def test_a_damaged_truth_ends_in_one_message_that_names_the_file(tmp_path, damage):
    write(tmp_path, **({"spheres": [{"kind": "chrome"}]} if damage == "no balls" else {}))
    path = tmp_path / ("truth.npz" if damage in ("npz", "missing") else "truth.json")
    if damage == "missing":
        path.unlink()
    elif damage != "no balls":
        path.write_bytes(path.read_bytes()[:100] if damage != "json" else b"{]")
    with pytest.raises(SceneError, match=path.name):
        read_truth(tmp_path)
