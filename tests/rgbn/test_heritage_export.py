"""`rgbn export --format heritage`: each file by another library, each address of the manifest by its file."""

import hashlib
import json
import re
from math import ceil

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from formats.picture_files import linear_from_srgb
from rgbn import heritage_export
from rgbn.export_command import export
from scene.errors import SceneError
from scene.files import write_png
from scene.normals import angular_error_deg, unit
from tests.lab.test_foreign_files import files_of, make_session

BASE = "https://iiif.example.org"
WIDTH, HEIGHT = 1101, 37
LIGHTS = unit(np.array([[-1, 0, 1], [0.3, 0.2, 1], [0, -1, 1], [0.1, -0.3, 1], [1, 0, 1], [0, 1, 1], [-0.2, 0.3, 1]]))
ORDER = [5, 4, 2, 0, 1, 3, 6]
"""Of these lights: that from above, from the right, from below, from the left, and the rest."""


def truth():
    """Return normals and albedo (H, W, 3) of a rippled sheet."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    normals = unit(np.stack([0.3 * np.sin(u / 40), 0.2 * np.cos(v / 9), np.ones(u.shape)], -1))
    return normals, np.array([0.7, 0.6, 0.5]) * (0.8 + 0.2 * np.cos(u / 90)[..., None])


def photographs():
    normals, albedo = truth()
    return [np.round(65535 * albedo * np.maximum(normals @ light, 0)[..., None]).astype(np.uint16) for light in LIGHTS]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sheet")
    for index, pixels in enumerate(photographs()):
        write_png(folder / f"flash_{index}.png", pixels)
    write_png(folder / "mask.png", np.pad(np.ones((HEIGHT - 6, WIDTH - 8), bool), ((3, 3), (4, 4))))
    frames = [{"name": f"flash_{i}", "direction": light.tolist(), "position_mm": None, "intensity": [1, 1, 1]}
              for i, light in enumerate(LIGHTS)]  # fmt: skip
    lights = {"frames": frames, "reference_point_mm": [0, 0, -500], "ambient": None, "model": "distant"}
    (folder / "lights.json").write_text(json.dumps(lights))
    camera = f"width = {WIDTH}\nheight = {HEIGHT}\nfx = 2000\nfy = 2000\ncx = 550\ncy = 18\n"
    (folder / "session.toml").write_text(
        f'[frames]\nflash = "flash_*.png"\nlinear = true\n[camera]\n{camera}[lights]\nfile = "lights.json"\n'
        '[object]\nmask = "mask.png"\n'
    )
    return folder


@pytest.fixture(scope="module")
def exported(session, tmp_path_factory):
    """The output folder, the bag's data/, and what was said."""
    out = tmp_path_factory.mktemp("made") / "out"
    (folder,), notes = export(session, format="heritage", out=out, base_url=f"{BASE}/")
    assert folder == out / "export" / "heritage"
    return out, folder / "data", notes


def test_maps_and_photographs_are_read_by_others(exported):
    out, data, notes = exported
    maps = data / "Selene_Output"
    assert {path.name for path in maps.iterdir()} == {
        f"{name}_m1.{kind}" for name in ("albedo", "normal", "depthmap", "sigma") for kind in ("tif", "tfw")
    }
    method = json.loads((data / "summary.json").read_text())["results"]["surface"]["method"]
    known = np.isfinite(np.load(out / "normals" / f"{method}.npy")[..., 0])
    codes = tifffile.imread(maps / "normal_m1.tif")
    assert codes.dtype == np.uint16
    assert angular_error_deg(codes[known] / 65535 * 2 - 1, truth()[0][known]).max() < 0.02
    assert not codes[~known].any()
    albedo = linear_from_srgb(cv2.imread(str(maps / "albedo_m1.tif"), cv2.IMREAD_UNCHANGED)[..., ::-1] / 65535)
    ratio = albedo[known] / truth()[1][known]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=1e-3)
    np.testing.assert_array_equal(picture(maps / "sigma_m1.tif"), np.load(out / "sigma" / "recommended.npy"))
    # 500 mm before a lens of 2000 px: a quarter of a millimetre, in metres.
    for path in maps.glob("*.tfw"):
        assert [float(line) for line in path.read_text().split()] == [0.00025, 0, 0, -0.00025, 0, 0]
    metres, slope = tifffile.imread(maps / "depthmap_m1.tif"), truth()[0]
    assert metres.dtype == np.float32
    assert np.nanmedian(metres) == pytest.approx(-0.5, rel=0.01)
    rise = np.gradient(metres[18, 10:-10].astype(float)) / 0.00025
    np.testing.assert_allclose(rise, -(slope[..., 0] / slope[..., 2])[18, 10:-10], atol=0.03)
    assert [path.name for path in sorted(data.glob("*.TIF"))] == [f"{n}.TIF" for n in range(1, len(LIGHTS) + 1)]
    rows = [line.split() for line in (data / "lights.lp").read_text().splitlines()[1:]]
    for place, index in enumerate(ORDER):
        with tifffile.TiffFile(data / f"{place + 1}.TIF") as file:
            seen, told = file.asarray(), json.loads(file.pages[0].description)
        assert told["photograph"] == f"flash_{index}.png"
        white = json.loads(told["value"].split("white: ")[1].split(" of")[0])
        linear, expected = linear_from_srgb(seen / 65535) * white, photographs()[index] / 65535
        np.testing.assert_allclose(linear, np.minimum(expected, white), atol=1e-4)
        assert rows[place][0] == f"{place + 1}.TIF"
        np.testing.assert_allclose(np.array(rows[place][1:], float), LIGHTS[index], atol=1e-6)
    assert any("off by up to 0 degrees from" in note for note in notes)


