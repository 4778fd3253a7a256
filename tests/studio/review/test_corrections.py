"""What a hand puts right of a session, and how it is written where the command line reads it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capture.session.requests import sphere_requests
from capture.session.session import load_session
from scene.errors import SceneError
from scene.rays import RayCaster
from studio.opening import found_at
from studio.photograph.photograph_window import added, moved, outline, resized
from studio.photograph.plane import Plane
from studio.review.corrections import Picks, forget_kept, met, outlines_of, pose_of, tables_of, write_amended
from studio.review.folder import Review

PLANE = Plane(160, 120)


@pytest.fixture
def review(made):
    return Review(made.folder, made.session)


def test_what_a_path_means(made, tmp_path):
    assert found_at(made.folder, None) == (made.folder, None)
    assert found_at(made.session, tmp_path / "other") == (tmp_path / "other", made.session)
    assert found_at(made.session, None)[0] == Path("out").resolve() / "session"
    with pytest.raises(SceneError, match="neither a session"):
        found_at(made.session / "raw", None)
    with pytest.raises(SceneError, match="Leave --out away"):
        found_at(made.folder, tmp_path)
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
    balls = outlines_of(review)
    assert [ball.diameter_mm for ball in balls] == [100.0, 100.0, 90.0]
    there = moved(balls, 1, (200.0, 50.0), made.camera)
    assert there[1].center_px == [159.0, 50.0]
    assert (there[0], there[2]) == (balls[0], balls[2])
    assert resized(balls, 0, -3.0, made.camera)[0].radius_px == 4.0
    more = added(balls, "white", (20.5, 400.0), made.camera)
    assert more == (*balls, outline("white", (20.5, 119.0), 13.0)), "as large as most"
    (made.folder / "spheres.json").unlink()
    waiting = outlines_of(Review(made.folder, made.session))
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
    balls = moved(resized(outlines_of(review), 0, 17.5, made.camera), 0, (33.25, 25.5), made.camera)
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
    both = load_session(write_amended(review, picks=Picks(((1.0, 2.0),), ((0.0, 0.0, 1.0),))))
    assert (both.spheres, both.picks) == (kept.spheres, made.folder / "review" / "picks.csv")
    assert (
        load_session(write_amended(review, spheres=tables_of(review.session, balls, made.camera))).picks == both.picks
    )


def test_a_ball_that_was_shot_apart_stays_as_the_session_has_it(review, made):
    own = tuple(made.session / "raw" / f"{name}.png" for name in made.lights.names)
    session = replace(review.session, spheres=(*review.session.spheres, replace(review.session.spheres[0], frames=own)))
    review.session = session
    tables = tables_of(session, outlines_of(review), made.camera)
    kept = load_session(write_amended(review, spheres=tables)).spheres
    assert (len(kept), kept[-1]) == (4, session.spheres[-1])


def test_what_was_kept_follows_the_sessions_own_file_and_can_be_forgotten(review, made):
    """Changes of session.toml after the correction count; by OUT/review, too, the user's own session is found again."""
    text = (made.session / "session.toml").read_text()
    balls = moved(outlines_of(review), 0, (33.0, 29.0), made.camera)
    folder = write_amended(review, spheres=tables_of(review.session, balls, made.camera))
    (made.session / "session.toml").write_text(text.replace('"cone.ply"', '"cone.ply"\nscan_unit = "cm"'))
    # As after a run of what was kept, which session.json names then.
    (made.folder / "session.json").write_text(json.dumps({"session": str(folder), "relative": "review"}))
    again = Review(made.folder)
    assert again.session_path == made.session
    kept = load_session(write_amended(again, picks=Picks(((1.0, 2.0),), ((0.0, 0.0, 1.0),))))
    assert (kept.scan_unit, kept.spheres[0].center_px) == ("cm", pytest.approx((33.0, 29.0)))
    forget_kept(again)
    assert not folder.exists()
    # Where its own session is gone, what was kept is all that there is.
    write_amended(review, spheres=tables_of(review.session, balls, made.camera))
    (made.session / "session.toml").unlink()
    left = Review(made.folder)
    assert left.session_path == folder
    with pytest.raises(SceneError, match="not known here"):
        forget_kept(left)
    assert (folder / "session.toml").exists()


@pytest.mark.parametrize("name", ["session.toml", "picks.csv"])
def test_a_file_that_is_not_the_studios_is_neither_written_over_nor_forgotten(review, made, name):
    theirs = made.folder / "review" / name
    theirs.parent.mkdir()
    theirs.write_text("# mine\n")
    with pytest.raises(SceneError, match="rgbn did not write it"):
        write_amended(review, picks=Picks(((1.0, 2.0),), ((1.0, 2.0, 3.0),)))
    with pytest.raises(SceneError, match="rgbn did not write it"):
        forget_kept(review)
    assert theirs.read_text() == "# mine\n"
    assert [path.name for path in theirs.parent.iterdir()] == [name]


def test_corrections_that_cannot_be_said_are_refused(review, made):
    balls, session = outlines_of(review), review.session
    masked = replace(session, spheres=(replace(session.spheres[0], mask=Path("a.png")),))
    for one, outlines, told in (
        (replace(session, lights_file=Path("lights.lp")), balls, r"lights\.file"),
        (masked, balls, "by masks"),
        (session, (), "no ball"),
    ):
        with pytest.raises(SceneError, match=told):
            tables_of(one, outlines, made.camera)


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
    kept = write_amended(review, picks=picks) / "picks.csv"
    text = kept.read_text()
    with pytest.raises(SceneError, match=r"^The picks: 3 picks are too few"):
        pose_of(review, Picks(picks.pixels[:3], picks.points[:3]), mesh)
    assert kept.read_text() == text, "a trial leaves what was kept as it is"
