"""A folder of photographs: what each file is, by its name, and by its light."""

import cv2
import numpy as np
import pytest

from capture.session.globs import expand
from capture.survey.board_layout import find_board
from capture.survey.folder_files import pattern_of, survey
from capture.survey.small_pictures import Small, by_light, of_one_size, otherwise_lit, read_small
from scene.errors import SessionError
from scene.frames import encode
from tests.capture.test_camera_of import CHESS, shoot


def lay(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    return folder


def listed(found):
    by_role = found.by_role.items()
    return {role: [path.relative_to(found.folder).as_posix() for path in files] for role, files in by_role}


def test_names_tell_roles(tmp_path):
    tmp_path /= "dark_ambient_chrome"  # The folder's own name says nothing.
    lay(tmp_path, *(f"raw/flash_{n}.dng" for n in (1, 2, 10)), "raw/no_flash.dng", "dark/1.dng", "FlatField.dng")
    more = "charuco/a.dng scan/penguin.ply mask.png lights.lp Normal_gt.mat result/normals.npy notes.txt .hidden.dng"
    lay(tmp_path, *more.split())
    (found,) = survey(tmp_path)
    assert listed(found) == {
        "flash": ["raw/flash_1.dng", "raw/flash_2.dng", "raw/flash_10.dng"],
        "ambient": ["raw/no_flash.dng"],
        "dark": ["dark/1.dng"],
        "flat": ["FlatField.dng"],
        "board": ["charuco/a.dng"],
        "scan": ["scan/penguin.ply"],
        "mask": ["mask.png"],
        "lights": ["lights.lp"],
        "normals": ["Normal_gt.mat"],
    }
    (told,) = found.left_out
    assert told.startswith("result/normals.npy: its name does not say whether these normals are the truth")


def test_a_jpeg_beside_its_raw_file_is_left_out_and_named(tmp_path):
    lay(tmp_path, *(f"IMG_{n}.CR2" for n in range(4)), *(f"IMG_{n}.JPG" for n in range(4)), "table.jpg", "mask.png")
    (found,) = survey(tmp_path)
    assert listed(found) == {"flash": [f"IMG_{n}.CR2" for n in range(4)], "mask": ["mask.png"]}
    assert found.left_out[0].startswith("4 .jpg (IMG_0.JPG, ...): beside a file of the same name")
    assert found.left_out[1].startswith("1 .jpg (table.jpg): no RAW files")


def test_each_object_has_its_own_session_and_the_balls_are_shared(tmp_path):
    lay(tmp_path, *(f"{place}/{n}.png" for place in ("cat", "owl", "chrome", "gray") for n in range(4)))
    # Objects may lie a folder deeper.
    lay(tmp_path, *(f"hen/raw/{n}.png" for n in range(4)), "cat/scan.ply", "owl/mask.png", "hen/hen.ply", "board/1.png")
    cat, hen, owl = found = survey(tmp_path)
    assert [one.folder.name for one in found] == ["cat", "hen", "owl"]
    assert hen.by_role["scan"][0].name == "hen.ply"
    shared = {"flash": 4, "chrome": 4, "white": 4, "board": 1}
    for found, own in ((cat, "scan"), (hen, "scan"), (owl, "mask")):
        assert {role: len(files) for role, files in found.by_role.items()} == shared | {own: 1}
        assert all(path.is_relative_to(found.folder) for path in found.by_role["flash"])


@pytest.mark.parametrize(
    ("names", "others", "pattern"),
    [
        (["raw/f_001.dng", "raw/f_002.dng", "raw/f_010.dng"], ["raw/g.dng"], "raw/f_*.dng"),
        (["cat.0.png", "cat.1.png", "cat.10.png"], ["cat.mask.png"], "cat.[0-9]*.png"),
        (["IMG_1234.CR2", "IMG_1235.CR2"], ["IMG_0001.CR2"], "IMG_123*.CR2"),
        (["a.dng"], ["b.dng"], "a.dng"),
        (["a.dng", "b.dng"], ["c.dng"], ["a.dng", "b.dng"]),
        (["x[1]/f_1.dng", "x[1]/f_2.dng"], ["x1/f_1.dng"], "x[[]1]/f_*.dng"),
    ],
)
def test_a_pattern_matches_its_files_and_no_other(tmp_path, names, others, pattern):
    lay(tmp_path, *names, *others)
    files = [tmp_path / name for name in names]
    assert pattern_of(files, tmp_path) == pattern
    inside = tmp_path / "raw"
    inside.mkdir(exist_ok=True)
    assert expand(np.atleast_1d(pattern_of(files, inside)).tolist(), inside)[1] == [], "out of another folder, too"
    found, faults = expand([pattern] if isinstance(pattern, str) else pattern, tmp_path)
    assert (found, faults) == (files, [])


@pytest.mark.parametrize(
    ("names", "words"),
    [([], "holds 0 photographs"), (["a.dng", "b.dng"], "holds 2 photographs"), (["a.txt", "b.obj"], "2 files in all")],
)
def test_too_few_photographs(tmp_path, names, words):
    lay(tmp_path, *names)
    with pytest.raises(SessionError, match=words):
        survey(tmp_path)
    with pytest.raises(SessionError, match="there is no such folder"):
        survey(tmp_path / "nowhere")


def picture(name, linear, tmp_path):
    codes = encode(np.repeat(linear[..., None], 3, axis=2))
    return Small(tmp_path / name, codes, linear.shape[1], linear.shape[0], 1, False)


@pytest.fixture
def scene():
    """A bumpy surface under flashes from around, in a lit room; noise of a dark sensor."""
    rng = np.random.default_rng(7)
    normals = cv2.GaussianBlur(rng.normal(size=(160, 240, 3)), (0, 0), 8) * [25, 25, 0] + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    albedo = 0.2 + 0.6 * (cv2.GaussianBlur(rng.normal(size=(160, 240)), (0, 0), 12) > 0)
    lights = [[np.sin(a) * 0.8, np.cos(a) * 0.8, 0.6] for a in np.linspace(0, 6, 8)]

    def shot(light, room=0.004):
        lit = 0.3 * albedo * np.maximum(normals @ light, 0)
        # A cast shadow: black but for the room's light.
        lit[40:110, 60:120] *= light[0] > 0
        return lit + room * albedo + rng.normal(0, 0.002, albedo.shape)

    return [shot(np.array(light)) for light in lights], shot(np.zeros(3)), rng.normal(0, 0.0005, albedo.shape)


@pytest.mark.parametrize("seed", range(3))
def test_light_tells_roles_where_names_do_not(scene, tmp_path, seed):
    flash, ambient, dark = scene
    named = [*((f"flash{n}", one) for n, one in enumerate(flash)), ("ambient", ambient), ("dark", dark)]
    order = np.random.default_rng(seed).permutation(len(named))
    found = by_light([picture(named[n][0], named[n][1], tmp_path) for n in order])
    assert {role: {one.path.name for one in pictures} for role, pictures in found.items()} == {
        "flash": {f"flash{n}" for n in range(8)}, "ambient": {"ambient"}, "dark": {"dark"}
    }  # fmt: skip


def test_no_flash_frame_is_taken_for_an_ambient_one(scene, tmp_path):
    """A weak flash is dark, but it lights what others leave in shadow."""
    flash, _, dark = scene
    weak = [0.3 * flash[0], *flash[1:]]
    assert set(by_light([picture(f"{n}", one, tmp_path) for n, one in enumerate(weak)])) == {"flash"}
    # One unlit frame alone, as black as it may be, is the room's.
    found = by_light([picture(f"{n}", one, tmp_path) for n, one in enumerate([*weak, dark])])
    assert [one.path.name for one in found["ambient"]] == ["8"]
    assert "dark" not in found


def test_a_frame_in_the_rooms_light_is_none(scene, tmp_path):
    """It is brighter than all others nearly everywhere; a flash of three times the strength is not."""
    flash, ambient, _ = scene
    strong = [picture(f"{n}", one, tmp_path) for n, one in enumerate([3 * flash[0], *flash[1:]])]
    assert otherwise_lit(strong) is None
    lit = picture("lit", 200 * ambient, tmp_path)
    assert otherwise_lit([*strong, lit]) is lit
    assert otherwise_lit([*strong[:4], lit]) is None, "so few tell nothing"


def test_pictures_are_reduced_in_light_not_in_codes(tmp_path):
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 255, (1200, 2400, 3), np.uint8)
    for n in range(2):
        cv2.imwrite(str(tmp_path / f"{n}.png"), pixels)
    cv2.imwrite(str(tmp_path / "2.png"), pixels[:600])
    (tmp_path / "3.png").write_bytes(b"no picture")
    found, unread = read_small([tmp_path / f"{n}.png" for n in range(4)], "srgb")
    same, odd = of_one_size(found)
    assert ([one.path.name for one in same], [one.path.name for one in odd]) == (["0.png", "1.png"], ["2.png"])
    assert len(unread) == 1
    assert "3.png" in unread[0]
    assert (same[0].step, same[0].codes.shape, same[0].width) == (3, (400, 800, 3), 2400)
    coded = pixels / 255.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(same[0].light.mean(), linear.mean(), rtol=1e-3)


