"""The cameras' settings and the files' numbers: what differs from frame to frame, and what is not there."""

import itertools
import re
from collections import Counter
from collections.abc import Sequence

from capture.camera.exif import Exif
from capture.session.session import Session


def mixed_settings(session: Session, exif: Sequence[Exif], ambient_exif: Sequence[Exif]) -> list[str]:
    """Name frames whose settings differ from what most frames have."""
    names = [*session.names, *(path.stem for path in session.ambient)]
    everyone = [*exif, *ambient_exif]
    warnings = []
    for field, label, what in (
        ("exposure_s", "exposure time {:g} s", "the shutter"),
        ("iso", "ISO {:g}", "the sensitivity"),
        ("aperture", "aperture f/{:g}", "the aperture"),
        ("focal_mm", "focal length {:g} mm", "the zoom"),
        ("camera", "camera {}", "the camera"),
    ):
        known = [(name, getattr(e, field)) for name, e in zip(names, everyone, strict=False) if getattr(e, field)]
        usual = Counter(value for _, value in known).most_common(1)
        odd = [(name, value) for name, value in known if value != usual[0][0]]
        if odd:
            shown = ", ".join(f"{name} ({label.format(value)})" for name, value in odd[:6])
            more = f" and {len(odd) - 6} more" if len(odd) > 6 else ""
            scaled = field in ("exposure_s", "iso", "aperture")
            remedy = (
                "They were scaled to the others' exposure, which holds for steady lamps; a flash is over before the "
                "shutter closes, so that time scales the ambient light only."
                if scaled
                else "The frames do not fit together."
            )
            warnings.append(
                f"{shown}{more}: the others have {label.format(usual[0][0])}. {remedy} Lock {what}, reshoot."
            )
    without = [name for name, e in zip(names, everyone, strict=False) if e.exposure is None]
    if without and len(without) < len(everyone):
        warnings.append(
            f"{', '.join(without[:6])}: no exposure in EXIF, unlike the other {len(everyone) - len(without)} frames; "
            "taken as the same exposure."
        )
    return warnings


def gaps_in_numbering(session: Session) -> list[str]:
    """Name files that a regular numbering lacks. Skipped ones are known to exist."""
    series: dict[tuple[str, str], dict[int, int]] = {}
    for name in (*session.names, *(re.sub(r"\.[A-Za-z]\w*$", "", entry) for entry in session.skip)):
        found = re.fullmatch(r"(.*?)(\d+)(\D*)", name)
        if found and len(found[2]) < 9:
            series.setdefault((found[1], found[3]), {})[int(found[2])] = len(found[2])
    warnings = []
    for (before, after), numbers in series.items():
        ordered = sorted(numbers)
        steps = Counter(b - a for a, b in itertools.pairwise(ordered))
        if not steps:
            continue
        step, times = steps.most_common(1)[0]
        missing = [n for a, b in itertools.pairwise(ordered) for n in range(a + step, b, step)]
        # Numbers that are no count (times of day, a random choice) leave far more out.
        if times < 2 or any(difference % step for difference in steps) or len(missing) > len(ordered) / 2:
            continue
        if missing:
            digits = numbers[ordered[0]] if str(ordered[0]).zfill(numbers[ordered[0]])[0] == "0" else 1
            shown = ", ".join(f"{before}{n:0{digits}d}{after}" for n in missing[:6])
            more = f" and {len(missing) - 6} more" if len(missing) > 6 else ""
            warnings.append(
                f"{shown}{more}: missing from the numbering. If a photograph was lost, copy it from the camera; "
                "a lights file that goes by order would be off by one from there."
            )
    return warnings
