"""[camera]: which of its keys go together, and what they give: the whole camera, a part of it, or a board's shots."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from capture.session.session_types import Board, Lens
from scene.camera import Camera

if TYPE_CHECKING:
    from capture.session.manifest import CameraTable

PIXELS = ("width", "height", "fx", "fy", "cx", "cy")
SENSOR = ("sensor_mm", "pixel_um", "crop_factor", "model")
MILLIMETRES = ("focal_mm", *SENSOR)


class Resolving(Protocol):
    """What finds the files that keys name, and collects faults: `capture.session.resolve.Resolver`."""

    def fault(self, key: str, text: str) -> None: ...
    def photographs(self, key: str, patterns: list[str]) -> list[Path]: ...


def resolve_camera(to: Resolving, table: "CameraTable | None") -> Camera | Lens | Board | None:
    """Return what [camera] says; None, and a fault, where it contradicts itself."""
    if table is None:
        return None
    given = [name for name in (*PIXELS, *MILLIMETRES, "distortion") if getattr(table, name) is not None]
    if table.charuco is not None or table.chessboard is not None or table.board is not None:
        return _board(to, table, given)
    if not given:
        return None
    size = _pair(to, table, ("width", "height"))
    center = _pair(to, table, ("cx", "cy"))
    _check_focal(to, table, given)
    if size and center and not (-0.5 <= center[0] <= size[0] - 0.5 and -0.5 <= center[1] <= size[1] - 0.5):
        to.fault(
            "camera.cx, camera.cy",
            f"found {center[0]}, {center[1]}, outside of the image of {size[0]} x {size[1]} px. They are pixels from "
            "the centre of the upper left pixel; or are width and height those of another picture?",
        )
    distortion = tuple(table.distortion or [0.0] * 5)
    if not (size and table.fx and center):
        whole = None if size is None else (int(size[0]), int(size[1]))
        stated = {name: getattr(table, name) for name in ("fx", "fy", "cx", "cy", *MILLIMETRES)}
        return Lens(whole, distortion=distortion, **stated)
    for key, focal, side in (("fx", table.fx, size[0]), ("fy", table.fy or table.fx, size[1])):
        if not 0.2 <= focal / side <= 1000:
            to.fault(
                f"camera.{key}",
                f"found {focal:g} px for a picture of {side:g} px; lenses have 0.2 to 1000 times the picture. Give "
                "the focal length in pixels, or focal_mm and sensor_mm.",
            )
            return None
    camera = Camera(int(size[0]), int(size[1]), table.fx, table.fy or table.fx, *center, distortion)
    corners = [[u, v] for u in (0, camera.width - 1) for v in (0, camera.height - 1)]
    moved = np.abs(camera.project(replace(camera, distortion=(0.0,) * 5).rays(corners)[1]) - corners).max()
    if not moved <= max(camera.width, camera.height):
        to.fault(
            "camera.distortion",
            f"found {list(distortion)}, which moves a corner of the picture by {moved:.3g} px, beyond its size. Give "
            "OpenCV's k1 k2 p1 p2 k3.",
        )
    return camera


def _pair(to: Resolving, table: "CameraTable", names: tuple[str, str]) -> tuple[float, float] | None:
    first, second = (getattr(table, name) for name in names)
    if (first is None) != (second is None):
        absent = names[first is not None]
        to.fault(f"camera.{absent}", f"missing. {names[0]} and {names[1]} go together: give both, or none.")
    return None if first is None or second is None else (first, second)


def _check_focal(to: Resolving, table: "CameraTable", given: list[str]) -> None:
    """The focal length is said once, and a part of it is said wholly."""
    millimetres = [name for name in given if name in MILLIMETRES]
    sensors = [name for name in given if name in SENSOR]
    if table.fx is not None and millimetres:
        to.fault("camera", f"found fx beside {', '.join(millimetres)}. Both tell the focal length: keep one of them.")
    elif table.fx is None and table.fy is not None:
        to.fault("camera.fx", "missing. Where there is fy, give fx; where they are the same, fx alone.")
    if len(sensors) > 1:
        to.fault("camera", f"found {', '.join(sensors)}. Each tells the size of the sensor: keep one of them.")


def _board(to: Resolving, table: "CameraTable", given: list[str]) -> Board | None:
    if given:
        text = f"found {', '.join(given)} beside a board. Its shots give the whole camera: keep one of them."
        to.fault("camera", text)
    if table.charuco is not None and table.chessboard is not None:
        to.fault("camera.chessboard", "found beside charuco. Give the shots of one board.")
    plain = table.chessboard is not None
    shots, board = table.chessboard or table.charuco, table.board
    if shots is None or board is None:
        to.fault(
            "camera.charuco" if shots is None else "camera.board",
            'missing. Give charuco = "charuco/*.dng" and board = { squares = [11, 8], square_mm = 15, '
            'marker_mm = 11, dictionary = "DICT_4X4_100" }, or chessboard = "board/*.dng" and board = '
            "{ squares = [11, 8] }.",
        )
        return None
    files = to.photographs("camera.chessboard" if plain else "camera.charuco", shots)
    squares = (board.squares[0], board.squares[1])
    if plain:
        if board.marker_mm is not None or board.dictionary is not None:
            text = "found marker_mm or dictionary beside chessboard, which has no markers. Drop it, or write charuco."
            to.fault("camera.board", text)
        if min(squares) < 4:
            to.fault("camera.board.squares", f"found {list(squares)}; a chessboard needs 4 or more each way.")
        return Board(tuple(files), squares, board.square_mm)
    for name in ("marker_mm", "dictionary"):
        if getattr(board, name) is None:
            to.fault(f"camera.board.{name}", "missing. A ChArUco board has it; a plain one is given as chessboard.")
    if board.marker_mm is not None and board.marker_mm >= board.square_mm:
        to.fault("camera.board", f"marker_mm {board.marker_mm} must be less than square_mm {board.square_mm}.")
    return Board(tuple(files), squares, board.square_mm, board.marker_mm, board.dictionary)
