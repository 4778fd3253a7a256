"""What the page of the virtual counterparts shows: the verdict in one paragraph, a table an experiment, error maps."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from benchmarks.virtual_lab import BALLS, CENTRE_MM, Experiment
from benchmarks.virtual_pairs import METHODS, Pair, level_name
from compare.report.line_chart import line_chart
from compare.report.pictures import Box, Image, colour_scale_end, enlarged, error_picture, with_colour_scale
from experiments.compare_folders import error_maps, open_folder

CHARTED = ("ls", "iterative", "hsh")
"""In the charts: each twice, virtual and rendered."""
MAPPED = ("ls", "iterative")
"""Whose error maps are shown and correlated: the plainest method, and the one that errs least in the benchmark."""
SHOWN = (("spheres", "matte"), ("spheres", "gloss-0.1"), ("cardboard", "90"))
"""Experiment and level of the pairs whose error maps are shown."""
SURE_DEG = 1.0
"""Lights whose stated sigma is below count as known."""
TIMES, GAP_PX, TITLE_PX = 2, 12, 26
ANSWERS = ("alike", "not shown", "differ")

Results = Mapping[str, Sequence[Pair]]
"""By the experiment's name."""


def chart(experiment: Experiment, pairs: Sequence[Pair]) -> str:
    """Return the SVG of both sides' errors over the level."""
    names = [pair.level for pair in pairs if isinstance(pair.level, str)]
    levels = [float(place) if names else float(pair.level) for place, pair in enumerate(pairs)]
    lines = {
        f"{name}, {words}": (levels, [pair.medians(kind)[name] for pair in pairs])
        for name in CHARTED
        for kind, words in (("real", "virtual"), ("twin", "rendered"))
    }
    return line_chart(
        lines,
        x_title=experiment.axis,
        y_title="median angular error, degrees",
        log_x=experiment.log,
        x_names=names,
    )


