"""Reports of many methods, and of a large session."""

import copy
import re
import shutil
from typing import Any

import numpy as np
import pytest

from compare.compare import compare
from compare.report.report import write_report
from fixtures.lit_surfaces import lights_along, spiral
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import unit
from scene.store import Store
from tests.compare.test_report import Page, assert_self_contained


@pytest.fixture(scope="module")
def crowd(session, tmp_path_factory) -> tuple[Store, dict[str, Any]]:
    """Return a session with eleven methods more: copies of one, turned a little; one of them knows nothing."""
    store = Store(tmp_path_factory.mktemp("crowd") / "out")
    shutil.copytree(session.store.folder, store.folder)
    summary = copy.deepcopy(session.summary)
    names = ("position", "l1", "sbl", "hsh", "rpca", "near", "ldr", "entropy", "tv", "Learned", "silent")
    for number, name in enumerate(names):
        angle = np.radians(2 + number)
        turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
        for place in ("normals", "twin/normals"):
            normals = np.load(store.path(place, "ls.npy")) @ turn.T.astype(np.float32)
            if name == "silent":
                normals[:] = np.nan
            np.save(store.path(place, f"{name}.npy"), normals)
        summary["solve"]["methods"][name] = {**summary["solve"]["methods"]["ls"], "warnings": []}
    summary["compare"] = compare(store)
    return store, summary


@pytest.mark.full
def test_many_methods_stay_readable(crowd):
    _, summary = crowd
    page = Page(write_report(*crowd))
    assert_self_contained(page)
    (square,) = re.findall(r'<table class="square">.*?</table>', page.source, re.S)
    assert square.count("<tr>") == 1 + 12
    assert square.count('class="heat"') == 12 * 11
    # Each name once in the chart; the one without an answer is named below, not dropped.
    (chart,) = re.findall(r'<figure class="speed">(.*?)</figure>', page.source, re.S)
    names = re.findall(r'class="name"[^>]*>([^<]*)</text>', chart)
    assert sorted([*names, "silent"]) == sorted(summary["solve"]["methods"])
    assert "silent: no normal where the truth is known" in page.texts["time"]
    # One panel a method in the histograms.
    (panels,) = re.findall(r'aria-label="Histogram of the angular error.*?</svg>', page.source, re.S)
    assert all(f">{name}</text>" in panels for name in names)


@pytest.mark.full
def test_the_four_ways_are_told_of_ambiguous_methods_and_only_raw_is_in_the_errors(crowd):
    store, summary = crowd
    methods = summary["compare"]["methods"]
    ambiguous = ("rpca", "ldr", "entropy", "tv", "Learned")
    assert {name for name in methods if "real_four_ways" in methods[name]} == set(ambiguous)
    for name in ambiguous:
        ways = methods[name]["real_four_ways"]
        assert ways["raw_deg"] == pytest.approx(methods[name]["real"]["mean_deg"], rel=1e-3)
        assert ways["oracle_linear_deg"] < ways["raw_deg"] - 0.5, "a common turn is linear"
    text = Page(write_report(store, summary)).texts["statistics"]
    part = text[text.index("What their ambiguity costs") :]
    for name in ambiguous:
        ways = methods[name]["twin_four_ways"]
        keys = ("raw_deg", "best_sign_deg", "oracle_relief_deg", "oracle_linear_deg")
        assert f"{name} twin{''.join(f'{ways[key]:.2f}' for key in keys)}right" in part
    assert "ls twin" not in part


@pytest.mark.full
def test_a_large_session_stays_below_ten_megabytes(tmp_path):
    """Noise everywhere: nothing compresses, no real session is larger."""
    rng, store = np.random.default_rng(3), Store(tmp_path / "large")
    height, width, count = 525, 700, 100
    codes = rng.integers(2048, 62048, (count, height, width, 3), dtype=np.uint16)
    names = tuple(f"flash_{i:03d}" for i in range(count))
    store.save_frames(Frames(names, codes, np.ones(count)))
    normals = unit(rng.normal(0, 1, (height, width, 3)) + [0, 0, 2])
    store.save_truth(normals, np.full((height, width), 0.1))
    store.save_mask(np.ones((height, width), bool))
    camera = Camera(width, height, 900.0, 900.0, 350.0, 262.0)
    store.save_camera(camera)
    store.save_spheres([], camera)
    store.save_lights(lights_along(spiral(np.full(count, 0.8)), np.ones((count, 3))))
    methods = ("ls", "rpca", "iterative", "hsh", "ldr", "entropy", "tv")
    for name in methods:
        for place in ("normals", "twin/normals"):
            path = store.path(place, f"{name}.npy")
            path.parent.mkdir(parents=True, exist_ok=True)
            np.save(path, unit(rng.normal(0, 1, (height, width, 3)) + [0, 0, 2]).astype(np.float32))
    path = write_report(store, {"compare": compare(store)})
    # Three on the first screen, the frames, the outline, sigma, key ball, truth and methods, errors.
    assert len(Page(path).all("img")) == 3 + count + 1 + 1 + 1 + 15 + 14
    assert path.stat().st_size < 10e6