def test_tiles_are_the_picture(exported):
    _, data, _ = exported
    for place in sorted((data / "iiif" / "image").iterdir()):
        info = json.loads((place / "info.json").read_text())
        assert info["id"] == f"{BASE}/iiif/image/{place.name}"
        assert (info["width"], info["height"], info["profile"]) == (WIDTH, HEIGHT, "level0")
        whole = picture(place / "full" / "max" / "0" / "default.png").astype(float)
        (tiles,) = info["tiles"]
        side = tiles["width"]
        assert tiles["scaleFactors"] == [1, 2, 4]
        for scale in tiles["scaleFactors"]:
            level = np.zeros((ceil(HEIGHT / scale), ceil(WIDTH / scale), 3))
            for x in range(0, WIDTH, side * scale):
                # What the Image API has a viewer ask for.
                w, h = min(side * scale, WIDTH - x), HEIGHT
                size = f"{ceil(w / scale)},{ceil(h / scale)}"
                tile = picture(place / f"{x},0,{w},{h}" / size / "0" / "default.png")
                level[:, x // scale : x // scale + tile.shape[1]] = tile
            inner = whole[: HEIGHT // scale * scale, : WIDTH // scale * scale]
            means = inner.reshape(HEIGHT // scale, scale, WIDTH // scale, scale, 3).mean((1, 3))
            assert np.abs(level[: len(means), : means.shape[1]] - means).max() <= scale - 1
        last = info["sizes"][-1]
        small = picture(place / "full" / f"{last['width']},{last['height']}" / "0" / "default.png")
        np.testing.assert_array_equal(small, level)
    shown = picture(data / "iiif/image/normal/full/max/0/default.png")
    np.testing.assert_array_equal(shown, np.round(tifffile.imread(data / "Selene_Output/normal_m1.tif") / 257))


def picture(path):
    with Image.open(path) as opened:
        return np.asarray(opened)


def resources(node):
    """Yield every JSON object of a manifest that is a picture, a file, or a service of pictures."""
    for value in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from resources(value)
    if isinstance(node, dict) and node.get("type") in ("Image", "Dataset", "ImageService3"):
        yield node


def test_the_manifest_keeps_the_rules_and_its_addresses_lead_to_files(exported):
    """Rules of the Presentation API 3.0: contexts, ids, language maps, targets."""
    _, data, notes = exported
    manifest = json.loads((data / "iiif" / "manifest.json").read_text())
    assert manifest["id"] == f"{BASE}/iiif/manifest.json"
    assert manifest["id"] in notes[-1]
    assert manifest["@context"][-1] == "http://iiif.io/api/presentation/3/context.json"
    assert manifest["type"] == "Manifest"
    assert all(isinstance(words, list) for words in manifest["label"].values())
    (canvas,) = manifest["items"]
    ((annotation,),) = [page["items"] for page in canvas["items"]]
    assert (canvas["type"], canvas["width"], canvas["height"]) == ("Canvas", WIDTH, HEIGHT)
    assert (annotation["motivation"], annotation["target"]) == ("painting", canvas["id"])
    parts = {image["id"].split("/")[-5]: [one.get("mapType") for one in image["service"][1:]]
             for image in annotation["body"]["items"]}  # fmt: skip
    assert parts == {"picture": ["composite"], "albedo": ["albedo"], "normal": ["normal"], "sigma": []}
    assert canvas["service"][0]["physicalScale"] == pytest.approx(0.25)
    found = list(resources(manifest))
    assert len(found) == len({one["id"] for one in found}) + 1, "the manifest's thumbnail is its first picture's"
    for one in found:
        assert one["id"].startswith(f"{BASE}/")
        path = data / one["id"].removeprefix(f"{BASE}/")
        if one["type"] == "ImageService3":
            kept = json.loads((path / "info.json").read_text())
            assert one == {key: value for key, value in kept.items() if key != "@context"}
        elif "width" in one:
            assert picture(path).shape[:2] == (one["height"], one["width"])
        else:
            assert path.is_file()


def test_the_bag_names_every_file_by_its_content(exported):
    bag = exported[1].parent
    lines = [line.split("  ") for line in (bag / "manifest-sha256.txt").read_text().splitlines()]
    sums = {path.relative_to(bag).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in (bag / "data").rglob("*") if path.is_file()}  # fmt: skip
    assert {name: digest for digest, name in lines} == sums
    assert (bag / "bagit.txt").read_text().splitlines()[0] == "BagIt-Version: 1.0"


@pytest.mark.full
def test_a_bag_is_replaced_whole_or_not_at_all(run_rgbn, exported, monkeypatch):
    out, data, _ = exported
    bag, words = data.parent, ("export", out, "--format", "heritage")
    before = files_of(bag)
    (bag / "notes.txt").write_text("mine")
    code, _, said = run_rgbn(*words)
    assert (code, "notes.txt" in said, "Traceback" in said) == (2, True, False)
    (bag / "notes.txt").unlink()

    def full(*_):
        raise SceneError("the disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(heritage_export, "write_manifest", full)
        assert run_rgbn(*words)[0] == 2
    assert files_of(bag) == before
    words += ("--normals", "directx", "--method", "ls")
    code, printed, said = run_rgbn(*words)
    assert (code, printed.strip()) == (0, str(bag)), said
    told = json.loads((data / "summary.json").read_text())
    told.pop("heritage")
    assert json.loads((out / "summary.json").read_text()) == told
    assert [*told["solve"]["methods"]] == ["ls"]
    assert "http://localhost:8000/iiif/manifest.json" in (bag / "data/iiif/manifest.json").read_text()
    down = tifffile.imread(data / "Selene_Output" / "normal_m1.tif")
    known, turned = down.any(-1), truth()[0] * [1, -1, 1]
    assert angular_error_deg(down[known] / 65535 * 2 - 1, turned[known]).max() < 0.02


def test_a_map_of_every_third_pixel_is_a_plane_again():
    v, u = np.mgrid[0:22, 0:31]
    plane = (2.0 * u - 3.0 * v).astype(np.float32)
    np.testing.assert_allclose(heritage_export._enlarged(plane[::3, ::3], 22, 31), plane, atol=1e-5)


def test_without_a_size_none_is_written(run_rgbn, tmp_path):
    make_session(tmp_path / "pear")
    words = ("export", tmp_path / "pear", "--out", tmp_path / "out", "--format", "heritage")
    for base in ("iiif/", "ftp://a.org", "https://a.org/?x=1"):
        code, _, said = run_rgbn(*words, "--base-url", base)
        assert (code, said.count("\n")) == (2, 1), said
        assert base in said
        assert not (tmp_path / "out").exists()
    code, _, said = run_rgbn(*words)
    assert code == 0, said
    assert "no .tfw and no depthmap_m1" in said
    assert re.search(r"[1-9] warnings stand in data/summary\.json", said)
    data = tmp_path / "out" / "export" / "heritage" / "data"
    assert {path.name for path in (data / "Selene_Output").iterdir()} == {
        "albedo_m1.tif",
        "normal_m1.tif",
        "sigma_m1.tif",
    }
    assert "service" not in json.loads((data / "iiif" / "manifest.json").read_text())["items"][0]
    # Solved anew for a twin that there cannot be: what is told of the normals is told anew as well.
    code, _, said = run_rgbn("export", tmp_path / "out", "--format", "mitsuba", "--method", "ls")
    assert (code, "no scan is registered" in said) == (2, True)
    assert [*json.loads((tmp_path / "out" / "summary.json").read_text())["solve"]["methods"]] == ["ls"]
