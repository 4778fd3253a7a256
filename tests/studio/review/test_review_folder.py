"""What a review reads of an output folder, how it is shown, and what is written: without a browser."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.session.requests import sphere_requests
from capture.session.session import load_session
from compare.report.picture_strip import CHOSEN
from scene.errors import SceneError
from scene.output_folder import open_record
from scene.rays import RayCaster
from studio.photograph.outlines import Outline, added, moved, removed, resized
from studio.photograph.plane import Plane
from studio.review.corrected_session import forget_kept, outlines_of, specs_of, write_amended
from studio.review.folder import Review, found_at, targets
from studio.review.frames_panel import lacks_text
from studio.review.photograph_picture import CLIPPED_COLOUR, Look, photograph
from studio.review.photograph_view import CLIPPED, WARNED, frame_strip
from studio.review.result_panels import twin_picture
from studio.review.review_window import turned_deg
from studio.review.scan_picks import Picks, met, pose_of, write_picks

PLANE = Plane(160, 120)


@pytest.fixture
def review(made):
    return Review.read(made.folder, made.session)


def test_a_whole_folder_lacks_nothing(review, made):
    assert review.missing == {}
    assert review.why_no_session == ""
    assert lacks_text(review) == ""
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
    ],
)
@pytest.mark.parametrize("how", ["gone", "cut"])
def test_each_part_that_is_not_there_is_named_and_no_other(made, file, lacking, how):
    path = made.folder / file
    if how == "gone":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:25])
    review = Review.read(made.folder, made.session)
    assert set(review.missing) == lacking
    (why,) = review.missing.values()
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
    review = Review.read(made.folder, made.session)
    assert set(review.missing) == {"lights", "mask"}
    assert "`calibrate` has not ended" in review.missing["lights"]
    assert "`align` has not ended" in review.missing["mask"]
    text = lacks_text(review)
    assert "- **lights, mask**: not made yet (`calibrate`, `align`)" in text
    assert text.count("\n- ") == 1, "one line for all that waits"


@pytest.mark.parametrize("name", [".rgbn/record.json", "calibration.json", "summary.json"])
def test_a_broken_list_breaks_nothing(made, name):
    (made.folder / name).write_text('{"check": [1, ')
    review = Review.read(made.folder, made.session)
    assert review.lights is not None
    assert photograph(review, 1, Look()).shape == (120, 160, 3)


def test_what_a_path_means(made, tmp_path):
    assert found_at(made.folder, None) == (made.folder, None)
    assert found_at(made.session, tmp_path / "other") == (tmp_path / "other", made.session)
    assert found_at(made.session, None)[0] == Path("out").resolve() / "session"
    with pytest.raises(SceneError, match="neither a session"):
        found_at(made.session / "raw", None)
    with pytest.raises(SceneError, match="Leave --out away"):
        found_at(made.folder, tmp_path)
    assert "does not say which session" in Review.read(made.folder).why_no_session


def test_a_warning_goes_to_what_it_names(made):
    names = ("flash_1", "flash_12", "a-1", "a-1b")
    spheres = made.spheres
    texts = [
        "flash_12 and flash_1.dng: the same photograph.",
        "flash_1.5 is none of ours, nor is my-flash_1x",
        "a-1b: dark",
        "the white ball shows too little skin",
        "chrome ball 2 is 99 mm across, not 100",
        "white ball 2 stands in shadow",
        "chrome ball at (131, 91) px: no outline was found",
        "chrome ball at (70, 60) px: no outline was found",
    ]
    found = targets([("check", text) for text in texts], names, spheres)
    assert [one.frames for one in found] == [(1, 0), (), (3,), (), (), (), (), ()]
    assert [one.ball for one in found] == [None, None, None, 2, 1, None, 1, None]


def test_the_strip_leads_to_the_frame_that_is_seen_there(review, made):
    """Each frame has a colour of its own: wherever it is seen on the strip, that frame is found."""
    sheet = frame_strip(review)
    exposure = review.material.exposure
    for index in range(5):
        colour = exposure.develop(made.linear[index, :1, :1])[0, 0]
        rows, columns = np.nonzero((np.abs(sheet.image.astype(int) - colour) <= 1).all(-1))
        assert len(rows) > 2000
        high, wide = sheet.image.shape[:2]
        hits = {sheet.frame_at((u + 0.5) / wide, (v + 0.5) / high) for u, v in zip(columns, rows, strict=True)}
        assert hits == {index}
        framed = sheet.with_chosen(index)
        blue = np.argwhere((framed == CHOSEN).all(-1)).mean(0)
        assert np.abs(blue - [rows.mean(), columns.mean()]).max() < 15
    assert sheet.frame_at(-0.01, 0.5) is None
    assert sheet.frame_at(0.5, 1.01) is None
    clipped, warned = (
        (sheet.image == colour).all(-1).any(0).nonzero()[0] // sheet.cells.shape[3] for colour in (CLIPPED, WARNED)
    )
    assert set(clipped) == {1}, "the frame with a clipped block"
    assert set(warned) == {2, 3}, "a step warned of one, the other's light has a flag"


def test_clipped_pixels_are_marked_and_no_others(review):
    shown = photograph(review, 1, Look())
    marked = (shown == CLIPPED_COLOUR).all(-1)
    assert marked[100:110, 60:80].all()
    assert marked.sum() == 200
    assert not (photograph(review, 1, Look(marks_clipped=False)) == CLIPPED_COLOUR).all(-1).any()
    assert not (photograph(review, 0, Look()) == CLIPPED_COLOUR).all(-1).any()


@pytest.mark.parametrize("overlay", ["mask", "scan, shaded", "scan, normals"])
def test_what_lies_over_the_photograph_lies_on_the_object_alone(review, made, overlay):
    plain = photograph(review, 0, Look()).astype(int)
    opaque = photograph(review, 0, Look(overlay, 1.0)).astype(int)
    half = photograph(review, 0, Look(overlay, 0.5)).astype(int)
    changed = np.abs(opaque - plain).max(-1) > 2
    outline = cv2.dilate(made.mask.astype(np.uint8), np.ones((3, 3))) > 0
    assert not changed[~outline].any()
    if overlay != "scan, shaded":  # which comes out as the photograph itself, as the photograph is its shading
        assert changed[made.mask].mean() > 0.95
        inside = cv2.erode(made.mask.astype(np.uint8), np.ones((5, 5))) > 0
        assert np.abs(half - (plain + opaque) / 2)[inside].max() <= 1
    if overlay != "mask":
        transparent = photograph(review, 0, Look(overlay, 0.0))
        assert (transparent == plain).all()


@pytest.mark.full
def test_the_shaded_scan_is_lit_from_where_the_light_is(review, made):
    """The photograph is the shading plus a constant: where the shaded scan is bright, so is the photograph."""
    for index in range(5):
        plain = photograph(review, index, Look(marks_clipped=False)).astype(float).mean(-1)[made.mask]
        shaded = photograph(review, index, Look("scan, shaded", 1.0, marks_clipped=False)).astype(float)
        assert np.corrcoef(plain, shaded.mean(-1)[made.mask])[0, 1] > 0.9


def test_an_overlay_that_is_missing_is_said(made):
    (made.folder / "normals" / "truth.npy").unlink()
    (made.folder / "mask.png").unlink()
    review = Review.read(made.folder, made.session)
    for overlay, named in (("mask", "mask"), ("scan, shaded", "scan"), ("scan, normals", "scan")):
        with pytest.raises(SceneError, match=f"{named}: the step `align`"):
            photograph(review, 0, Look(overlay))


def test_the_twin_beside_the_photograph(review, made):
    picture, difference = twin_picture(review, 2, review.material.exposure)
    assert picture.shape == (120, 160, 3)
    # Made nine tenths as bright: a tenth of each pixel is missing, and that of the median pixel is a tenth of it.
    assert difference == pytest.approx(0.1, rel=0.1)
    (made.folder / "twin" / "frames" / "frames.json").unlink()
    with pytest.raises(SceneError, match="twin"):
        twin_picture(Review.read(made.folder, made.session), 2, review.material.exposure)


def test_a_ray_meets_the_pixel_that_stands_there():
    generator = np.random.default_rng(10_006)
    for pixel in [(-0.4, -0.4), (0, 0), (159.4, 119.4), (80.25, 3.5)]:
        place = PLANE.place(pixel)
        eye = place + generator.uniform([-5, -5, 1], [5, 5, 9])
        np.testing.assert_allclose(PLANE.pixel(eye, place - eye), pixel, atol=1e-9)
        assert PLANE.pixel(eye, eye - place) is None, "the picture lies behind"
    assert PLANE.pixel([0, 0, 5], PLANE.place([160.0, 60.0]) - [0, 0, 5]) is None
    right, down = PLANE.place([1, 0]) - PLANE.place([0, 0]), PLANE.place([0, 1]) - PLANE.place([0, 0])
    assert right[0] > 0 == right[1]
    assert down[1] < 0 == down[0]


def test_balls_are_moved_one_at_a_time_and_stay_in_the_picture(review, made):
    balls = outlines_of(review)
    assert [ball.diameter_mm for ball in balls] == [100.0, 100.0, 90.0]
    there = moved(balls, 1, (200.0, 50.0), made.camera)
    assert there[1].center_px == (159.0, 50.0)
    assert [ball.is_moved for ball in there] == [False, True, False]
    assert (there[0], there[2]) == (balls[0], balls[2])
    assert resized(balls, 0, -3.0, made.camera)[0].radius_px == 4.0
    assert removed(there, 1) == (balls[0], balls[2])
    more = added(balls, "white", (20.5, 400.0), made.camera)
    assert more[:3] == balls
    assert more[3] == Outline("white", (20.5, 119.0), 13.0, None, True), "as large as most"


def test_balls_that_were_not_found_wait_to_be_put_in_place(made):
    (made.folder / "spheres.json").unlink()
    waiting = outlines_of(Review.read(made.folder, made.session))
    assert [ball.kind for ball in waiting] == ["chrome", "chrome", "white"]
    assert len({ball.center_px for ball in waiting}) == 3


@pytest.mark.parametrize("half", [False, True])
def test_the_command_line_reads_the_balls_that_were_kept(made, half):
    """The requests that the step makes of the file are the corrected outlines, in the frames' own pixels."""
    text = (made.session / "session.toml").read_text()
    if half:  # [camera] then counts the photographs' pixels, twice as many
        text = text.replace("linear = true", "linear = true\nhalf = true")
        text = text.replace("width = 160\nheight = 120", "width = 320\nheight = 240")
        (made.session / "session.toml").write_text(text)
    review = Review.read(made.folder, made.session)
    balls = moved(resized(outlines_of(review), 0, 17.5, made.camera), 0, (33.25, 25.5), made.camera)
    folder = write_amended(review, spheres=specs_of(review.session, balls, made.camera))
    assert (made.session / "session.toml").read_text() == text, "the user's own file is as it was"
    kept, before = load_session(folder), review.session
    assert replace(kept, spheres=(), folder=before.folder) == replace(before, spheres=())
    requests, _ = sphere_requests(kept, made.store)
    assert len(requests) == 3
    for request, ball in zip(requests, balls, strict=True):
        assert (request.kind, request.diameter_mm) == (ball.kind, ball.diameter_mm)
        np.testing.assert_allclose(request.center_px, ball.center_px, atol=1e-9)
        assert request.radius_px == pytest.approx(ball.radius_px)
    # Picks that are kept later leave the balls, and balls the picks.
    picks = made.folder / "review" / "picks.csv"
    picks.write_text("u,v,x,y,z\n")
    both = load_session(write_amended(review, picks=picks))
    assert (both.spheres, both.picks) == (kept.spheres, picks)
    assert load_session(write_amended(review, spheres=kept.spheres)).picks == picks


