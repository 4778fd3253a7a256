"""What a session's window reads of a folder, how it is shown, and how what a hand puts right is written."""

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from align.pose.picks import read_picks
from capture.session.manifest import TABLES
from capture.session.requests import sphere_requests
from capture.session.session import load_session
from scene.errors import SceneError
from scene.rays import RayCaster
from studio.opening import open_path
from studio.session import corrections
from studio.session.ball_edits import added, moved, outline, resized
from studio.session.corrections import Corrections, balls_of, met, tables_of, write_amended
from studio.session.folder import Review, frames_named
from studio.session.photograph_picture import (
    CLIPPED,
    PictureLook,
    frame_strip,
    normals_beside,
    photograph,
)
from studio.session.plane import Plane
from studio.studio_state import StudioState
from studio.widgets import HELD
from studio.workspace import Workspace


@pytest.fixture
def review(made):
    return Review(made.folder, made.session)


def test_a_whole_folder_lacks_nothing(review, made):
    assert (review.missing, review.lacks, review.why_no_session) == ({}, "", "")
    assert review.lights.names == made.lights.names
    assert review.highlights_px.shape == (3, 5, 2)
    (one,) = review.warnings
    assert (one.step, one.frames) == ("calibrate", (2,))


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
            photograph(review, 0, PictureLook())
    else:
        assert photograph(review, 0, PictureLook()).shape == (120, 160, 3)


def test_the_first_photograph_is_shown_before_any_is_decoded(made, tmp_path):
    picture = np.full((60, 80, 3), 20_000, np.uint16)
    picture[:, 40:] = 50_000
    cv2.imwrite(str(made.session / "raw" / "flash_0.png"), picture)
    review = Review(tmp_path / "new", made.session)
    shown = photograph(review, 0, PictureLook()).astype(int)
    assert shown.shape == (60, 80, 3)
    assert shown[:, 50:].mean() > shown[:, :30].mean() + 20


def test_a_warning_goes_to_the_frames_that_it_names():
    for text, frames in {
        "flash_12 and flash_1.dng: the same photograph.": (1, 0),
        "flash_1.5 is none of ours, nor is my-flash_1x": (),
        "a-1b: dark": (3,),
    }.items():
        assert frames_named(text, ("flash_1", "flash_12", "a-1", "a-1b")) == frames


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
        (sheet.image == colour).all(-1).any(0).nonzero()[0] // sheet.cells.shape[3] for colour in (CLIPPED, HELD)
    )
    assert set(clipped) == {1}, "the frame with a clipped block"
    assert set(warned) == {2, 3}, "a step warned of one, the other's light has a flag"


def test_clipped_pixels_are_marked_and_no_others(review):
    marked = (photograph(review, 1, PictureLook()) == CLIPPED).all(-1)
    assert marked[100:110, 60:80].all()
    assert marked.sum() == 200
    assert not (photograph(review, 1, PictureLook(marks_clipped=False)) == CLIPPED).all(-1).any()


def test_the_object_is_marked_and_nothing_else(review, made):
    plain = photograph(review, 0, PictureLook()).astype(int)
    marked = np.abs(photograph(review, 0, PictureLook(marks_object=True)) - plain).max(-1) > 2
    outline = cv2.dilate(made.mask.astype(np.uint8), np.ones((3, 3))) > 0
    assert not marked[~outline].any()
    assert marked[made.mask].mean() > 0.95
    (made.folder / "mask.png").unlink()
    with pytest.raises(SceneError, match="mask: the step"):
        photograph(Review(made.folder, made.session), 0, PictureLook(marks_object=True))


def test_the_normals_of_a_method_are_shown_as_colours(review, made):
    np.save(made.folder / "normals" / "ls.npy", made.truth)
    shown = normals_beside(Review(made.folder, made.session), "ls").astype(float) / 255
    np.testing.assert_allclose(shown[made.mask], (made.truth[made.mask] + 1) / 2, atol=0.01)
    assert normals_beside(review, "") is None


PLANE = Plane(160, 120)


