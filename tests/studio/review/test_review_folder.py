"""What a review reads of an output folder, and how it is shown: without a browser."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from scene.errors import SceneError
from scene.lights import Lights
from scene.output_folder import open_record
from studio.review.folder import Review, targets
from studio.review.photograph_picture import (
    CLIPPED,
    CLIPPED_COLOUR,
    WARNED,
    Look,
    frame_strip,
    photograph,
    twin_beside,
)
from studio.review.review_window import turned_deg
from studio.review.spatial_view import covariance_mm2, ellipsoid_of
from twin.description.light_groups import direction


@pytest.fixture
def review(made):
    return Review(made.folder, made.session)


def test_a_whole_folder_lacks_nothing(review, made):
    assert (review.missing, review.lacks, review.why_no_session) == ({}, [], "")
    assert review.lights.names == made.lights.names
    np.testing.assert_allclose(review.position_covariance_mm2, made.covariance)
    assert review.highlights_px.shape == (3, 5, 2)
    (one,) = review.warnings
    assert (one.step, one.frames, one.ball) == ("calibrate", (2,), 2)


@pytest.mark.parametrize(
    ("file", "lacking"),
    [
        ("frames/frames.json", {"frames"}),
        ("camera.json", {"camera"}),
        ("spheres.json", {"balls"}),
        ("lights.json", {"lights"}),
        ("mask.png", {"mask"}),
        ("normals/truth.npy", {"scan"}),
        ("twin/frames/frames.json", {"twin"}),
        (".rgbn/record.json", set()),
        ("calibration.json", set()),
        ("summary.json", set()),
    ],
)
@pytest.mark.parametrize("how", ["gone", "cut"])
def test_each_part_that_is_not_there_is_named_and_no_other(made, file, lacking, how):
    path = made.folder / file
    if how == "gone":
        path.unlink(missing_ok=True)
    else:
        path.write_bytes((path.read_bytes() if path.exists() else b'{"check": [1, 2, 3, 4, 5, 6, 7]')[:25])
    review = Review(made.folder, made.session)
    assert set(review.missing) == lacking
    for why in review.missing.values():
        assert "Run it again" in why or "no ball was found" in why or "no registered scan" in why
    # Whatever is missing, the rest is shown.
    if lacking == {"frames"}:
        assert frame_strip(review) is None
        with pytest.raises(SceneError, match="frames"):
            photograph(review, 0, Look())
    else:
        assert photograph(review, 0, Look()).shape == (120, 160, 3)


def test_an_unfinished_step_is_said_to_be_unfinished(made):
    with open_record(made.folder) as record:
        record.forget(["calibrate", "align", "solve", "twin"])
    for name in ("lights.json", "mask.png", "pose.json"):
        (made.folder / name).unlink()
    review = Review(made.folder, made.session)
    assert set(review.missing) == {"lights", "mask"}
    assert "`calibrate` has not ended" in review.missing["lights"]
    (line,) = review.lacks
    assert line.startswith("- **lights, mask**: not made yet (`calibrate`, `align`)"), "one line for all that waits"


def test_the_first_photograph_is_shown_before_any_is_decoded(made, tmp_path):
    picture = np.full((60, 80, 3), 20_000, np.uint16)
    picture[:, 40:] = 50_000
    cv2.imwrite(str(made.session / "raw" / "flash_0.png"), picture)
    review = Review(tmp_path / "new", made.session)
    shown = photograph(review, 0, Look()).astype(int)
    assert shown.shape == (60, 80, 3)
    assert shown[:, 50:].mean() > shown[:, :30].mean() + 20


def test_a_warning_goes_to_what_it_names(made):
    texts = {
        "flash_12 and flash_1.dng: the same photograph.": ((1, 0), None),
        "flash_1.5 is none of ours, nor is my-flash_1x": ((), None),
        "a-1b: dark": ((3,), None),
        "the white ball shows too little skin": ((), 2),
        "chrome ball 2 is 99 mm across, not 100": ((), 1),
        "white ball 2 stands in shadow": ((), None),
        "chrome ball at (131, 91) px: no outline was found": ((), 1),
        "chrome ball at (70, 60) px: no outline was found": ((), None),
    }
    found = targets([("check", text) for text in texts], ("flash_1", "flash_12", "a-1", "a-1b"), made.spheres)
    assert {one.text: (one.frames, one.ball) for one in found} == texts


def test_the_strip_leads_to_the_frame_that_is_seen_there(review, made):
    """Each frame has a colour of its own: wherever it is seen on the strip, that frame is found."""
    sheet, exposure = frame_strip(review), review.material.exposure
    for index in range(5):
        colour = exposure.develop(made.linear[index, :1, :1])[0, 0]
        rows, columns = np.nonzero((np.abs(sheet.image.astype(int) - colour) <= 1).all(-1))
        assert len(rows) > 2000
        high, wide = sheet.image.shape[:2]
        hits = {sheet.frame_at((u + 0.5) / wide, (v + 0.5) / high) for u, v in zip(columns, rows, strict=True)}
        assert hits == {index}
    clipped, warned = (
        (sheet.image == colour).all(-1).any(0).nonzero()[0] // sheet.cells.shape[3] for colour in (CLIPPED, WARNED)
    )
    assert set(clipped) == {1}, "the frame with a clipped block"
    assert set(warned) == {2, 3}, "a step warned of one, the other's light has a flag"


def test_clipped_pixels_are_marked_and_no_others(review):
    marked = (photograph(review, 1, Look()) == CLIPPED_COLOUR).all(-1)
    assert marked[100:110, 60:80].all()
    assert marked.sum() == 200
    assert not (photograph(review, 1, Look(marks_clipped=False)) == CLIPPED_COLOUR).all(-1).any()


@pytest.mark.parametrize("overlay", ["mask", "scan, shaded", "scan, normals"])
def test_what_lies_over_the_photograph_lies_on_the_object_alone(review, made, overlay):
    plain = photograph(review, 0, Look()).astype(int)
    opaque = photograph(review, 0, Look(overlay, 1.0)).astype(int)
    changed = np.abs(opaque - plain).max(-1) > 2
    outline = cv2.dilate(made.mask.astype(np.uint8), np.ones((3, 3))) > 0
    assert not changed[~outline].any()
    if overlay == "scan, shaded":  # It comes out as the photograph itself, as the photograph is its shading.
        shaded = photograph(review, 0, Look(overlay, 1.0, marks_clipped=False)).astype(float).mean(-1)
        assert np.corrcoef(plain.mean(-1)[made.mask], shaded[made.mask])[0, 1] > 0.9
    else:
        assert changed[made.mask].mean() > 0.95
    (made.folder / "normals" / "truth.npy").unlink()
    (made.folder / "mask.png").unlink()
    with pytest.raises(SceneError, match="mask: the step" if overlay == "mask" else "scan: the step"):
        photograph(Review(made.folder, made.session), 0, Look(overlay))


def test_the_twin_beside_the_photograph(review, made):
    """Made nine tenths as bright: a tenth of each pixel is missing, and that of the median pixel is a tenth of it."""
    beside = twin_beside(review, 2, Look())
    assert beside.image.shape == (120, 160, 3)
    assert float(beside.caption.partition("differs by ")[2].partition("%")[0]) == pytest.approx(10, rel=0.1)
    (made.folder / "twin" / "frames" / "frames.json").unlink()
    with pytest.raises(SceneError, match="twin"):
        twin_beside(Review(made.folder, made.session), 2, Look())


def test_what_changed_is_told_in_degrees(made):
    """Positions a hand's breadth elsewhere: their directions turn by the angle that they turn by."""
    positions = made.lights.positions_mm + np.array([30.0, 0.0, 0.0])
    turned = replace(made.lights, positions_mm=positions).seen_from(made.lights.reference_point_mm + 5.0)
    a, b = made.lights.positions_mm - made.lights.reference_point_mm, positions - made.lights.reference_point_mm
    cosine = np.sum(a * b, 1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    np.testing.assert_allclose(turned_deg(made.lights, turned), np.degrees(np.arccos(cosine)), atol=1e-6)
    assert turned_deg(made.lights, made.lights) is None


def test_an_ellipsoid_is_its_covariance_and_a_distant_lights_is_flat():
    factor = np.random.default_rng(10_005).normal(size=(3, 3))
    covariance = factor @ factor.T
    half_axes, rotation = ellipsoid_of(covariance)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(rotation @ np.diag(half_axes**2) @ rotation.T, covariance)
    away = direction(130, 50)
    one = Lights(("a",), away[None], np.ones((1, 3)), None, np.zeros(3), np.array([1.0]))
    half_axes, rotation = ellipsoid_of(covariance_mm2(one, None)[0])
    np.testing.assert_allclose(np.sort(half_axes), [0, 17.455, 17.455], atol=1e-3)
    assert abs(rotation[:, np.argmin(half_axes)] @ away) == pytest.approx(1)
    unknown = replace(one, direction_sigma_deg=np.array([np.nan]))
    assert ellipsoid_of(covariance_mm2(unknown, None)[0]) is None