def rows(experiment: Experiment, pairs: Sequence[Pair]) -> list[str]:
    """Return an experiment's table: a line a level."""
    head = [experiment.axis, *METHODS, "ls, distance told", "lights: off, sigma"]
    head += ["rank correlation", "tau, 90 %", f"maps of {' / '.join(MAPPED)}", "size", "place", "order", "verdict"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for pair in pairs:
        real, twin, order = pair.medians("real"), pair.medians("twin"), pair.found["order"]
        fields = [level_name(pair.level), *(f"{real[name]:.1f} / {twin[name]:.1f}" for name in METHODS)]
        fields += [f"{pair.known['ls_deg']:.1f}", f"{pair.known['lights_off_deg']:.2f}, {pair.sigma_deg:.2f}"]
        fields += [f"{pair.spearman:.2f}", f"{order['tau']:.2f}, {order['tau_low']:.2f} to {order['tau_high']:.2f}"]
        fields += [" / ".join(f"{pair.correlation(name):.2f}" for name in MAPPED)]
        fields += [pair.found["reasons"][key] for key in ("level", "pattern", "order")]
        lines.append("| " + " | ".join([*fields, f"**{pair.found['verdict']}**"]) + " |")
    return lines


def block(experiment: Experiment, pairs: Sequence[Pair]) -> list[str]:
    """Return an experiment's part of the page."""
    spent_min = sum(pair.processor_s for pair in pairs) / 60
    title = f"{experiment.label}: error over the level, virtual and rendered"
    lines = [f"### {experiment.label} (virtual)", "", *rows(experiment, pairs), ""]
    return [*lines, f"{spent_min:.1f} processor minutes.", "", f"![{title}](virtual-{experiment.name}.svg)", ""]


def distinct(experiments: Sequence[Experiment], results: Results) -> list[Pair]:
    """Return the pairs of all experiments, each setup's once: the easiest level of three is the same plain sphere."""
    of = {}
    for experiment in experiments:
        for (_, setup), pair in zip(experiment.setups(), results[experiment.name], strict=True):
            of.setdefault(setup, pair)
    return list(of.values())


def numbers(pairs: Sequence[Pair]) -> dict[str, float]:
    """Return what the verdict says in numbers.

    By answer, `verdict`, `level`, `pattern` and `order` before it with a colon: how many pairs. spearman: median rank
    correlation of the methods. pearson:METHOD, pearson_low:METHOD, pearson_high:METHOD: median and quartiles of the
    correlation of its two error maps. sure: how many pairs have lights of a stated sigma below `SURE_DEG`; of these,
    medians: apart_deg, by how much `ls` errs differently on capture and rendering; told_deg, the same where the
    capture's object stands at its true distance; lights_off_deg.
    """
    found: dict[str, float] = {"pairs": len(pairs), "spearman": float(np.nanmedian([pair.spearman for pair in pairs]))}
    for question in ("verdict", "level", "pattern", "order"):
        given = [pair.found["verdict"] if question == "verdict" else pair.found["reasons"][question] for pair in pairs]
        counted = Counter(given)
        found |= {f"{question}:{answer}": counted[answer] for answer in ANSWERS}
    for name in MAPPED:
        quartiles = np.nanquantile([pair.correlation(name) for pair in pairs], [0.25, 0.5, 0.75])
        for key, value in zip(("pearson_low", "pearson", "pearson_high"), quartiles, strict=True):
            found[f"{key}:{name}"] = float(value)
    sure = [pair for pair in pairs if pair.sigma_deg < SURE_DEG]
    apart = [abs(pair.medians("real")["ls"] - pair.medians("twin")["ls"]) for pair in sure]
    told = [abs(pair.known["ls_deg"] - pair.medians("twin")["ls"]) for pair in sure]
    off = [pair.known["lights_off_deg"] for pair in sure]
    found["sure"] = len(sure)
    for key, values in (("apart_deg", apart), ("told_deg", told), ("lights_off_deg", off)):
        found[key] = float(np.median(values)) if values else np.nan
    return found


def curves(results: Results) -> dict[str, float]:
    """Return, by experiment, the correlation of the median errors of `ls`, virtual and rendered, over the levels."""
    found = {}
    for name, pairs in results.items():
        real, twin = ([pair.medians(kind)["ls"] for pair in pairs] for kind in ("real", "twin"))
        found[name] = float(np.corrcoef(real, twin)[0, 1])
    return found


def verdict(pairs: Sequence[Pair], along: Mapping[str, float], made_at: str) -> str:
    """Return the paragraph that sums all tables up; along: `curves`; made_at: of which code they are."""
    of = numbers(pairs)

    def counted(question: str, words: Sequence[str] = ANSWERS) -> str:
        return ", ".join(f"{of[f'{question}:{key}']:.0f} {word}" for key, word in zip(ANSWERS, words, strict=True))

    maps = " and ".join(
        f"{of[f'pearson:{name}']:.2f} (`{name}`; quartiles {of[f'pearson_low:{name}']:.2f} and "
        f"{of[f'pearson_high:{name}']:.2f})"
        for name in MAPPED
    )
    behind_mm = CENTRE_MM[2] - np.mean([center[2] for _, _, center in BALLS])
    sentences = [
        f"**Of {of['pairs']:.0f} pairs, virtual capture against rendering, {counted('verdict')}.**",
        f"Are the errors at the same places: {counted('pattern')}; the median correlation of the two error maps is "
        f"{maps}.",
        f"Do the methods rank alike: {counted('order')}; the median rank correlation of the seven methods' median "
        f"errors is {of['spearman']:.2f}.",
        f"Are the errors as large: {counted('level')}.",
        f"In the {of['sure']:.0f} pairs whose lights have a stated sigma under {SURE_DEG:g}° (they are off by "
        f"{of['lights_off_deg']:.2f}°, median), the median error of `ls` differs by {of['apart_deg']:.1f}° (median), "
        f"and by {of['told_deg']:.1f}° where the capture is solved with the object at its true distance: without a "
        f"scan it is taken to stand amid the balls, which are {behind_mm:.0f} mm further from the camera.",
        "Do both sides rise and fall together from level to level: the correlation of the two curves of `ls` is "
        f"{', '.join(f'{value:.2f} ({name})' for name, value in along.items())}.",
        "The benchmark's text found, on real things, similar error patterns (its Fig. 5), and curves with some "
        "variations (Fig. 6), mainly laid to the uneven positions of a flash held by hand.",
        f"All tables, charts and maps: {made_at}.",
    ]
    return " ".join(sentences) + "\n"


def tables(experiments: Sequence[Experiment], results: Results) -> str:
    """Return error maps and all experiments' parts of the page."""
    columns = "; ".join(f"`{name}` virtual, `{name}` rendered" for name in MAPPED)
    lines = ["### Error maps", "", f"From left to right: {columns}. Each row has its own scale.", ""]
    lines += ["![Error maps of spheres and card, virtual beside rendered](virtual-maps.png)", ""]
    for experiment in experiments:
        lines += block(experiment, results[experiment.name])
    return "\n".join(lines)


def maps_picture(results: Results) -> Image:
    """Return error maps side by side: a row for each pair of `SHOWN`, two columns for each method of `MAPPED`."""
    strips = []
    for name, level in SHOWN:
        pair = next(pair for pair in results[name] if level_name(pair.level) == level)
        strips.append(_strip(f"{name}: {level}", *pair.folders))
    width = max(strip.shape[1] for strip in strips)
    padded = [
        np.pad(strip, ((0, GAP_PX), (0, width - strip.shape[1]), (0, 0)), constant_values=255) for strip in strips
    ]
    return np.concatenate(padded)


def _strip(title: str, capture: Path, rendering: Path) -> Image:
    """Return the error maps of a pair in a row, with their scale below."""
    maps = [error_maps(open_folder(folder), MAPPED) for folder in (capture, rendering)]
    box = Box.of_mask(np.isfinite(maps[0][MAPPED[0]]), margin=0.03)
    end = colour_scale_end(float(np.median([np.nanquantile(of[name], 0.95) for of in maps for name in MAPPED])))
    cells = []
    for name in MAPPED:
        for of, words in zip(maps, ("virtual", "rendered"), strict=True):
            picture = enlarged(error_picture(box.of(of[name]), end), TIMES)
            cell = np.pad(picture, ((TITLE_PX, 0), (0, GAP_PX), (0, 0)), constant_values=255)
            cv2.putText(cell, f"{name}, {words}", (2, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
            cells.append(cell)
    return with_colour_scale(np.concatenate(cells, 1), end, title)