def test_what_a_path_means(made, tmp_path):
    state, place = StudioState(), Workspace.at(tmp_path)
    for source, out, shown in (
        (made.folder, None, (made.folder, None)),
        (made.session, tmp_path / "other", (tmp_path / "other", made.session)),
        (made.session / "session.toml", tmp_path / "other", (tmp_path / "other", made.session / "session.toml")),
        (made.session, None, (tmp_path / "out" / "session", made.session)),
    ):
        open_path(state, place, source, out)
        assert state.session == shown
    with pytest.raises(SceneError, match="Leave --out away"):
        open_path(state, place, made.folder, tmp_path)
    assert "does not say which session" in Review(made.folder).why_no_session


def test_a_ray_meets_the_pixel_that_stands_there():
    generator = np.random.default_rng(10_006)
    for pixel in [(-0.4, -0.4), (0, 0), (159.4, 119.4), (80.25, 3.5)]:
        place = PLANE.place(pixel)
        eye = place + generator.uniform([-5, -5, 1], [5, 5, 9])
        np.testing.assert_allclose(PLANE.pixel(eye, place - eye), pixel, atol=1e-9)
        assert PLANE.pixel(eye, eye - place) is None, "the picture lies behind"
    assert PLANE.pixel([0, 0, 5], PLANE.place([160.0, 60.0]) - [0, 0, 5]) is None
    right, down = PLANE.place([1, 0]) - PLANE.place([0, 0]), PLANE.place([0, 1]) - PLANE.place([0, 0])
    assert right[0] > 0 > down[1]


def test_balls_are_moved_one_at_a_time_and_stay_in_the_picture(review, made):
    balls = balls_of(review)
    assert [ball.diameter_mm for ball in balls] == [100.0, 100.0, 90.0]
    there = moved(balls, 1, (200.0, 50.0), made.camera)
    assert there[1].center_px == [159.0, 50.0]
    assert (there[0], there[2]) == (balls[0], balls[2])
    assert resized(balls, 0, -3.0, made.camera)[0].radius_px == 4.0
    more = added(balls, "white", (20.5, 400.0), made.camera)
    assert more == (*balls, outline("white", (20.5, 119.0), 13.0, 90.0)), "as large as most"
    (made.folder / "spheres.json").unlink()
    waiting = balls_of(Review(made.folder, made.session))
    assert [ball.kind for ball in waiting] == ["chrome", "chrome", "white"], "they wait to be put in place"
    assert len({tuple(ball.center_px) for ball in waiting}) == 3


@pytest.mark.parametrize("half", [False, True])
def test_the_command_line_reads_the_balls_that_were_kept(made, half):
    """The requests that the step makes of the file are the corrected outlines, in the frames' own pixels."""
    text = (made.session / "session.toml").read_text()
    if half:  # [camera] then counts the photographs' pixels, twice as many
        text = text.replace("linear = true", "linear = true\nhalf = true")
        text = text.replace("width = 160\nheight = 120", "width = 320\nheight = 240")
        (made.session / "session.toml").write_text(text)
    review = Review(made.folder, made.session)
    balls = moved(resized(balls_of(review), 0, 17.5, made.camera), 0, (33.25, 25.5), made.camera)
    folder = write_amended(review, spheres=tables_of(review.session, balls, made.camera))
    assert (made.session / "session.toml").read_text() == text, "the user's own file is as it was"
    kept, before = load_session(folder), review.session
    assert replace(kept, spheres=(), folder=before.folder) == replace(before, spheres=())
    requests, _ = sphere_requests(kept, made.store)
    for request, ball in zip(requests, balls, strict=True):
        assert (request.kind, request.diameter_mm) == (ball.kind, ball.diameter_mm)
        np.testing.assert_allclose(request.center_px, ball.center_px, atol=1e-9)
        assert request.radius_px == pytest.approx(ball.radius_px)
    # Picks that are kept later leave the balls, and balls the picks.
    both = load_session(write_amended(review, picks=Corrections(pixels=((1.0, 2.0),), points=((0.0, 0.0, 1.0),))))
    assert (both.spheres, both.picks) == (kept.spheres, made.folder / "review" / "picks.csv")
    assert (
        load_session(write_amended(review, spheres=tables_of(review.session, balls, made.camera))).picks == both.picks
    )


