"""The benchmark's experiments on real things, as virtual captures against their renderings: do methods fail alike?"""

import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark_findings import verdict_of
from benchmarks.harness import Figures, Scale, Table, markdown
from benchmarks.virtual_lab import BALLS, CENTRE_MM, VIRTUAL_EXPERIMENTS, Experiment, Setup
from benchmarks.virtual_pairs import against_the_lab, process_capture, write_rendering
from compare.statistics.counterparts import compare_counterparts
from draw.line_chart import line_chart
from experiments.compare_folders import error_maps, open_folder
from experiments.stagings import CALIBRATED, SOLVERS
from scene.clock import now, since
from scene.lights import known_median
from scene.store import Store

CHARTED = ("ls", "iterative", "hsh")
"""In the charts: each twice, virtual and rendered."""
MAPPED = ("ls", "iterative")
"""Whose error maps are correlated: the plainest method, and the one that errs least in the benchmark."""
ANSWERS = ("alike", "alike in part", "not alike")
ALIKE = 0.7
"""Correlation from which on two error maps count as similar."""
LEAST_DEG = 1.0
"""Errors that differ by less are not told apart."""


@dataclass(frozen=True)
class PairRow:
    """One setup: median errors of each method on the virtual capture and on the rendering, and how alike they are.

    `setup`: the fields of `Setup` in their order. `ls_told_deg`: of the capture, by the lights found, with the object
    at its true distance. `maps`: correlation of the error maps of `MAPPED`. `apart_deg`: the 95 % interval of the first
    one's medians' difference. `verdict`: of `rgbn compare`.
    """

    setup: tuple
    methods: tuple[str, ...]
    virtual_deg: tuple[float, ...]
    rendered_deg: tuple[float, ...]
    lights_off_deg: float
    lights_sigma_deg: float
    ls_told_deg: float
    spearman: float
    maps: tuple[float, ...]
    apart_deg: tuple[float, float]
    verdict: str
    processor_s: float

    def both(self, method: str) -> tuple[float, float]:
        """Return a method's median error on the capture and on the rendering."""
        at = self.methods.index(method)
        return self.virtual_deg[at], self.rendered_deg[at]


def _compared(methods: tuple[str, ...], *fields: Any) -> list[PairRow]:
    from scipy.stats import spearmanr

    setup, start = Setup(*fields), now()
    with tempfile.TemporaryDirectory() as place:
        capture, rendering = Path(place) / "capture", Path(place) / "rendering"
        process_capture(Path(place) / "session", capture, setup, methods)
        write_rendering(rendering, setup, methods)
        found = compare_counterparts(*(error_maps(open_folder(one), methods) for one in (capture, rendering)))
        off_deg, told_deg = against_the_lab(setup, Store(capture))
        sigma_deg = known_median(Store(capture).load_lights().direction_sigma_deg)
    virtual, rendered = (
        tuple(found["methods"][name][side]["median_deg"] for name in methods) for side in ("real", "twin")
    )
    maps = tuple(found["methods"][name]["pearson"] or np.nan for name in MAPPED)
    low, high = (found["methods"][MAPPED[0]][f"median_difference_{end}_deg"] for end in ("low", "high"))
    return [
        PairRow(
            fields, methods, virtual, rendered, off_deg, sigma_deg or np.nan, told_deg,
            float(np.asarray(spearmanr(virtual, rendered))[0]), maps, (low, high), found["verdict"],
            since(start)["processor_seconds"],
        )
    ]  # fmt: skip


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [((*MAPPED, "ldr"), *asdict(Setup(frames=6)).values())]
    setups = dict.fromkeys(setup for one in VIRTUAL_EXPERIMENTS for setup in one.setups())
    if scale == "gates":
        setups = [Setup(), Setup("cardboard", 90.0)]
    return [(tuple(SOLVERS), *asdict(setup).values()) for setup in setups]


def _by_experiment(rows: Sequence[PairRow]) -> dict[str, list[PairRow]]:
    """Return the rows of each experiment that is there whole, level by level; experiments share setups."""
    there = {row.setup: row for row in rows}
    wanted = {one.name: [tuple(asdict(setup).values()) for setup in one.setups()] for one in VIRTUAL_EXPERIMENTS}
    return {name: [there[key] for key in keys] for name, keys in wanted.items() if all(key in there for key in keys)}


def _levels(one: Experiment, rows: Sequence[PairRow]) -> str:
    """Return an experiment's table: a line a level."""
    lines = [
        {
            **vars(row), "level": level if isinstance(level, str) else f"{level:g}",
            **{name: "{:.1f} / {:.1f}".format(*row.both(name)) for name in row.methods},
            "maps": " / ".join(f"{value:.2f}" for value in row.maps),
            "apart": "{:.1f} to {:.1f}".format(*row.apart_deg),
        }
        for level, row in zip(one.levels, rows, strict=True)
    ]  # fmt: skip
    columns = {one.axis: "{level}"} | {name: f"{{{name}}}" for name in rows[0].methods}
    columns |= {
        "ls, distance told": "{ls_told_deg:.1f}", "lights: off, sigma": "{lights_off_deg:.2f}, {lights_sigma_deg:.2f}",
        "rank correlation": "{spearman:.2f}", f"maps of {' / '.join(MAPPED)}": "{maps}",
        f"{MAPPED[0]}, medians apart": "{apart}", "verdict": "**{verdict}**",
    }  # fmt: skip
    return f"**{one.label}**\n\n{markdown(columns, lines)}"


