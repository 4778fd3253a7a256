"""The object's mask, found without clicks from the whole stack."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.mask.backdrop import Contradiction, bright_mean, bright_picture, contradict_backdrop
from align.mask.cut_out import cut_out
from align.pose.photographed import FEWEST
from align.pose.scan_view import box_of
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames, gray, shrunk
from scene.spheres import Sphere

Box = tuple[float, ...]
"""Left, top, right and bottom, pixels; the pixels' centres are integers."""
WORK_SIZE = 640
"""The search runs on block means with about this many columns; the border is then found on full pixels."""
BALL_MARGIN_PX = 4.0
FAINT = 0.25
"""What stands out from the backdrop by less than this share of the object's median (in square roots) is not of it."""
BLACK = 2.0
"""How many times the backdrop (in square roots) an object before a black cloth stands out by, at least."""
INVERTED = 0.5
"""Share of the picture's border that a given mask may hold without a word."""
LEAST_SHARE = 0.001
"""An object smaller than this share of the image is taken for dirt."""


@dataclass(frozen=True)
class ObjectMask:
    """Where the object is."""

    mask: NDArray[np.bool_]
    """(H, W)."""
    source: str
    """One of "given", "found", "scan"."""
    warnings: tuple[str, ...] = ()


def find_object(
    frames: Frames,
    camera: Camera,
    spheres: list[Sphere],
    *,
    mask_given: NDArray[np.bool_] | None = None,
    box: Box | None = None,
) -> ObjectMask:
    """Find the object: what the backdrop does not explain, near the middle, and is no ball.

    The pixels of calibration balls are no object (balls shot apart are not in the picture). `mask_given` (H, W), the
    user's, is checked, and freed of balls' pixels. Within `box`, also the user's, the object is looked for, and what
    lies beside it is backdrop, balls and other things.

    The backdrop is one smooth surface: in each frame its brightness is a smooth function of the pixel, or it
    lies in a cast shadow (`align.mask.backdrop`). The object contradicts it in many frames; its colours part it from
    what only its shadows contradict. The border is then put where each pixel's brightest quarter of frames passes
    midway between its values just inside and just outside.

    Raises
    ------
    AlignError
        The given mask is empty, too thin or of another size; the box is empty or holds all of the picture; or nothing
        stands out from the backdrop.
    """
    size = (camera.height, camera.width)
    balls = np.zeros(size, bool)
    for sphere in spheres:
        if not sphere.apart:
            balls |= sphere.mask(camera, grow_px=BALL_MARGIN_PX)
    if mask_given is not None:
        found = _checked(np.asarray(mask_given, bool), balls, size)
        _check_area(found.mask)
        return found

    factor = max(1, round(max(size) / WORK_SIZE))
    ambient = 0.0 if frames.ambient is None else shrunk(frames.ambient, factor)
    each = zip(frames.codes, frames.gain, strict=True)
    stack = np.stack([shrunk(codes, factor) * np.float32(gain) - ambient for codes, gain in each])
    height, width = stack.shape[1:3]
    balls_small = _blocks(balls, factor, height, width)
    beside = np.zeros(size, bool) if box is None else _beside(box, size)
    beside_small = _blocks(beside, factor, height, width)
    contradiction = contradict_backdrop(gray(stack), balls_small)
    balls, balls_small = balls | beside, balls_small | beside_small
    small, warnings = _choose(contradiction, balls_small, ~beside_small)
    bright = bright_mean(stack)
    bright_gray = gray(bright)
    cut = cut_out(bright, _trim(bright_gray, contradiction, small), balls_small)
    # The cut takes what the blur of the object's edge brightens for the object.
    border = _sharpen(bright_gray, cut, balls_small, reach=1)
    if factor > 1 and border.any():
        big = np.zeros(size, bool)
        blown = np.kron(border, np.ones((factor, factor), bool))
        big[: blown.shape[0], : blown.shape[1]] = blown
        reach = 2 * factor + 1
        # Nothing farther off has a say: the blur's sigma is 1.5 reaches.
        window = box_of(big, margin=10 * reach)
        border = np.zeros(size, bool)
        border[window] = _sharpen(bright_picture(frames, big)[window], big[window], balls[window], reach=reach)
    border = _one_piece(border & ~balls)
    _check_area(border)
    if len(frames) < FEWEST:
        warnings.append(
            f"mask: {len(frames)} photographs hardly tell an object from its backdrop, {FEWEST} do. Look at the "
            "outline; where it is wrong, give a box about the object, or its mask: box, mask under [object]."
        )
    cut = int((border & ~_whole(~beside)).sum())
    if cut > 4:
        reached = "the image's border" if box is None else "the border of object.box, or the image's"
        warnings.append(f"mask: the object reaches {reached} ({cut} pixels): part of it may be missing.")
    return ObjectMask(border, "found", tuple(warnings))


