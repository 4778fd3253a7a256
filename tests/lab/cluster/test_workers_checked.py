"""No worker works that would give something else: one of other code, of other libraries, or that sees other files."""

import shutil
import subprocess
from pathlib import Path

import pytest

from scene.rooms import ROOMS, ROOT

ALONE = ["unshare", "--map-root-user", "--mount"]
SLOW = """
def slow(count):
    time.sleep(0.5)
    open(os.path.join(os.path.dirname(__file__), "works"), "w").close()

on_open("flash_", slow)
"""


@pytest.fixture
def other_house(tmp_path):
    """The house with one line changed: every sample a code higher."""
    house = tmp_path / "house"
    for room in ROOMS:
        shutil.copytree(ROOT / room, house / room, ignore=shutil.ignore_patterns("__pycache__"))
    file = house / "capture" / "photographs" / "develop.py"
    text = file.read_text()
    assert text.count("ascontiguousarray(codes)") == 1
    file.write_text(text.replace("ascontiguousarray(codes)", "ascontiguousarray(codes + 1)"))
    return house


@pytest.mark.full
def test_a_cluster_gives_what_threads_give(session, cluster, same, finish, tmp_path):
    cluster.start_scheduler()
    cluster.start_worker()
    cluster.start_worker()
    done = finish(cluster.solve(session[0], tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    same(tmp_path / "out")


@pytest.mark.full
def test_a_worker_of_other_code_is_refused_before_any_work(session, cluster, other_house, refused, tmp_path):
    cluster.start_scheduler()
    cluster.start_worker()
    cluster.start_worker(house=other_house)
    said = refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "worker tcp://", " on ", "make setup")
    assert f"the code of its rgbn in {other_house} is another" in said
    assert not (tmp_path / "out" / "frames").exists()


@pytest.mark.full
def test_a_worker_of_other_code_that_joins_later_is_refused(
    session, cluster, other_house, refused, same, finish, wait_for, tmp_path
):
    cluster.start_scheduler()
    cluster.start_worker(habit=SLOW)
    run = cluster.solve(session[0], tmp_path / "out")
    wait_for((cluster.folder / "worker-0" / "works").exists, run)
    stranger = cluster.start_worker(house=other_house)
    refused(finish(run), f"the code of its rgbn in {other_house} is another", "What is done is kept")
    stranger.kill()
    stranger.wait()
    cluster.start_worker()
    done = finish(cluster.solve(session[0], tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    same(tmp_path / "out")


@pytest.mark.full
def test_a_worker_with_another_library_is_refused(session, cluster, refused, tmp_path):
    cluster.start_scheduler()
    worker_place = cluster.folder / "worker-0"
    # Found before the installed one, as another environment's would be.
    (cluster.folder / "scipy-1.0.dist-info").mkdir()
    (cluster.folder / "scipy-1.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: scipy\nVersion: 1.0\n"
    )
    cluster.start_worker(habit=f"sys.path.insert(0, {str(cluster.folder)!r})")
    assert worker_place.exists()
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "its scipy is 1.0, expected ", "worker tcp://")


@pytest.mark.full
def test_a_worker_whose_code_was_changed_after_it_had_loaded_it_is_refused(
    session, cluster, other_house, refused, finish, tmp_path
):
    """Its files are the expected ones again, but what it has loaded is not."""
    cluster.start_scheduler()
    cluster.start_worker(house=other_house)
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "is another")
    shutil.copy(ROOT / "capture" / "photographs" / "develop.py", other_house / "capture" / "photographs" / "develop.py")
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "is another", "start it again")


@pytest.mark.full
@pytest.mark.parametrize("hidden", ["session", "out"])
def test_a_worker_that_does_not_see_the_files_is_refused(session, cluster, refused, tmp_path, hidden):
    if subprocess.run([*ALONE, "true"], capture_output=True).returncode:
        pytest.skip("no file systems of their own for processes here")
    (tmp_path / "out").mkdir()
    cluster.start_scheduler()
    cluster.start_worker()
    cluster.start_worker(first=[*ALONE, "sh", "-c", f'mount -t tmpfs none "{tmp_path / hidden}" && exec "$@"', "sh"])
    words = ["output folder"] if hidden == "out" else ["flash_00.png"]
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "does not see", str(tmp_path / hidden), *words)


@pytest.mark.full
def test_a_worker_that_sees_other_photographs_of_the_same_names_and_sizes_is_refused(
    session, cluster, refused, tmp_path
):
    """A copy of another day on the worker's own disk; RAW files of one camera are all of one size."""
    if subprocess.run([*ALONE, "true"], capture_output=True).returncode:
        pytest.skip("no file systems of their own for processes here")
    other = Path(shutil.copytree(session[0], tmp_path / "of another day"))
    changed = other / "flash_03.png"
    content = bytearray(changed.read_bytes())
    content[len(content) // 2] ^= 1
    changed.write_bytes(content)
    cluster.start_scheduler()
    cluster.start_worker()
    cluster.start_worker(first=[*ALONE, "sh", "-c", f'mount --bind "{other}" "{session[0]}" && exec "$@"', "sh"])
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "sees another file as", "flash_03.png")


@pytest.mark.full
def test_a_scheduler_that_does_not_answer(session, cluster, refused, tmp_path):
    cluster.address = "tcp://127.0.0.1:9"
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "no Dask scheduler answers", "dask scheduler")
