"""What `session.toml` accepts, held against the rooms that read it."""

from typing import get_args

import pytest

from capture.session.manifest import SessionObjectTable
from capture.session.resolve import LIGHTS_SUFFIXES, NORMALS_SUFFIXES, SCAN_SUFFIXES


def test_what_is_accepted_is_what_can_be_read(tmp_path):
    """A file or unit that passes here must not be refused after minutes of decoding; nor the other way round."""
    from align.scan.mended_scan import SUFFIXES as SCAN
    from align.scan.mended_scan import UNITS_MM
    from calibrate.known_lights.read_known import read_lights
    from formats.light_files.light_formats import SUFFIXES as LIGHTS
    from formats.normal_maps import SUFFIXES as NORMALS
    from scene.errors import CalibrationError

    assert set(get_args(SessionObjectTable.model_fields["scan_unit"].annotation)) == set(UNITS_MM)
    assert (set(SCAN_SUFFIXES), set(NORMALS_SUFFIXES)) == (set(SCAN), set(NORMALS))
    assert set(LIGHTS_SUFFIXES) == set(LIGHTS)
    for suffix in (*LIGHTS_SUFFIXES, ".csv"):
        path = tmp_path / f"lights{suffix}"
        path.write_text("no lights")
        with pytest.raises(CalibrationError) as caught:
            read_lights(path, ("a",))
        assert ("are not known" in str(caught.value)) == (suffix not in LIGHTS_SUFFIXES)
