"""A shoot under way in the studio: shown while it goes on, renewed by itself, and harmless whatever the file says."""

import json
import time

import numpy as np
import pytest

from scene.files import write_png
from scene.output_folder import open_record
from shoot.watch.status import MAP, STATUS, sigma_picture
from studio.review.review_window import ReviewWindow
from studio.review.shoot_panel import GROUND, LIGHT, NEXT, SIDE_PX, ShootPanel, dome
from studio.workspace import Workspace
from tests.studio.review.conftest import note_steps

FLASH = {"zenith_deg": 45.0, "azimuth_deg": 90.0, "flags": []}
STATE = {
    "is_over": False, "flash": 3, "ambient": 1, "warnings": ["a: <b>moved</b>"], "lights": {"frames": [FLASH]},
    "normals": {
        "sigma_deg_median": 1.5, "share_under_wanted": 0.25, "wanted_deg": 1.0,
        "next_flash": {"zenith_deg": 45.0, "azimuth_deg": 180.0, "sigma_deg": 1.2},
    },
}  # fmt: skip


def near(picture, colour, right, down):
    """Whether a colour stands near a place, in shares of the dome's radius from its middle."""
    reach = 0.46 * SIDE_PX
    row, column = round(SIDE_PX / 2 + down * reach), round(SIDE_PX / 2 + right * reach)
    return bool((picture[row - 4 : row + 5, column - 4 : column + 5] == colour).all(-1).any())


def test_the_dome_is_as_the_camera_sees_it():
    """90 degrees is above, 180 left; a wrong sign puts the light below, or the next one right."""
    picture = dome(STATE)
    assert near(picture, LIGHT, 0, -0.5)
    assert not near(picture, LIGHT, 0, 0.5)
    assert near(picture, NEXT, -0.5, 0)
    assert not near(picture, NEXT, 0.5, 0)


def test_the_map_is_green_where_sigma_is_small_and_red_where_it_is_large():
    small, large, unknown = sigma_picture(np.array([[0.4, 3.0, np.nan]]), 1.0)[0].astype(int)
    assert small[1] > 2 * small[0]
    assert large[0] > 2 * large[1]
    assert np.ptp(unknown) == 0


@pytest.fixture
def window(made, nobody, no_preview, furnish):
    window = ReviewWindow(nobody(), Workspace.at(made.folder.parent), no_preview, made.folder, made.session)
    window.read()
    return furnish(window, (ShootPanel,))


def test_a_shoot_is_shown_renewed_and_gone_when_it_is_over(window, settle):
    (panel,) = [one for one in window.panels if isinstance(one, ShootPanel)]
    settle(window)
    assert not panel.is_alone
    assert not panel._folder.visible
    write_png(window.folder / MAP, sigma_picture(np.full((20, 30), 0.2), 1.0))
    (window.folder / STATUS).write_text(json.dumps(STATE))
    end = time.monotonic() + 30
    while not panel._folder.visible:
        assert time.monotonic() < end, "it looks for itself"
        time.sleep(0.1)
        settle(window)
    assert "3 flash frames" in panel._text.content
    assert "<b>" not in panel._text.content
    assert near(panel._picture.image[:, :SIDE_PX], LIGHT, 0, -0.5)
    beside = panel._picture.image[:, SIDE_PX:].reshape(-1, 3)
    assert (beside != GROUND).any()
    (window.folder / STATUS).write_text(json.dumps(STATE | {"is_over": True}))
    window.post(panel.refresh)
    settle(window)
    assert not panel._folder.visible
    assert "The shoot is over" in window.client.told[-1]


def test_a_first_shoot_stands_alone_until_its_session_is_decoded(nobody, no_preview, tmp_path, settle):
    """A wall of what a folder lacks would hide the shoot, and tell its photographer nothing."""
    folder, turned = tmp_path / "out", []
    with open_record(folder) as record:
        (folder / STATUS).write_text(json.dumps(STATE))
        window = ReviewWindow(nobody(), Workspace.at(tmp_path), no_preview, folder, None)
        window.turn = lambda: turned.append("turned")
        window.read()
        panel = ShootPanel(window)
        window.panels.append(panel)
        panel.refresh()
        assert panel.is_alone
        assert panel._folder.visible
        (folder / STATUS).write_text(json.dumps(STATE | {"is_over": True}))
        end = time.monotonic() + 30
        while "The shoot is over" not in panel._text.content:
            assert time.monotonic() < end
            time.sleep(0.1)
            settle(window)
        assert panel._folder.visible
        assert not turned, "its photographs are not decoded yet"
        note_steps(record, {"check": {"result": {}, "warnings": []}})
    while not turned:
        assert time.monotonic() < end
        time.sleep(0.1)
        settle(window)
    window.close()


def test_a_status_that_is_none_is_one_message(window, settle):
    (panel,) = [one for one in window.panels if isinstance(one, ShootPanel)]
    (window.folder / STATUS).write_text('{"is_over": false, "flash": "many"}')
    window.post(panel.refresh)
    settle(window)
    assert "is no state of a shoot" in window.client.told[-1]