def test_every_key_that_names_files_is_written_in_full():
    """As the declaration of session.toml has them: lists of names that may not be empty, and texts such as mask.png."""
    globs, files = set(), set()
    for table in TABLES.values():
        for name, key in table.model_json_schema()["properties"].items():
            kind, example = key.get("anyOf", [key])[0], str(key.get("examples", [""])[0])
            if kind.get("type") == "array" and kind["items"].get("type") == "string" and kind.get("minItems"):
                globs.add(name)
            elif kind.get("type") == "string" and re.search(r"\.[a-z]+$", example):
                files.add(name)
    assert (globs, files) == (corrections.GLOBS, corrections.FILES)


def test_what_was_kept_follows_the_sessions_own_file(review, made):
    """Changes of session.toml after the correction count; by OUT/review, too, the user's own session is found again."""
    text = (made.session / "session.toml").read_text()
    balls = moved(balls_of(review), 0, (33.0, 29.0), made.camera)
    folder = write_amended(review, spheres=tables_of(review.session, balls, made.camera))
    (made.session / "session.toml").write_text(text.replace('"cone.ply"', '"cone.ply"\nscan_unit = "cm"'))
    # As after a run of what was kept, which session.json names then.
    (made.folder / "session.json").write_text(json.dumps({"session": str(folder), "relative": "review"}))
    again = Review(made.folder)
    assert again.session_path == made.session
    kept = load_session(write_amended(again, picks=Corrections(pixels=((1.0, 2.0),), points=((0.0, 0.0, 1.0),))))
    assert (kept.scan_unit, kept.spheres[0].center_px) == ("cm", pytest.approx((33.0, 29.0)))
    # Where its own session is gone, what was kept is all that there is.
    (made.session / "session.toml").unlink()
    left = Review(made.folder)
    assert left.session_path == folder
    assert (folder / "session.toml").exists()


@pytest.mark.parametrize("name", ["session.toml", "picks.csv"])
def test_a_file_that_is_not_the_studios_is_not_written_over(review, made, name):
    theirs = made.folder / "review" / name
    theirs.parent.mkdir()
    theirs.write_text("# mine\n")
    with pytest.raises(SceneError, match="rgbn did not write it"):
        write_amended(review, picks=Corrections(pixels=((1.0, 2.0),), points=((1.0, 2.0, 3.0),)))
    assert theirs.read_text() == "# mine\n"
    assert [path.name for path in theirs.parent.iterdir()] == [name]


def test_balls_that_were_shot_apart_stay_and_what_cannot_be_said_is_refused(review, made):
    own = tuple(made.session / "raw" / f"{name}.png" for name in made.lights.names)
    balls, session, (first, *_) = balls_of(review), review.session, review.session.spheres
    review.session = apart = replace(session, spheres=(*session.spheres, replace(first, frames=own)))
    kept = load_session(write_amended(review, spheres=tables_of(apart, balls, made.camera))).spheres
    assert (len(kept), kept[-1]) == (4, apart.spheres[-1])
    for one, outlines, told in (
        (replace(session, lights_file=Path("lights.lp")), balls, r"lights\.file"),
        (replace(session, spheres=(replace(first, mask=Path("a.png")),)), balls, "by masks"),
        (session, (), "no ball"),
    ):
        with pytest.raises(SceneError, match=told):
            tables_of(one, outlines, made.camera)


def test_picks_give_the_pose_at_which_they_were_made(review, made):
    """Rays from aside meet the scan; the points are seen where the true pose puts them: that pose is found."""
    mesh, generator, picks = review.scan_mesh, np.random.default_rng(10_007), Corrections()
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
    kept = load_session(write_amended(review, picks=picks))
    found = read_picks(kept.picks, made.camera, mesh, unit=kept.scan_unit, half=False)
    assert found.residual_px < 0.05
    assert (found.pose.inverse() @ made.pose).angle_deg() < 0.5
    assert met(caster, mesh.center_mm + [0, 0, 500], np.array([0.0, 0.0, 1.0])) is None