def test_what_was_kept_follows_the_sessions_own_file_and_can_be_forgotten(review, made):
    """Changes of session.toml after the correction count; by OUT/review, too, the user's own session is found again."""
    text = (made.session / "session.toml").read_text()
    balls = moved(outlines_of(review), 0, (33.0, 29.0), made.camera)
    folder = write_amended(review, spheres=specs_of(review.session, balls, made.camera))
    (made.session / "session.toml").write_text(text.replace('"cone.ply"', '"cone.ply"\nscan_unit = "cm"'))
    # As after a run of what was kept, which session.json names then.
    (made.folder / "session.json").write_text(json.dumps({"session": str(folder), "relative": "review"}))
    again = Review.read(made.folder)
    assert again.session_path == made.session
    kept = load_session(write_amended(again))
    assert kept.scan_unit == "cm"
    assert kept.spheres[0].center_px == pytest.approx((33.0, 29.0))
    picks = write_picks(again, Picks(((1.0, 2.0),), ((0.0, 0.0, 1.0),)))
    forget_kept(again)
    assert not (folder / "session.toml").exists()
    assert not picks.exists()
    assert Review.read(made.folder, made.session).session.spheres[0].center_px is None
    # Where its own session is gone, what was kept is all that there is.
    write_amended(review, spheres=kept.spheres)
    (made.session / "session.toml").unlink()
    left = Review.read(made.folder)
    assert left.session_path == folder
    with pytest.raises(SceneError, match="not known here"):
        forget_kept(left)
    assert (folder / "session.toml").exists()


