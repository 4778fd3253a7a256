"""A shoot under way, as `rgbn watch` tells of it: how many photographs there are, and the map of sigma turns green."""

from collections.abc import Sequence
from typing import Any

from scene.image_files import read_pixels
from scene.reading import reading
from shoot.watch.status import MAP, STATUS
from studio.review.review_window import ReviewWindow
from studio.widgets import Row, plain, text

SHOWN = 6
"""Of a shoot's warnings, the newest."""
OVER = (
    "**The shoot is over.** Its photographs are decoded; then the session is shown here. If it does not come: the "
    "terminal of `rgbn watch` says why."
)


def _shoot(window: ReviewWindow) -> dict[str, Any]:
    status = window.status
    return {"visible": isinstance(status, dict) and (window.is_alone or not status.get("is_over"))}


def shoot_text(window: ReviewWindow) -> str:
    """Return how far a shoot is, as Markdown."""
    status = window.status
    with reading(window.folder / STATUS, "is no state of a shoot", do="It is written anew by rgbn watch."):
        if status["is_over"]:
            return OVER
        lines = [f"**{int(status['flash'])} flash frames**, {int(status['ambient'])} ambient"]
        if normals := status["normals"]:
            following = normals["next_flash"]
            lines += [
                f"- sigma of the normals {float(normals['sigma_deg_median']):.2g}° (median), "
                f"{float(normals['share_under_wanted']):.0%} of the object under {float(normals['wanted_deg']):g}° "
                "(green)",
                f"- next flash: {float(following['zenith_deg']):.0f}° from the axis, azimuth "
                f"{float(following['azimuth_deg']):.0f}° (0° right, 90° up): sigma to "
                f"{float(following['sigma_deg']):.2g}°",
            ]
        return "\n".join([*lines, *(f"- **{plain(str(one))}**" for one in reversed(list(status["warnings"])[-SHOWN:]))])


def _shoot_rows(window: ReviewWindow) -> Sequence[Row]:
    path = window.folder / MAP
    picture = [Row("image", start={"image": read_pixels(path)[0], "format": "png"})] if path.is_file() else []
    return text(shoot_text), *picture


SHOOT = Row("folder", "Shoot under way", _shoot, start={"visible": False}, rows=_shoot_rows,
            key=lambda window: window.status)  # fmt: skip
