"""A photograph of a draft put to another use, where it can have it."""

from pathlib import Path

from capture.session.globs import natural_key
from capture.survey.folder_files import FEWEST
from capture.survey.small_pictures import Small
from scene.errors import SceneError
from shoot.init.draft import Draft

BOARD, UNUSED = "board", "not used"


def role_of(draft: Draft, path: Path) -> str:
    """Return what a photograph is used for."""
    return next((role for role, paths in draft.photographs.items() if path in paths), UNUSED)


def with_role(draft: Draft, small: dict[Path, Small], path: Path, role: str) -> Draft:
    """Return a draft with a photograph used for something else.

    Raises SceneError: too few flash frames would be left, it is of another size, or it is one of a board.
    """
    was = role_of(draft, path)
    if role == was:
        return draft
    if BOARD in (role, was):
        raise SceneError(
            f"{path.name}: a board's shots are found by themselves. Put three or more that show all of it into a "
            "folder called board, or others out of it, and look at the folder again."
        )
    if "flash" in (role, was) and any(ball.frames for ball in draft.manifest.spheres):
        raise SceneError(
            f"{path.name}: the balls that were shot apart have one photograph for each flash frame. Name it under "
            "frames.skip in session.toml, which leaves out theirs, too."
        )
    photographs = {one: [other for other in paths if other != path] for one, paths in draft.photographs.items()}
    if role != UNUSED:
        photographs[role] = sorted([*photographs.get(role, []), path], key=natural_key)
    if len(photographs["flash"]) < FEWEST:
        raise SceneError(f"{path.name}: {FEWEST} flash frames are the fewest. Leave it, or add others first.")
    size = small[path].width, small[path].height
    if role != UNUSED and size != (draft.width, draft.height):
        raise SceneError(f"{path.name}: {size[0]} x {size[1]} px; the flash frames: {draft.width} x {draft.height}.")
    return draft.with_photographs(photographs)