def _blocks(mask: NDArray[np.bool_], factor: int, height: int, width: int) -> NDArray[np.bool_]:
    """Return the blocks that hold a pixel of the mask."""
    cut = mask[: height * factor, : width * factor]
    return np.asarray(cut.reshape(height, factor, width, factor).any((1, 3)), bool)


def _checked(mask: NDArray[np.bool_], balls: NDArray[np.bool_], size: tuple[int, int]) -> ObjectMask:
    if mask.shape != size:
        raise AlignError(
            f"mask: it is {' x '.join(map(str, mask.shape[::-1]))} px, the frames are {size[1]} x {size[0]}. "
            "Save it at the frames' size."
        )
    if not mask.any():
        raise AlignError("mask: it is empty. White marks the object.")
    if mask.mean() > 0.98:
        raise AlignError(f"mask: {100 * mask.mean():.1f} % of it is white. White marks the object, black the rest.")
    border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]]).mean()
    told = f"mask: {border:.0%} of the picture's border is white. White marks the object: is the mask inverted?"
    doubts = (told,) if border > INVERTED else ()
    overlap = mask & balls
    if not overlap.any():
        return ObjectMask(mask, "given", doubts)
    rest = mask & ~balls
    if not rest.any():
        raise AlignError("mask: it lies on the calibration balls alone. White marks the object.")
    # A ball's margin may touch the object beside it: only a real overlap is worth a word.
    if overlap.sum() < 0.01 * mask.sum():
        return ObjectMask(mask, "given", doubts)
    left_out = f"mask: {overlap.sum()} of its pixels lie on calibration balls; left out."
    return ObjectMask(rest, "given", (*doubts, left_out))


def _check_area(mask: NDArray[np.bool_]) -> None:
    """Raise AlignError where no pixel of a mask has all its neighbours in it: slopes of normals need them."""
    if not _whole(mask).any():
        raise AlignError(
            f"mask: {mask.sum()} pixels are the object's, and nowhere 3 x 3 of them together: too few or too thin for "
            "normals. White marks the object: paint all of it, or drop mask under [object]."
        )


def _whole(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels of a mask that have all eight neighbours in it; beside the picture there are none."""
    import cv2

    return cv2.erode(np.pad(mask, 1).astype(np.uint8), np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0


def _beside(box: Box, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the pixels (H, W) outside a box, and check that it is one."""
    (height, width), (left, top, right, bottom) = size, box
    v, u = np.mgrid[0:height, 0:width]
    beside = (u < left) | (u > right) | (v < top) | (v > bottom)
    if (~beside).sum() < 9 or not beside.any():
        raise AlignError(
            f"object.box: found {list(box)}, in a picture of {width} x {height} px; expected left, top, right and "
            "bottom of a box about the object, pixels, some backdrop beside it."
        )
    return beside


def _choose(
    contradiction: Contradiction, never: NDArray[np.bool_], asked: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], list[str]]:
    """Return the piece that is most likely the object: large, near the middle of what is asked for, and nowhere else.

    `never`, `asked` (h, w): the balls and what lies beside the user's box, and the pixels in it.
    """
    from scipy.ndimage import binary_closing, binary_opening

    plausible = contradiction.object_likely & ~never
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
    # Opening cuts off noise and the thin rims of balls and shadows.
    pieces = _pieces(binary_opening(binary_closing(plausible, cross), cross, iterations=2))
    count = int(pieces.max())
    height, width = plausible.shape
    areas = np.bincount(pieces.ravel(), minlength=count + 1)[1:].astype(float)
    if not count or areas.max() < LEAST_SHARE * plausible.size:
        raise AlignError(
            "mask: no object found: nothing stands out from the backdrop "
            f"(largest piece {areas.max() if count else 0:.0f} of {plausible.size} blocks; backdrop known to "
            f"{100 * contradiction.backdrop_noise:.1f} %). Give a box about it, or its mask: box, mask under [object]."
        )
    v, u = np.mgrid[0:height, 0:width]
    middle = np.mean(np.nonzero(asked), axis=1)
    away = np.hypot(v - middle[0], u - middle[1]) / np.hypot(height, width)
    # Each pixel votes by its place: a big thing in the middle beats a bigger one along the border.
    votes = np.bincount(pieces.ravel(), np.exp(-((away.ravel() / 0.3) ** 2)), minlength=count + 1)[1:]
    best = int(np.argmax(votes))
    warnings = []
    rivals = [i for i in range(count) if i != best and votes[i] > 0.3 * votes[best]]
    if rivals:
        warnings.append(
            f"mask: {len(rivals) + 1} things stand out from the backdrop; the one of {areas[best]:.0f} blocks "
            f"nearest to the middle was taken, beside {', '.join(f'{areas[i]:.0f}' for i in rivals)}. If that is "
            "wrong, give a box about the object, or its mask: box or mask under [object]."
        )
    return np.asarray(pieces == best + 1, bool), warnings


