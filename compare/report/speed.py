"""What of a summary is charted as speed against accuracy, and why the rest is not."""

from compare.report.facts import Summary, family
from compare.report.page import is_number
from draw.speed_chart import SpeedPoint


def seconds_per_megapixel_image(row: Summary, kind: str) -> float | None:
    """Return a method's processor seconds for a million pixels of one frame; `row` of summary's solve.methods."""
    if kind == "real":
        seconds = row.get("processor_seconds_per_megapixel_image")
        return seconds if is_number(seconds) else None
    seconds, megapixels, frames = row.get("twin_processor_seconds"), row.get("megapixels"), row.get("frames")
    if is_number(seconds) and is_number(megapixels) and is_number(frames) and megapixels * frames > 0:
        return seconds / (megapixels * frames)
    return None


def speed_points(summary: Summary) -> tuple[list[SpeedPoint], list[tuple[str, str]]]:
    """Return what can be charted, and what cannot: (method, why), every method in one of the two or in both.

    `summary` is as in summary.json; of it solve.methods and compare.
    """
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    errors = compared.get("methods") or {}
    any_twin = any((row or {}).get("twin") for row in errors.values())
    points, missing = [], []
    for method in dict.fromkeys([*solved, *errors]):
        row, error = solved.get(method) or {}, errors.get(method) or {}
        for kind, words in (("real", ""), ("twin", " on the twin")):
            median, seconds = (error.get(kind) or {}).get("median_deg"), seconds_per_megapixel_image(row, kind)
            if is_number(median) and is_number(seconds) and min(median, seconds) > 0:
                points.append(SpeedPoint(method, family(method), kind, seconds, median))
            elif kind == "twin" and not any_twin:
                continue
            elif not compared.get("has_truth"):
                missing.append((method, "there is no ground truth to tell an error"))
            elif not is_number(median):
                missing.append((method, f"no normal{words} where the truth is known"))
            elif not is_number(seconds):
                missing.append((method, f"no time{words} is in the summary"))
            else:
                missing.append((method, f"a median error or a time{words} of zero has no place on logarithmic axes"))
    return points, missing
