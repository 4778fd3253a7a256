"""Every method's normals against the scan's, on the photographs and on their twin."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import family, map_of, method_names, read_optional, sphere_rows, there
from compare.report.pictures import colour_scale_end, error_picture, with_colour_scale
from compare.statistics.counterparts import difference, level_methods, sampling_step, thinned
from compare.statistics.frames_alike import frames_alike
from compare.statistics.statistics import (
    COVERAGE,
    LOW_RANK,
    albedo_statistics,
    angular_statistics,
    four_ways,
)
from scene.files import write_npy, write_png
from scene.map_pictures import known_pixels
from scene.normals import angular_error_deg
from scene.store import Store

BAND_PIXELS = 1 << 21
"""Pixels worked on at a time: float64 crosses of a whole 24-megapixel map would take gigabytes."""
LEAST_SHARE = 0.9
"""Of the object, that must lie within a tolerance."""
PLACES = {"real": "normals", "twin": "twin/normals"}

Normals = NDArray[np.float32]
Mask = NDArray[np.bool_]


def compare(
    store: Store, *, methods: Sequence[str] | None = None, tolerance_deg: float | None = None
) -> dict[str, Any]:
    """Compare all estimates in the output folder with the truth in it, and write error maps to compare/.

    Parameters
    ----------
    store : Store
        Reads normals/truth.npy, normals/truth_sigma.npy, normals/<method>.npy, twin/normals/<method>.npy,
        twin/albedo/<method>.npy, twin/truth_albedo.npy and mask.png; none of them is required. Writes
        compare/error_{real,twin}_<method>.npy, (H, W) float32 degrees, NaN where unknown, and .png with its colour
        scale drawn below.
    methods : sequence of str, optional
        The methods of this run. Without it, all whose normals are in the folder; an older run's may be among them.
    tolerance_deg : float, optional
        The error that the user's purpose allows.

    Returns
    -------
    dict
        has_truth; truth: pixels, sigma_deg_median, sigma_deg_q3 (or None); mask_pixels; methods, by name:
        real and twin (`angular_statistics`, or None; of the twin `albedo_statistics` too), coverage and twin_coverage
        (share of the true pixels that were answered), pearson, spearman, correlation_pixels, median_difference_deg
        with its interval's ends, median_difference_low_deg and median_difference_high_deg
        (`compare.statistics.counterparts.difference`),
        real/twin_within_tolerance (share of the true pixels, where a tolerance is given, rounded down to a tenth
        of a percent: it is judged as it is shown), real/twin_rotation_deg (the
        turn common to all normals) and real/twin_median_unrotated_deg (the median error
        once it is undone), real/twin_four_ways (`four_ways`, of methods that leave an ambiguity and of other programs),
        median_to_others_deg (the median of its median angles to the other methods), histogram (pixels per bin, the
        last one: beyond the last edge), median_sigma_deg (of the median on the photographs); level: best, and the
        methods that are level with it (`level_methods`); tolerance: deg; method and share, the method that has most of
        the object within it, and how much (unanswered pixels are not); least_share, what is asked for; passes; None
        without a tolerance or a truth; histogram_edges_deg; error_scale_deg (the colour scale's end);
        frames_alike: psnr_db and ssim of the photographs and their twins (`frames_alike`);
        between_methods: a, b, pixels and statistics of the angle between each two methods on the real frames; lights,
        spheres, pose for the report; notes (plain statements, such as that there is no truth); warnings.

    """
    names = [name for name in method_names(store) if methods is None or name in methods]
    mask = store.load_mask() if store.path("mask.png").exists() else None
    truth = map_of(store, "normals", "truth")
    between, twin = _between_methods(store, names, mask), Store(store.path("twin"))
    has_twin = twin.path("frames", "frames.json").exists()
    result: dict[str, Any] = {
        "has_truth": truth is not None,
        "truth": None,
        "mask_pixels": None if mask is None else int(mask.sum()),
        "methods": {name: {"real": None, "twin": None, "median_to_others_deg": None} for name in names},
        "level": {"best": None, "level": []},
        "tolerance": None,
        "histogram_edges_deg": None,
        "error_scale_deg": None,
        "between_methods": between,
        "lights": there(lambda: store.load_lights().facts()),
        "spheres": sphere_rows(store),
        "pose": read_optional(store, "pose.json"),
        "frames_alike": frames_alike(store.load_frames(), twin.load_frames(), mask)
        if has_twin and mask is not None
        else None,
        "notes": [],
        "warnings": [],
    }
    for name, row in result["methods"].items():
        if apart := [pair["median_deg"] for pair in between if name in (pair["a"], pair["b"])]:
            row["median_to_others_deg"] = float(np.median(apart))
    if truth is None:
        # A plain statement: that there is no truth was warned of where it should have come from.
        result["notes"].append(
            "no ground truth (normals/truth.npy): errors cannot be told; only the differences between methods are "
            "given, and agreement between methods is not accuracy"
        )
    elif names:
        result["truth"] = _truth_facts(store, truth, mask)
        if result["truth"]["pixels"] == 0:
            result["warnings"].append(
                "ground truth: not one pixel of it lies on the object's mask; no error can be given"
            )
        maps: dict[tuple[str, str], NDArray[np.float32]] = {}
        for name in names:
            maps |= _errors(store, name, truth, mask, result, tolerance_deg)
        if maps:
            # The median over maps: one method that fails everywhere must not darken all the others.
            spread = [float(np.nanquantile(error, 0.95)) for error in maps.values()]
            _histograms(store, result, maps, colour_scale_end(float(np.median(spread))))
            real = {name: thinned(error) for (name, kind), error in maps.items() if kind == "real"}
            result["level"] = level_methods(real, result["truth"]["sigma_deg_median"])
            for name, sigma in result["level"].pop("median_sigma_deg").items():
                result["methods"][name]["median_sigma_deg"] = sigma
            result["tolerance"] = None if tolerance_deg is None else _tolerance(result["methods"], tolerance_deg)
    return result


def _errors(
    store: Store, name: str, truth: Normals, mask: Mask | None, result: dict[str, Any], tolerance_deg: float | None
) -> dict[tuple[str, str], NDArray[np.float32]]:
    """Write a method's error maps and fill in its row; return the maps, as they are on the disk, by (method, kind)."""
    row, maps, written, pixels = result["methods"][name], {}, {}, result["truth"]["pixels"]
    for kind, place in PLACES.items():
        estimate = map_of(store, place, name)
        if estimate is None:
            continue
        error = maps[kind] = _error_map(estimate, truth, mask)
        statistics = angular_statistics(error)
        if statistics["pixels"] == 0:
            result["warnings"].append(f"{name} ({kind}): no pixel is known both to the method and to the truth")
            continue
        row[kind] = statistics | _albedo_statistics(store, kind, name, mask)
        row[COVERAGE[kind]] = statistics["pixels"] / pixels if pixels else None
        angle, median = _without_common_rotation(estimate, truth, error)
        row[f"{kind}_rotation_deg"], row[f"{kind}_median_unrotated_deg"] = angle, median
        if name in LOW_RANK or family(name) == "external":
            row[f"{kind}_four_ways"] = four_ways(estimate, truth, mask)
        if tolerance_deg is not None:
            row[f"{kind}_within_tolerance"] = 1000 * np.count_nonzero(error <= tolerance_deg) // pixels / 1000
        write_npy(store.path("compare", f"error_{kind}_{name}.npy"), error)
        written[name, kind] = store.read_array("compare", f"error_{kind}_{name}.npy")
    if len(maps) == 2:
        shared = difference(maps["real"], maps["twin"])
        row |= {"correlation_pixels": shared.pop("pixels"), **shared}
    return written


def _albedo_statistics(store: Store, kind: str, name: str, mask: Mask | None) -> dict[str, float]:
    """Return how far a method's albedo is off where the truth is known: on the twin alone."""
    found, truth = map_of(store, "twin/albedo", name), map_of(store, "twin", "truth_albedo")
    if kind != "twin" or found is None or truth is None:
        return {}
    return albedo_statistics(*(one.reshape(-1, 3) if mask is None else one[mask] for one in (found, truth)))


def _histograms(
    store: Store, result: dict[str, Any], maps: dict[tuple[str, str], NDArray[np.float32]], end: float
) -> None:
    """Fill in the histograms and write the pictures, all on one scale."""
    edges = np.linspace(0, end, 61)
    result["error_scale_deg"], result["histogram_edges_deg"] = end, edges.tolist()
    for row in result["methods"].values():
        row["histogram"] = {}
    for (name, kind), error in maps.items():
        counts = np.histogram(error[np.isfinite(error)], np.append(edges, np.inf))[0]
        result["methods"][name]["histogram"][kind] = counts.tolist()
        picture = with_colour_scale(
            error_picture(error, end), end, f"angular error, {name}, {kind}; pale grey: unknown"
        )
        write_png(store.path("compare", f"error_{kind}_{name}.png"), picture)


def _tolerance(rows: dict[str, dict[str, Any]], tolerance_deg: float) -> dict[str, Any] | None:
    """Return how much of the object is within a tolerance, by the method that has most of it there; None of none."""
    shares = {name: row["real_within_tolerance"] for name, row in rows.items() if row["real"]}
    if not shares:
        return None
    method = max(shares, key=lambda name: shares[name])
    return {
        "deg": tolerance_deg, "method": method, "share": shares[method], "least_share": LEAST_SHARE,
        "passes": shares[method] >= LEAST_SHARE,
    }  # fmt: skip


def _error_map(a: Normals, b: Normals, mask: Mask | None) -> NDArray[np.float32]:
    error, step = np.full(a.shape[:2], np.nan, np.float32), max(1, BAND_PIXELS // a.shape[1])
    for rows in (slice(start, start + step) for start in range(0, len(error), step)):
        counted = slice(None) if mask is None else mask[rows]
        error[rows][counted] = angular_error_deg(a[rows][counted], b[rows][counted])
    return error


def _without_common_rotation(
    estimate: Normals, truth: Normals, error: NDArray[np.float32]
) -> tuple[float | None, float | None]:
    """Return the turn common to all normals, degrees, and the median error that is left once it is undone [Kabsch1976].

    None where the normals all but share one direction: the turn about it cannot be seen.
    """
    from scipy.spatial.transform import Rotation

    step = sampling_step(error.size)
    found, true, left = (one[::step, ::step].astype(np.float64) for one in (estimate, truth, error))
    # The worst quarter is left out: shadows and highlights are not what turns a whole map.
    known = np.isfinite(left)
    tells = left <= np.quantile(left[known], 0.75) if known.any() else known
    spread = np.linalg.svd(true[tells].T @ found[tells], compute_uv=False)
    if not spread[1] > 0.01 * spread[0]:
        return None, None
    rotation = Rotation.align_vectors(true[tells], found[tells])[0]
    left = angular_error_deg(rotation.apply(found[known]), true[known])
    return float(np.degrees(rotation.magnitude())), float(np.median(left))


def _truth_facts(store: Store, truth: Normals, mask: Mask | None) -> dict[str, Any]:
    known = known_pixels(truth) if mask is None else known_pixels(truth) & mask
    facts: dict[str, Any] = {"pixels": int(known.sum()), "sigma_deg_median": None, "sigma_deg_q3": None}
    sigma = map_of(store, "normals", "truth_sigma")
    if sigma is not None:
        sigma = sigma[known & np.isfinite(sigma)]
        if sigma.size:
            facts["sigma_deg_median"], facts["sigma_deg_q3"] = map(float, np.quantile(sigma, [0.5, 0.75]))
    return facts


def _between_methods(store: Store, names: list[str], mask: Mask | None) -> list[dict[str, Any]]:
    """Return the statistics of the angle between each two methods' normals of the real frames."""
    maps = {name: normals for name in names if (normals := map_of(store, "normals", name)) is not None}
    found = ((a, b, angular_statistics(_error_map(maps[a], maps[b], mask))) for a, b in combinations(maps, 2))
    return [{"a": a, "b": b, **statistics} for a, b, statistics in found if statistics["pixels"]]
