"""A pixel's samples, fits and numbers are those of the frames and the solvers; what is missing is told."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from compare.compare import compare
from scene.errors import SceneError
from scene.files import write_json, write_npy
from scene.normals import angular_error_deg
from solve.pixelwise import ls
from solve.samples import GRAY, Geometry, Samples, points_of, read_band, scale_of
from studio.results.panel import lacks
from studio.results.pixel import lit_from, numbers_at, read_pixel
from studio.results.pixel_charts import error_chart, notes_of, numbers_table, pixel_chart, shares
from studio.results.result_maps import TRUTH, Source
from studio.results.side_by_side import WHATS, Choice, map_picture, viewport_of

PIXELS = [(31, 12), (12, 31), (8, 4), (44, 30), (20, 9)]


def trace(figure, name):
    return next(one for one in figure.data if one.name == name)


@pytest.mark.parametrize("near", [True, False])
def test_a_fit_is_the_solvers_own_prediction(make, near):
    """What least squares itself says of each sample, b . l, asked of the solver anew; and the samples it was given."""
    made = make(near=near, noise=0.003)
    results = made.read(made.folder)
    for side, frames in (("photographs", made.frames), ("twin", results.review.twin)):
        limit = lit_from(results, side)
        band = read_band(frames, made.mask, slice(0, frames.height))
        gray, valid = band.gray((GRAY / made.lights.intensities).astype(np.float32))
        points = points_of(made.camera, made.lights, made.mask, slice(0, frames.height))
        scale = scale_of(frames, made.lights, made.mask)
        b, used = ls.fit(Samples(gray, valid, points, Geometry.of(made.lights)), scale, ls.Settings())
        vectors = made.lights.toward(points)
        number = np.cumsum(made.mask).reshape(made.mask.shape) - 1
        checked = 0
        for u, v in zip(*np.nonzero(made.mask.T), strict=True):
            place = number[v, u]
            if (u + 3 * v) % 41 and (u, v) != made.odd:
                continue
            pixel = read_pixel(results, side, u, v, lit_from=limit)
            np.testing.assert_allclose(pixel.gray, gray[place], rtol=1e-4, atol=1e-6)
            assert (pixel.clipped == ~valid[place]).all()
            fit = next(one for one in pixel.fits if one.source == Source("ls", side))
            predicted = vectors[:, place] @ b[place]
            np.testing.assert_allclose(fit.gray, np.maximum(predicted, 0), rtol=2e-4, atol=1e-5)
            assert fit.note == ""
            # The shadow threshold of least squares is the one that marks.
            assert (used[place] == ~(pixel.clipped | pixel.shadowed)).all()
            checked += 1
        assert checked > 15


@pytest.mark.parametrize(("method", "own"), [("ls", False), ("semicalibrated", True)])
def test_a_solvers_own_intensities_are_its_predictions(make, method, own):
    """Frames were shot with other strengths than calibration says: only who finds them predicts the samples."""
    generator = np.random.default_rng(10_063)
    first = make(methods=())
    wrong = first.lights.intensities * generator.uniform(0.75, 1.25, (10, 1))
    made = make(methods=(method,), noise=0.0003, shot_with=replace(first.lights, intensities=wrong).normalised())
    found = made.found[method].lights
    if found is not None:
        intensities = found.seen_from(made.lights.reference_point_mm).intensities
        write_json(made.folder / "summary.json", {"solve": {"methods": {method: {"intensities": intensities}}}})
    pixel = read_pixel(made.read(made.folder), "photographs", 20, 9, lit_from=0.0)
    (fit,) = (one for one in pixel.fits if one.source.method == method)
    off = np.abs(fit.gray - pixel.gray).max() / pixel.gray.max()
    assert off < 0.004 if own else off > 0.05
    # The twin's own are not kept: said, not guessed.
    assert own == (
        "calibrated intensities" in notes_of(read_pixel(made.read(made.folder), "twin", 20, 9, lit_from=0.0))
    )


def test_a_depth_that_a_solver_found_is_where_its_lights_are_taken(made):
    depth = np.full(made.mask.shape, -270.0, np.float32)
    (made.folder / "depth").mkdir()
    write_npy(made.folder / "depth" / "ls.npy", depth)
    pixel = read_pixel(made.read(made.folder), "photographs", 20, 9, lit_from=0.0)
    ls_fit, other = pixel.fits[0], pixel.fits[1]
    for fit, z_mm in ((ls_fit, -270.0), (other, -300.0)):
        point = np.array([(20 - 24.0) / 90, -(9 - 19.5) / 90, -1.0]) * -z_mm
        away = made.lights.positions_mm - point
        reach = np.linalg.norm(made.lights.positions_mm - made.lights.reference_point_mm, axis=1)
        shade = away @ made.found[fit.source.method].normals[9, 20] * reach**2 / np.linalg.norm(away, axis=1) ** 3
        np.testing.assert_allclose(fit.shade, shade, rtol=1e-5)


def test_the_charts_show_every_sample_once_and_mark_the_bad_ones(made):
    results, (u, v) = made.read(made.folder), made.odd
    pixel = read_pixel(results, "photographs", u, v, lit_from=lit_from(results, "photographs"))
    expected = (made.frames.read()[:, v, u] / made.lights.intensities) @ GRAY
    figure = pixel_chart(pixel)
    assert list(trace(figure, "clipped").x) == [made.clipped + 1]
    assert list(trace(figure, "shadowed").x) == [made.shadowed + 1]
    shown = {int(x): y for name in ("sample", "shadowed", "clipped") for x, y in
             zip(trace(figure, name).x, trace(figure, name).y, strict=True)}  # fmt: skip
    assert sorted(shown) == list(range(1, 11))
    np.testing.assert_allclose([shown[i + 1] for i in range(10)], expected, rtol=1e-5, atol=1e-7)
    assert trace(figure, "clipped").text == ("4 flash_03",)
    # Over n . l by its own normal a solver's fit is a straight line from zero.
    for fit in pixel.fits:
        name = fit.source.method
        line = trace(pixel_chart(pixel, name), name)
        lit = np.array(line.x) > 0
        slope = np.array(line.y)[lit] / np.array(line.x)[lit]
        np.testing.assert_allclose(slope, (results.at("albedo", fit.source, u, v) @ GRAY), rtol=1e-6)
        assert (np.diff(line.x) >= 0).all()
    over_truth = pixel_chart(pixel, "truth")
    clipped = trace(over_truth, "clipped")
    point = made.camera.points_at_depth([[u, v]], -300.0)
    np.testing.assert_allclose(clipped.x, made.lights.toward(point)[made.clipped] @ made.truth[v, u], rtol=1e-5)


def test_the_numbers_are_the_maps(made):
    results = made.read(made.folder)
    for u, v in PIXELS:
        rows = {row.source: row for row in numbers_at(results, u, v)}
        assert set(rows) == {TRUTH, *(Source(m, s) for m in ("ls", "iterative") for s in ("photographs", "twin"))}
        for source, found in ((Source("iterative"), made.found["iterative"]), (Source("ls", "twin"), made.twin_found)):
            row = rows[source]
            np.testing.assert_array_equal(row.normal, found.normals[v, u])
            np.testing.assert_array_equal(row.albedo, found.albedo[v, u])
            np.testing.assert_array_equal(row.sigma_deg, found.sigma_deg[v, u])
            angle = angular_error_deg(found.normals[v, u], made.truth[v, u])
            np.testing.assert_allclose(row.error_deg, angle, atol=1e-4)
        assert np.isnan(rows[Source("iterative", "twin")].normal).all()
        assert f"<td>{rows[Source('ls')].error_deg:.2f}</td>".replace("nan", "–") in numbers_table(list(rows.values()))


def test_the_histograms_and_the_scale_are_the_reports(made):
    results, told = made.read(made.folder), compare(made.store)
    assert results.error_end_deg == told["error_scale_deg"]
    for source, kind in ((Source("ls"), "real"), (Source("iterative"), "real"), (Source("ls", "twin"), "twin")):
        edges, share = shares(results.known_errors[source], results.error_end_deg)
        np.testing.assert_allclose(edges, told["histogram_edges_deg"])
        counts = told["methods"][source.method]["histogram"][kind]
        np.testing.assert_allclose(share * sum(counts), counts, atol=2)
    figure, words = error_chart(results, ["ls", "iterative", "ls"])
    assert [one.name for one in figure.data] == ["ls, photographs", "ls, twin", "iterative, photographs"]
    assert "iterative, twin: no errors are known" in words
    assert f"median {told['methods']['ls']['real']['median_deg']:.2f}" in words


GONE = {
    "twin": ("twin", "twin"),
    "normals/truth.npy": ("ground truth", "truth"),
    "frames/frames.json": ("frames", "frames"),
    "lights.json": ("lights", "lights"),
    "albedo/ls.npy": (None, "albedo"),
    "normals/iterative.npy": (None, "normals"),
    "mask.png": (None, "mask"),
}


@pytest.mark.parametrize(
    ("gone", "how"),
    [
        ("twin", "gone"),
        ("normals/truth.npy", "cut"),
        ("frames/frames.json", "cut"),
        ("lights.json", "gone"),
        ("albedo/ls.npy", "cut"),
        ("normals/iterative.npy", "gone"),
        ("normals/iterative.npy", "cut"),
        ("mask.png", "gone"),
    ],
)
def test_what_is_missing_is_told_and_the_rest_is_shown(made, gone, how):
    path = made.folder / gone
    if path.is_dir():
        shutil.rmtree(path)
    elif how == "gone":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:30])
    results = made.read(made.folder)
    named = GONE[gone][0]
    assert set(lacks(results)) == ({named} if named else set())
    for what in WHATS:
        for source in results.sources:
            choice = Choice(what, source, source)
            try:
                shown = map_picture(results, choice, source)
                assert shown.shape == (viewport_of(results, choice).high, viewport_of(results, choice).wide, 3)
                is_map = np.ptp(shown, axis=-1).max() > 20
            except SceneError:
                is_map = False
            broken = {
                "twin": source.side == "twin",
                "normals/truth.npy": what == "errors" or source == TRUTH,
                "albedo/ls.npy": what == "albedo" and source == Source("ls"),
                "normals/iterative.npy": what != "albedo" and source == Source("iterative"),
            }.get(gone, False)
            never = (source == TRUTH and what != "normals") or source == Source("iterative", "twin")
            assert is_map == (not broken and not never), (what, source)
    rows = {row.source: row for row in numbers_at(results, *made.odd)}
    for source, row in rows.items():
        has_error = source in (Source("ls"), Source("ls", "twin"), Source("iterative")) and (
            gone != "normals/truth.npy" and not (gone == "twin" and source.side == "twin")
            and not (gone == "normals/iterative.npy" and source.method == "iterative")
        )  # fmt: skip
        assert np.isfinite(row.error_deg) == has_error, source
    error_chart(results, results.methods)


@pytest.mark.parametrize("part", ["frames/frames.json", "lights.json", "twin"])
def test_samples_that_are_not_there_are_a_message(made, part):
    path = made.folder / part
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    results, side = made.read(made.folder), "twin" if part == "twin" else "photographs"
    with pytest.raises(
        SceneError, match=r"no (frames|lights): the step `\w+` ended, but|no twin: there is no registered scan"
    ):
        read_pixel(results, side, *made.odd, lit_from=0.0)


def test_where_a_solver_gave_no_answer_it_has_no_fit(made):
    results = made.read(made.folder)
    pixel = read_pixel(results, "photographs", 1, 1, lit_from=0.0)
    assert notes_of(pixel) == "- no fit at this pixel: ls, iterative."
    names = [one.name for one in pixel_chart(pixel).data]
    assert set(names) <= {"sample", "shadowed"}
    drawn = sum(len(one.x) for one in pixel_chart(pixel).data)
    assert drawn == len(results.review.material.frames), "the samples themselves are drawn, each once"