def _summary(rows: Sequence[PairRow]) -> str:
    """Return how often each verdict came out, and medians over all pairs."""
    counts = markdown(
        {f"{len(rows)} pairs": "fail alike"} | {answer: f"{{{answer}}}" for answer in ANSWERS},
        [dict.fromkeys(ANSWERS, 0) | Counter(row.verdict for row in rows)],
    )
    of = _figures(rows)
    behind_mm = CENTRE_MM[2] - np.mean([center[2] for _, _, center in BALLS])
    return (
        f"{counts}\nMedians over the pairs:\n\n"
        f"- correlation of the two error maps: {of['maps, ls']:.2f} (`ls`), {of['maps, iterative']:.2f} (`iterative`)\n"
        f"- rank correlation of the methods: {of['rank correlation']:.2f}\n"
        f"- error of the lights' directions: {of['lights_off_deg']:.2f}°\n"
        f"- error of `ls` on the capture against the rendering: {of['ls, apart_deg']:.1f}° apart; "
        f"{of['ls, distance told, apart_deg']:.1f}° apart with the object at its true distance. Without a scan it is "
        f"taken to stand amid the balls, {behind_mm:.0f} mm further away.\n"
    )


def _apart(rows: Sequence[PairRow]) -> tuple[float, float]:
    """Return by how much `ls` errs differently on both sides, as found and with the object's distance told; medians."""
    found = [abs(np.subtract(*row.both("ls"))) for row in rows]
    return float(np.median(found)), float(np.median([abs(row.ls_told_deg - row.both("ls")[1]) for row in rows]))


def _statements(results: dict[str, list[PairRow]]) -> str:
    """Return the statements of the benchmark's section 4, when each counts as so, and what the pairs say."""

    def rises(name: str) -> tuple[bool, str]:
        ends = np.mean([[results[name][at].both(one) for one in CALIBRATED] for at in (0, -1)], 1).T
        told = ", ".join(
            f"{a:.1f} to {b:.1f}° {side}" for (a, b), side in zip(ends, ("virtual", "rendered"), strict=True)
        )
        return bool((ends[:, 1] - ends[:, 0] >= LEAST_DEG).all()), told

    pairs = [*results["spheres"], *results["cardboard"]]
    differ = sum(row.verdict == ANSWERS[-1] for row in pairs)
    middle = float(np.nanmedian([row.maps[0] for row in pairs]))
    apart, told = _apart(results["ring"])
    rule = f"the calibrated methods' mean is {LEAST_DEG:g}° greater at the last level than at the first, on both sides"
    said = (
        (
            "Error patterns of real and synthetic are similar (spheres, folded card).",
            f"the error maps of `ls` correlate by {ALIKE:g} (median), and no pair is not alike",
            (middle >= ALIKE and not differ, f"correlation {middle:.2f}; {differ} of {len(pairs)} not alike"),
        ),
        ("Errors grow with the ambient light of the room.", rule, rises("ambient")),
        ("Folded cards: the errors grow as the angle closes.", rule, rises("cardboard")),
        ("A higher ISO, more noise and greater errors.", rule, rises("iso")),
        (
            "A ring held by hand varies from the synthetic one.", f"`ls` differs by {LEAST_DEG:g}° or more",
            (apart >= LEAST_DEG, f"`ls` {apart:.1f}° apart (median)"),
        ),
        (
            "Uneven positions of the flash are the likely cause.",
            "with the lights as found, and the object's distance told, half of the difference is left",
            (told >= apart / 2, f"`ls` {apart:.1f}° apart, {told:.1f}° with the distance told (medians)"),
        ),
    )  # fmt: skip
    lines = [{"claim": a, "rule": b, "here": words, "verdict": verdict_of([so])} for a, b, (so, words) in said]
    columns = {"the benchmark says": "{claim}", "counts as so if": "{rule}", "here": "{here}"}
    return markdown(columns | {"verdict": "**{verdict}**"}, lines)


def _shown(rows: Sequence[PairRow]) -> str:
    results = _by_experiment(rows)
    parts = [_levels(one, results[one.name]) for one in VIRTUAL_EXPERIMENTS if one.name in results]
    whole = len(results) == len(VIRTUAL_EXPERIMENTS)
    charts = [f"![{one.label}](virtual-{one.name}.svg)\n" for one in VIRTUAL_EXPERIMENTS] if whole else []
    return "\n".join([_summary(rows), *([_statements(results)] if whole else []), *parts, *charts])


def _figures(rows: Sequence[PairRow]) -> Figures:
    apart, told = _apart(rows)
    found = {"ls, apart_deg": apart, "ls, distance told, apart_deg": told}
    found |= {f"maps, {name}": float(np.nanmedian([row.maps[at] for row in rows])) for at, name in enumerate(MAPPED)}
    found["rank correlation"] = float(np.nanmedian([row.spearman for row in rows]))
    return found | {key: float(np.nanmedian([getattr(row, key) for row in rows])) for key in ("lights_off_deg",)}


def _charts(rows: Sequence[PairRow]) -> dict[str, str]:
    results, drawn = _by_experiment(rows), {}
    for one in VIRTUAL_EXPERIMENTS if len(results) == len(VIRTUAL_EXPERIMENTS) else ():
        names = [level for level in one.levels if isinstance(level, str)]
        levels = list(map(float, range(len(names)) if names else one.levels))
        lines = {
            f"{name}, {words}": (levels, [row.both(name)[side] for row in results[one.name]])
            for name in CHARTED
            for side, words in enumerate(("virtual", "rendered"))
        }
        drawn[f"virtual-{one.name}.svg"] = line_chart(
            lines, x_title=one.axis, y_title="median angular error, degrees", log_x=one.log, x_names=names
        )
    return drawn


TABLES = (
    Table(
        "counterparts", "pairs", ("compare.statistics.counterparts", "lab.run", "twin.twin_session"), PairRow,
        _cases, _compared, _shown, _figures, _charts,
    ),
)  # fmt: skip
