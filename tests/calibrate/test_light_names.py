"""Light files that name the photographs in other words, and tables in other shapes: the right light, or a refusal."""

import unicodedata

import numpy as np
import pytest

from calibrate.known_lights.read_known import read_lights
from scene.errors import CalibrationError

COUNT = 5
ANGLE = 2 * np.pi * np.arange(COUNT) / COUNT
DIRECTIONS = np.stack([0.6 * np.cos(ANGLE), 0.6 * np.sin(ANGLE), np.full(COUNT, 0.8)], -1)


def lp(path, names, order=range(COUNT), encoding="utf-8", end="\n"):
    """Write a .lp whose rows stand in another order than the frames; `names` are the frames' as the file has them."""
    rows = [" ".join([names[i], *(f"{x:.9f}" for x in DIRECTIONS[i])]) for i in order]
    path.write_bytes("".join(f"{row}{end}" for row in (str(COUNT), *rows)).encode(encoding))
    return path


def read(path, frames):
    return read_lights(path, tuple(frames)).directions


@pytest.mark.parametrize(
    ("frame", "name"),
    [
        ("img_{:02d}", "IMG_{:02d}.JPG"),
        ("IMG_{:02d}", "C:\\Köln\\img_{:02d}.jpg"),
        ("Münze_{:d}", unicodedata.normalize("NFD", "Münze_{:d}.tif")),
        (unicodedata.normalize("NFD", "Münze_{:d}"), "MÜNZE_{:d}.tif"),
        ("coin.{:02d}", "coin.{:02d}"),
        ("coin.{:02d}", "coin.{:02d}.png"),
        ("coin.{:02d}.front", "/data/me/coin.{:02d}.front.jpg"),
        ("IMG_{:02d}", "IMG_{:02d}.CR2.jpg"),
        ("IMG_{:02d}.CR2", "IMG_{:02d}.jpg"),
        ("my coin {:d}", '"D:/my photos/my coin {:d}.jpg"'),
        ("my  coin {:d}", "'my  coin {:d}.jpg'"),
        ("flash_{:03d}", "Flash_{:d}.3fr"),
        ("a_flash_{:d}", "a\\flash_{:d}.dng"),
    ],
)
def test_a_name_is_found_however_it_is_written(tmp_path, frame, name):
    order = [2, 4, 0, 3, 1]
    path = lp(tmp_path / "l.lp", [name.format(i) for i in range(COUNT)], order)
    lights = read_lights(path, tuple(frame.format(i) for i in range(COUNT)))
    np.testing.assert_allclose(lights.directions, DIRECTIONS, atol=1e-8)
    assert set(lights.flags) == {("l.lp has no intensities",)}


@pytest.mark.parametrize("encoding", ["cp1252", "mac_roman", "cp850", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_list_of_another_time_is_read(tmp_path, encoding, end):
    letters = "äöüéè"
    frames = [f"Größe_{letter}" for letter in letters]
    names = [f"C:\\Übung\\Größe_{letter}.jpg" for letter in letters]
    path = lp(tmp_path / "l.lp", names, [3, 0, 4, 1, 2], encoding, end)
    np.testing.assert_allclose(read(path, frames), DIRECTIONS, atol=1e-8)


def test_names_that_no_encoding_explains(tmp_path):
    """Some are known, others not, in an encoding that is not tried: it is said how to save the file."""
    frames = ["ж1", "ж2", "c", "d", "e"]
    with pytest.raises(CalibrationError, match=r"no light for the frame 'ж2'.*not UTF-8\. Save the file"):
        read(lp(tmp_path / "l.lp", frames, encoding="koi8-r"), frames)


def test_foreign_names_in_another_order_by_number(tmp_path):
    """The file's own order would give each photograph another's light, where its numbers tell another order."""
    frames = [f"flash_{i:02d}" for i in range(COUNT)]
    foreign = [f"DSC{7000 + i}.jpg" for i in range(COUNT)]
    lights = read_lights(lp(tmp_path / "l.lp", foreign), tuple(frames))
    np.testing.assert_allclose(lights.directions, DIRECTIONS, atol=1e-8)
    assert all("file's order" in flags[-1] for flags in lights.flags)
    with pytest.raises(CalibrationError, match=r"DSC7004.jpg.*by their numbers the lights stand in another order"):
        read(lp(tmp_path / "l.lp", foreign, reversed(range(COUNT))), frames)
    with pytest.raises(CalibrationError, match="another order"):
        read_lights(lp(tmp_path / "l.lp", foreign, [1, 0, 2, 3, 4]), tuple(frames[:4]), skipped=(4,))


def table(path, values, count=None):
    lines = ["# x y z, as NumPy writes a head" if count is None else str(count)]
    path.write_text("\n".join([*lines, *(" ".join(map(repr, map(float, row))) for row in np.asarray(values))]) + "\n")
    return path


FRAMES = [f"f{i}" for i in range(COUNT)]
POWER = np.array([[1.0, 2, 3], [2, 1, 4], [5, 6, 1], [4, 2, 2], [3, 3, 9]])


@pytest.mark.parametrize("lights", [COUNT, 3])
@pytest.mark.parametrize("counted", [False, True])
@pytest.mark.parametrize("by_column", [False, True])
@pytest.mark.parametrize("gray", [False, True])
def test_tables_in_other_shapes(tmp_path, lights, counted, by_column, gray):
    """A first line that counts; a light a column, of three as well: unit vectors tell; one intensity a light."""
    turn, count = np.transpose if by_column else np.asarray, lights if counted else None
    directions, power, names = DIRECTIONS[:lights], POWER[:lights], tuple(FRAMES[:lights])
    path = table(tmp_path / "light_directions.txt", turn(directions), count)
    table(tmp_path / "light_intensities.txt", power[:, :1] if gray else turn(power), None if gray else count)
    found = read_lights(path, names)
    np.testing.assert_allclose(found.directions, directions, atol=1e-12)
    power = np.repeat(power[:, :1], 3, 1) if gray else power
    np.testing.assert_allclose(found.intensities, power / power.mean(0))
    assert any("a light a column" in flag for flag in found.flags[0]) == by_column


def test_three_lights_that_are_no_unit_vectors_are_taken_by_the_line_and_that_is_said(tmp_path):
    path = table(tmp_path / "light_directions.txt", 2 * DIRECTIONS[:3])
    (flag, *_) = read_lights(path, tuple(FRAMES[:3])).flags[0]
    assert "a light a line or a column: taken as a line" in flag


@pytest.mark.parametrize("rows", [["5", "0 0 1", "0 1"], ["4", "0 0 1", "0 1 1"], ["1 2", "1 2"], ["1", "2", "3"]])
def test_other_tables_are_refused_by_line(tmp_path, rows):
    (tmp_path / "light_directions.txt").write_text("\n".join(rows))
    with pytest.raises(CalibrationError, match=r"line \d is '.*'; expected three numbers a line"):
        read(tmp_path / "light_directions.txt", FRAMES)