def test_a_file_that_is_not_the_studios_is_not_written_over(review, made):
    (made.folder / "review").mkdir()
    theirs = made.folder / "review" / "session.toml"
    theirs.write_text("# mine\n")
    with pytest.raises(SceneError, match="rgbn did not write it"):
        write_amended(review, picks=made.session / "cone.ply")
    assert theirs.read_text() == "# mine\n"


def test_picks_that_are_not_the_studios_are_neither_written_over_nor_forgotten(review, made):
    theirs = made.folder / "review" / "picks.csv"
    theirs.parent.mkdir()
    theirs.write_text("mine")
    with pytest.raises(SceneError, match="rgbn did not write it"):
        write_picks(review, Picks(((1.0, 2.0),), ((1.0, 2.0, 3.0),)))
    with pytest.raises(SceneError, match="rgbn did not write it"):
        forget_kept(review)
    assert theirs.read_text() == "mine"


def test_corrections_that_cannot_be_said_are_refused(review, made):
    balls, session = outlines_of(review), review.session
    with pytest.raises(SceneError, match=r"lights\.file"):
        specs_of(replace(session, lights_file=Path("lights.lp")), balls, made.camera)
    masked = replace(session, spheres=(replace(session.spheres[0], mask=Path("a.png")),))
    with pytest.raises(SceneError, match="by masks"):
        specs_of(masked, balls, made.camera)
    with pytest.raises(SceneError, match="no ball"):
        specs_of(session, (), made.camera)


