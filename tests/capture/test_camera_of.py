"""The camera: stated, calibrated from a board, by EXIF, or none."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.camera.board import _camera_of_corners
from capture.camera.exif import Exif
from capture.camera.session_camera import camera_of
from capture.session.manifest import BoardTable, SessionCameraTable
from capture.session.session_types import CaptureSession
from scene.camera import Camera
from scene.errors import SessionError


@pytest.fixture
def session(tmp_path):
    return CaptureSession("x", tmp_path, (tmp_path / "a.png",), ("a",), (0,))


STATED = Camera(1200, 800, 1666.7, 1660.0, 606.8, 394.9, (0.1, 0, 0, 0, 0))


def test_a_stated_camera(session):
    session = replace(session, camera=STATED)
    assert camera_of(session, [], 1200, 800) == (STATED, ())
    half = replace(session, half=True)
    assert camera_of(half, [], 600, 400)[0] == STATED.halved()
    small = replace(half, camera=STATED.halved())
    assert camera_of(small, [], 600, 400)[0] == STATED.halved()


def test_focal_plane_resolution_comes_first(session):
    exif = [Exif(focal_mm=50, focal_35mm=81, pixels_per_mm=(240.0, 241.0), width_px=5472)]
    camera, (warning,) = camera_of(session, exif, 5496, 3670)
    assert (camera.fx, camera.fy) == pytest.approx((12000, 12050)), "a few more pixels of the same pitch"
    assert (camera.cx, camera.cy) == (2747.5, 1834.5)
    assert camera.source == "EXIF"
    assert "focal-plane resolution" in warning
    reduced, _ = camera_of(session, exif, 1368, 912)
    assert reduced.fx == pytest.approx(3000), "a picture scaled to a quarter"
    halved, _ = camera_of(replace(session, half=True), exif, 2736, 1824)
    assert halved.fx == pytest.approx(6000)


def test_the_35_mm_equivalent_is_by_the_diagonal(session):
    """On a 4:3 sensor the width would give 4 % more."""
    camera, (warning,) = camera_of(session, [Exif(focal_35mm=50)], 4000, 3000)
    assert camera.fx == pytest.approx(50 * 5000 / np.hypot(36, 24), rel=1e-5)
    assert camera.fx / (50 * 4000 / 36) == pytest.approx(1.04, abs=0.001)
    assert "35 mm" in warning
    upright, _ = camera_of(session, [Exif(focal_35mm=50)], 3000, 4000)
    assert upright.fx == camera.fx


def test_what_exif_is_worth(session):
    """Each cause of doubt adds to sigma: rounding, close focus, makers who measure 35 mm by the width on 4:3."""

    def camera(width=6000, height=4000, **fields):
        return camera_of(session, [Exif(**fields)], width, height)[0]

    far = {"subject_mm": 1e6}
    exact = camera(focal_mm=50, pixels_per_mm=(240.0, 240.0), **far)
    assert exact.center_sigma_px == pytest.approx(60)
    # Lenses are engraved to a few per cent, and nothing that EXIF says makes it better.
    assert 0.015 < exact.focal_sigma < 0.025
    # 8 mm may be 7.5 or 8.5: 0.29 / 8 = 3.6 % by itself.
    assert camera(focal_mm=8, pixels_per_mm=(240.0, 240.0), **far).focal_sigma == pytest.approx(0.0412, abs=0.001)
    # The width's convention differs by 4 % on 4:3, and lies two sigmas away at most.
    four_thirds = camera(4000, 3000, focal_35mm=50, **far)
    assert abs(50 * 4000 / 36 / four_thirds.fx - 1) < 2 * four_thirds.focal_sigma
    assert four_thirds.focal_sigma > camera(6000, 4000, focal_35mm=50, **far).focal_sigma + 0.003
    # A thin lens at a metre: 50 * 1.0526 mm. One that focuses inside: 50 mm or less.
    near = camera(focal_mm=50, pixels_per_mm=(240.0, 240.0), subject_mm=1000.0)
    assert 12000 < near.fx < 12000 * 1.0526
    for truth in (12000 * 1.0526, 12000):
        assert abs(truth / near.fx - 1) < 1.5 * near.focal_sigma
    unknown = camera(focal_mm=50, pixels_per_mm=(240.0, 240.0))
    assert unknown.fx == 12000
    assert unknown.focal_sigma > near.focal_sigma
    assert unknown.halved().focal_sigma == unknown.focal_sigma
    assert unknown.halved().center_sigma_px == unknown.center_sigma_px / 2
    assert (STATED.focal_sigma, STATED.center_sigma_px) == (0, 0)


@pytest.mark.parametrize(
    "sensor", [{"sensor_mm": 36.0}, {"pixel_um": 6.0}, {"crop_factor": 1.0}, {"model": "nikon corporation NIKON D700"}]
)
@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("upright", [False, True])
def test_a_focal_length_in_millimetres(session, sensor, half, upright):
    """Each way to say how large the sensor is gives 50 mm on 6,000 pixels of 6 um: 8,333 px."""
    size = (4000, 6000) if upright else (6000, 4000)
    size = tuple(side // 2 for side in size) if half else size
    lens = SessionCameraTable(focal_mm=50.0, **sensor)
    camera, (told,) = camera_of(replace(session, camera=lens, half=half), [Exif(focal_mm=18.0)], *size)
    assert (camera.width, camera.height) == size
    assert camera.fx == camera.fy == pytest.approx(8333.33 / (2 if half else 1), rel=1e-4)
    assert (camera.cx, camera.cy) == ((size[0] - 1) / 2, (size[1] - 1) / 2)
    assert camera.center_sigma_px == pytest.approx(0.01 * size[0])
    assert camera.focal_sigma == pytest.approx(0.057, abs=0.003), "engraved, and focused nobody knows where"
    assert "50 mm" in told


def test_the_focal_length_of_exif_on_a_known_sensor(session):
    """Many cameras write neither their sensor's resolution nor a 35 mm equivalent."""
    for e in (Exif(focal_mm=50, camera="Canon Canon EOS R5"), Exif(focal_mm=50, camera="SONY ILCE-1")):
        assert camera_of(session, [e], 8192, 5464)[0].fx == pytest.approx(8192 * 50 / 36, rel=0.003)
    # A longer name that begins alike is another camera, here one with a smaller sensor.
    assert camera_of(session, [Exif(focal_mm=50, camera="NIKON NIKON D3200")], 6016, 4000)[0].fx > 1.5 * 6016 * 50 / 36
    assert camera_of(session, [Exif(focal_mm=50, camera="NIKON NIKON D32")], 6016, 4000)[0].is_orthographic