def _trim(picture: NDArray[np.float32], contradiction: Contradiction, piece: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Take off what hangs on the object and is much nearer to the backdrop: folds of a cloth, stains."""
    from scipy.ndimage import binary_fill_holes, binary_opening

    excess = np.sqrt(np.maximum(picture, 0)) - np.sqrt(contradiction.backdrop)
    # The upper quartile: more of the piece may be folds than object.
    typical = float(np.percentile(excess[piece], 75))
    # Only before a black cloth does brightness tell them apart: elsewhere a metal has darker parts than the table.
    if typical <= BLACK * float(np.median(np.sqrt(contradiction.backdrop[piece]))):
        return piece
    strong = np.asarray(binary_opening(piece & (excess > FAINT * typical), np.ones((3, 3), bool)), bool)
    if not strong.any():
        return piece
    strong = _largest(strong)
    # Dark places within the object are its own.
    return strong | (piece & np.asarray(binary_fill_holes(strong), bool))


def _sharpen(picture: NDArray, mask: NDArray[np.bool_], balls: NDArray[np.bool_], *, reach: int) -> NDArray[np.bool_]:
    """Move the border, within `reach` pixels, to where the picture passes midway between inside and outside."""
    import cv2

    size = 2 * reach + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    # Round objects darken toward their border: midway in square roots lies lower, and so nearer to it.
    picture = np.sqrt(np.maximum(picture, 0)).astype(np.float32)
    for _ in range(2):
        inner = cv2.erode(mask.astype(np.uint8), disc, borderValue=1) > 0
        outer = (cv2.dilate(mask.astype(np.uint8), disc) == 0) & ~balls
        levels = []
        for region in (inner, outer):
            weight, level = (_blur(image, 1.5 * reach) for image in (region.astype(np.float32), picture * region))
            levels.append(np.where(weight > 1e-3, level / np.maximum(weight, 1e-3), np.nan))
        inside, outside = levels
        clear = np.abs(inside - outside) > 0.3 * np.maximum(np.abs(inside), np.abs(outside))
        closer = np.abs(picture - inside) < np.abs(picture - outside)
        mask = inner | np.where(clear, closer, mask) & ~outer & ~inner & ~balls
    return mask


def _blur(image: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    """Return the image after a Gaussian; a wide one is computed on fewer pixels, which hold as much."""
    import cv2

    height, width = image.shape
    step = max(1, int(sigma_px / 6))
    if step > 1:
        image = np.asarray(cv2.resize(image, (width // step, height // step), interpolation=cv2.INTER_AREA), np.float32)
    image = np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px / step), np.float32)
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def _pieces(mask: NDArray) -> NDArray[np.int64]:
    """Return the 4-connected pieces' numbers (H, W), 0 outside."""
    from skimage.measure import label

    return np.asarray(label(mask, connectivity=1), np.int64)


def _largest(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the largest 4-connected piece of a mask that is not empty."""
    pieces = _pieces(mask)
    return pieces == np.argmax(np.bincount(pieces.ravel())[1:]) + 1


def _one_piece(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the largest piece, its small holes filled: a handle's opening stays open; a dark spot is filled."""
    from skimage.morphology import remove_small_holes

    if not mask.any():
        raise AlignError("mask: the object's border could not be found. Give the mask: mask under [object].")
    piece = _largest(mask)
    return np.asarray(remove_small_holes(piece, max_size=int(0.005 * piece.sum())), bool)