def test_what_changed_is_told_in_degrees(made):
    """Positions a hand's breadth elsewhere: their directions turn by the angle that they turn by."""
    positions = made.lights.positions_mm + np.array([30.0, 0.0, 0.0])
    turned = replace(made.lights, positions_mm=positions).seen_from(made.lights.reference_point_mm + 5.0)
    a, b = made.lights.positions_mm - made.lights.reference_point_mm, positions - made.lights.reference_point_mm
    cosine = np.sum(a * b, 1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    np.testing.assert_allclose(turned_deg(made.lights, turned), np.degrees(np.arccos(cosine)), atol=1e-6)
    assert turned_deg(made.lights, made.lights) is None
    assert turned_deg(None, turned) is None


def test_picks_are_pairs():
    picks = Picks().with_pixel((1.0, 2.0)).with_pixel((3.0, 4.0))
    assert (picks.pixels, picks.pairs) == (((3.0, 4.0),), 0)
    picks = picks.with_point([1, 2, 3]).with_point([4, 5, 6])
    assert picks.points == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), "a point may come first"
    picks = picks.with_point([7, 8, 9])
    assert picks.points[1] == (7.0, 8.0, 9.0)


def test_picks_give_the_pose_at_which_they_were_made(review, made):
    """Rays from aside meet the scan; the points are seen where the true pose puts them: that pose is found."""
    mesh, generator, picks = review.scan_mesh, np.random.default_rng(10_007), Picks()
    caster = RayCaster(mesh)
    while picks.pairs < 7:
        origin = mesh.center_mm + 300 * generator.normal(size=3)
        goal = mesh.center_mm + 15 * generator.normal(size=3)
        point = met(caster, origin, 5 * (goal - origin))
        if point is None:
            continue
        # It lies on the ray.
        along = (goal - origin) / np.linalg.norm(goal - origin)
        assert np.linalg.norm(np.cross(point - origin, along)) < 1e-3
        pixel = made.camera.project(made.pose.apply(point[None]))[0]
        picks = picks.with_pixel(tuple(pixel)).with_point(point)
    found = pose_of(review, picks, mesh)
    assert found.residual_px < 0.05
    assert (found.pose.inverse() @ made.pose).angle_deg() < 0.5
    assert met(caster, mesh.center_mm + [0, 0, 500], np.array([0.0, 0.0, 1.0])) is None
    kept = write_picks(review, picks)
    text = kept.read_text()
    with pytest.raises(SceneError, match=r"^The picks: 3 picks are too few"):
        pose_of(review, Picks(picks.pixels[:3], picks.points[:3]), mesh)
    pose_of(review, Picks(picks.pixels[:5], picks.points[:5]), mesh)
    assert kept.read_text() == text, "a trial leaves what was kept as it is"