def test_a_focal_length_in_pixels_alone(session):
    camera, (told,) = camera_of(replace(session, camera=SessionCameraTable(fx=700.0)), [Exif(focal_35mm=50)], 640, 480)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (700, 700, 319.5, 239.5)
    assert (camera.focal_sigma, camera.source) == (0.02, "session.toml")
    assert "as session.toml says" in told
    measured = SessionCameraTable(fx=700.0, fy=701.0, cx=310.0, cy=250.0, distortion=[0.1, 0, 0, 0, 0])
    camera, warnings = camera_of(replace(session, camera=measured), [], 640, 480)
    assert camera == Camera(640, 480, 700.0, 701.0, 310.0, 250.0, (0.1, 0, 0, 0, 0))
    assert warnings == ()
    half, _ = camera_of(replace(session, camera=measured, half=True), [], 320, 240)
    assert half == camera.halved()
    sized = replace(session, camera=SessionCameraTable(width=640, height=480, fx=700.0))
    with pytest.raises(SessionError, match=r"640 x 480.*800 x 600"):
        camera_of(sized, [], 800, 600)


@pytest.mark.parametrize(
    ("lens", "exif", "words"),
    [
        (
            SessionCameraTable(focal_mm=50.0),
            Exif(),
            "camera.focal_mm: found 50 without the size of the sensor.*sensor_mm",
        ),
        (SessionCameraTable(focal_mm=50.0), Exif(camera="Held One"), '"Held One" is not known here.*sensor_mm'),
        (SessionCameraTable(model="Held One"), Exif(focal_mm=50.0), "camera.model.*Held One.*sensor_mm"),
        (SessionCameraTable(sensor_mm=36.0), Exif(), "no focal length.*focal_mm"),
        (SessionCameraTable(cx=300.0, cy=200.0), Exif(), "no focal length.*focal_mm"),
        (SessionCameraTable(fx=50.0), Exif(), "focal length is 50 px.*640 px.*focal_mm"),
    ],
)
def test_half_a_camera(session, lens, exif, words):
    with pytest.raises(SessionError, match=words):
        camera_of(replace(session, camera=lens), [exif], 640, 480)


def test_nothing_known(session):
    camera, (warning,) = camera_of(session, [Exif()], 640, 480)
    assert camera.is_orthographic
    assert "orthographic" in warning
    assert "5 to 15 degrees" in warning
    diligent = replace(session, layout="diligent")
    camera, warnings = camera_of(diligent, [Exif()], 612, 512)
    assert camera.is_orthographic
    assert warnings == ()


BOARD = cv2.aruco.CharucoBoard((9, 6), 20.0, 14.0, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_100))
TRUE = Camera(960, 640, 1100.0, 1100.0, 470.0, 330.0, (-0.08, 0.03, 0.0, 0.0, 0.0))


SCALE = 8  # pixels of the board's art in a millimetre
CHARUCO = BOARD.generateImage((9 * 20 * SCALE, 6 * 20 * SCALE))
CHESS = 255 * np.kron(np.indices((6, 9)).sum(0) % 2, np.ones((20 * SCALE, 20 * SCALE))).astype(np.uint8)


