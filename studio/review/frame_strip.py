"""The frames as a strip of small pictures, with what is clipped and what was warned of."""

from compare.report.picture_strip import CELL_PX, INK, Label, PictureStrip
from compare.report.pictures import thumbnail
from studio.review.folder import Review

MUCH_CLIPPED = 0.002
"""Share of a frame's pixels; a chrome ball's highlight is far less."""
CLIPPED, WARNED = (255, 60, 90), (255, 160, 0)


def frame_strip(review: Review) -> PictureStrip | None:
    """Return all frames small, one tone curve for all, each with number, name and what is clipped; None without any."""
    frames, exposure = review.material.frames, review.material.exposure
    if frames is None or exposure is None or not len(frames):
        return None
    warned = {frame for one in review.warnings for frame in one.frames}
    if review.lights is not None:
        warned |= {index for index, flags in enumerate(review.lights.flags) if flags}
    pictures = [exposure.develop(thumbnail(frames, index, CELL_PX)) for index in range(len(frames))]
    labels: list[Label] = []
    for index, name in enumerate(frames.names):
        share = None if review.clipped_share is None else review.clipped_share[index]
        if share is not None and share >= MUCH_CLIPPED:
            labels.append((f"{index + 1}  clipped {share:.1%}", CLIPPED))
        elif index in warned:
            labels.append((f"{index + 1} {name}  (!)", WARNED))
        else:
            labels.append((f"{index + 1} {name}", INK))
    return PictureStrip.of(pictures, labels)
