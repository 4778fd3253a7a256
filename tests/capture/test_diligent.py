"""Folders in the DiLiGenT layout."""

import pytest

from capture.session.session import load_session
from fixtures.bad_input.samples import NAMES, write_layout
from scene.errors import SessionError


def test_a_diligent_folder_is_a_session(tmp_path):
    write_layout(tmp_path)
    session = load_session(tmp_path)
    assert session.layout == "diligent"
    assert session.names == NAMES
    assert session.lights_file == tmp_path / "light_directions.txt"
    assert session.photographed == len(NAMES)
    assert (session.mask, session.normals) == (tmp_path / "mask.png", tmp_path / "normal.txt")
    assert session.encoding == "linear"


def test_a_diligent_folder_with_gaps(tmp_path):
    write_layout(tmp_path)
    (tmp_path / "flash_2.png").unlink()
    (tmp_path / "light_directions.txt").unlink()
    with pytest.raises(SessionError) as caught:
        load_session(tmp_path)
    for part in ("flash_2.png", "light_directions.txt", "2 faults"):
        assert part in str(caught.value)