def board_shot(rotation, translation, art=CHARUCO):
    """Photograph the board with TRUE: each pixel's ray meets the board's plane, and takes the colour there."""
    rotation = cv2.Rodrigues(np.asarray(rotation, float))[0]
    _, rays = TRUE.rays(TRUE.grid())
    rays = rays * [1, -1, -1]
    normal, origin = rotation[:, 2], np.asarray(translation, float)
    points = rays * ((origin @ normal) / (rays @ normal))[..., None]
    on_board = (points - origin) @ rotation[:, :2] * SCALE - 0.5
    view = cv2.remap(art, on_board.astype(np.float32), None, cv2.INTER_AREA, borderValue=90)
    return cv2.GaussianBlur(view, (0, 0), 0.8)


def shoot(folder, art, count):
    rng = np.random.default_rng(0)
    for i in range(count):
        tilt = rng.uniform(-0.45, 0.45, 3) * [1, 1, 0.3]
        place = np.array([-90, -60, 260]) + rng.uniform(-1, 1, 3) * [25, 15, 30]
        cv2.imwrite(str(folder / f"board_{i}.png"), board_shot(tilt, place, art))
    return tuple(sorted(folder.glob("board_*.png")))


def board_camera(**stated):
    return SessionCameraTable(board=BoardTable(squares=[9, 6], square_mm=20.0, **stated))


@pytest.mark.parametrize("plain", [False, pytest.param(True, marks=pytest.mark.full)])
def test_a_board_gives_the_camera(session, tmp_path, plain):
    shots = shoot(tmp_path, CHESS if plain else CHARUCO, 6)
    stated = {} if plain else {"marker_mm": 14.0, "dictionary": "DICT_4X4_100"}
    session = replace(session, camera=board_camera(**stated), board_shots=shots, encoding="srgb")
    camera, (note,) = camera_of(session, [], 960, 640)
    assert camera.source == ("chessboard" if plain else "ChArUco")
    assert camera.fx == pytest.approx(TRUE.fx, rel=0.005)
    assert camera.fy == pytest.approx(TRUE.fy, rel=0.005)
    # Within the sigma that is stated, and that is small: a board shot well is worth ten times EXIF.
    for found, truth in ((camera.fx, TRUE.fx), (camera.fy, TRUE.fy)):
        assert abs(found / truth - 1) < 3 * camera.focal_sigma
    for found, truth in ((camera.cx, TRUE.cx), (camera.cy, TRUE.cy)):
        assert abs(found - truth) < 3 * camera.center_sigma_px
    assert 0 < camera.focal_sigma < 0.003
    assert 0 < camera.center_sigma_px < 3
    # The strongest check: rays into the corners of the picture, where distortion tells (0.6 degrees of it).
    corners = np.array([[30, 30], [930, 30], [30, 610], [930, 610], [470, 330]])
    cosine = np.sum(camera.rays(corners)[1] * TRUE.rays(corners)[1], -1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.4
    assert "6 shots" in note
    assert "reprojection error 0." in note


def test_the_boards_sigma_is_honest():
    """Corners with known noise, 24 times: errors in units of the stated sigma have variance 1."""
    rng = np.random.default_rng(10000)
    corners = BOARD.getChessboardCorners().astype(np.float32)
    scores = []
    for _ in range(24):
        images = []
        for _ in range(8):
            turn = cv2.Rodrigues(rng.uniform(-0.45, 0.45, 3) * [1, 1, 0.3])[0]
            place = np.array([-90, -60, 260]) + rng.uniform(-1, 1, 3) * [25, 15, 30]
            seen = TRUE.project((corners @ turn.T + place) * [1, -1, -1])
            images.append((seen + rng.normal(0, 0.2, seen.shape)).astype(np.float32))
        camera, _ = _camera_of_corners([corners] * 8, images, (640, 960), [], "camera.charuco", "ChArUco")
        scores.append([(camera.fx / TRUE.fx - 1) / camera.focal_sigma, (camera.cx - TRUE.cx) / camera.center_sigma_px])
    spread = np.sqrt(np.mean(np.square(scores), 0))
    assert (spread > 0.6).all()
    assert (spread < 1.4).all()


def test_a_board_that_is_not_there(session, tmp_path):
    cv2.imwrite(str(tmp_path / "blank.png"), np.full((640, 960), 90, np.uint8))
    charuco = board_camera(marker_mm=14.0, dictionary="DICT_4X4_100")
    session = replace(session, board_shots=(*shoot(tmp_path, CHARUCO, 1), *[tmp_path / "blank.png"] * 7))
    with pytest.raises(SessionError, match="found in 1 of 8 shots"):
        camera_of(replace(session, camera=charuco), [], 960, 640)
    with pytest.raises(SessionError, match="DICT_4X4_100"):
        camera_of(replace(session, camera=board_camera(marker_mm=14.0, dictionary="DICT_4x4")), [], 960, 640)


def test_a_principal_point_off_the_middle_is_doubted(session):
    """15 % of the width off it turned all lights by 6 degrees, and the balls were blamed."""
    off = replace(STATED, cx=STATED.cx + 0.15 * STATED.width)
    camera, (text,) = camera_of(replace(session, camera=off), [], 1200, 800)
    assert camera == off
    assert text.startswith("camera.cx, camera.cy: ")
    assert "16% of the width" in text