def boards(folder, art, count=3):
    """Photographs of a board's art, seen askew."""
    return read_small(list(shoot(folder, art, count)), "srgb")[0]


@pytest.mark.parametrize(
    ("squares", "dictionary", "share"),
    [((9, 6), "DICT_4X4_100", 0.7), pytest.param((7, 5), "DICT_6X6_250", 0.5, marks=pytest.mark.full)],
)
def test_a_charuco_board_is_read_off(tmp_path, squares, dictionary, share):
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    art = cv2.aruco.CharucoBoard(squares, 20.0, 20.0 * share, known).generateImage((squares[0] * 160, squares[1] * 160))
    blank = picture("blank", np.full((640, 960), 0.2), tmp_path)
    layout, shots = find_board([blank, *boards(tmp_path, art)])
    assert layout.squares == list(squares)
    assert layout.dictionary[:8] == dictionary[:8]
    assert layout.marker_mm / layout.square_mm == pytest.approx(share, abs=0.02)
    assert [one.path.name for one in shots] == ["board_0.png", "board_1.png", "board_2.png"]


@pytest.mark.full
def test_a_chessboard_is_read_off(tmp_path):
    """Three shots make one, and not of three by three corners, which balls show, too."""
    chess = boards(tmp_path, CHESS)
    layout, seen = find_board(chess)
    assert (layout.squares, layout.dictionary, layout.marker_mm) == ([9, 6], None, None)
    assert len(seen) == 3
    small = boards(tmp_path, CHESS[: 4 * 160, : 4 * 160])
    for none in (chess[:1], small, [picture("blank", np.full((300, 400), 0.2), tmp_path)]):
        assert find_board(none) == (None, [])
