"""Folders in the DiLiGenT layout."""

import numpy as np
import pytest

from capture.session.session import load_session
from scene.errors import SessionError
from scene.files import write_png


def diligent(folder, count=3):
    for i in range(count):
        write_png(folder / f"{i + 1:03d}.png", np.full((4, 6, 3), 900, np.uint16))
    write_png(folder / "mask.png", np.ones((4, 6), bool))
    (folder / "filenames.txt").write_text("".join(f"{i + 1:03d}.png\n" for i in range(count)))
    for name in ("light_directions.txt", "light_intensities.txt"):
        (folder / name).write_text("0 0 1\n" * count)
    (folder / "normal.txt").write_text("")


def test_a_diligent_folder_is_a_session(tmp_path):
    diligent(tmp_path)
    session = load_session(tmp_path)
    assert session.layout == "diligent"
    assert session.names == ("001", "002", "003")
    assert session.lights_file == tmp_path / "light_directions.txt"
    assert session.photographed == 3
    assert (session.mask, session.normals) == (tmp_path / "mask.png", tmp_path / "normal.txt")
    assert session.encoding == "linear"


def test_a_diligent_folder_with_gaps(tmp_path):
    diligent(tmp_path)
    (tmp_path / "002.png").unlink()
    (tmp_path / "light_intensities.txt").unlink()
    (tmp_path / "light_directions.txt").write_text("0 0 1\n")
    with pytest.raises(SessionError) as caught:
        load_session(tmp_path)
    for part in ("002.png is not in", "light_intensities.txt: missing", "txt: found 1 rows, expected 3", "3 faults"):
        assert part in str(caught.value)
