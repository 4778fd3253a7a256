"""Shared libraries of the operating system that Open3D and Mitsuba load and no package of PyPI brings.

Run by `make setup` before anything is installed, hence the standard library alone: installs what is missing where
it may (root, or sudo without a password), and else says which command to run. `make test` runs it with `--browser`.
"""

import ctypes
import os
import shutil
import subprocess
import sys

NEEDED = {
    "libatomic.so.1": "libatomic1",
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
}
"""Library to Debian's package: Mitsuba wants the first, Open3D the others."""

HELPFUL = {"libLLVM.so.19.1": "libllvm19"}
"""With it Mitsuba renders several times faster; without it, its scalar variant runs."""


def absent(libraries: dict[str, str]) -> list[str]:
    """Return the Debian packages of those libraries that cannot be loaded."""
    packages = []
    for library, package in libraries.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            packages.append(package)
    return packages


def main() -> int:
    """Install what is missing; return the exit code for make."""
    needed, helpful = absent(NEEDED), absent_files(HELPFUL)
    if not needed and not helpful:
        return 0
    if sys.platform != "linux":
        return 0
    command = _installer()
    if command:
        print(f"installing system libraries: {' '.join([*needed, *helpful])}", flush=True)
        _quietly([*command, "update", "-qq"])
        # One by one: an older release that lacks a helpful one must still get the needed ones.
        for package in (*needed, *helpful):
            _quietly([*command, "install", "-y", "-qq", package])
    needed = absent(NEEDED)
    if needed:
        libraries = ", ".join(library for library, package in NEEDED.items() if package in needed)
        print(
            f"rgbn needs system libraries that are not here, and may not install them itself. Run:\n"
            f"  sudo apt-get install {' '.join(needed)}\n"
            f"(or your system's packages of {libraries}), then again.",
            file=sys.stderr,
        )
        return 2
    if absent_files(HELPFUL):
        print("Optional: `sudo apt-get install libllvm19` makes rendering several times faster.")
    return 0


def have_browser() -> int:
    """Install the Chromium that the studio is tested in, where that may be; its tests are skipped without."""
    command = _installer() if sys.platform == "linux" and not shutil.which("chromium") else []
    if command:
        print("installing Chromium for the tests of the studio", flush=True)
        _quietly([*command, "update", "-qq"])
        _quietly([*command, "install", "-y", "-qq", "--no-install-recommends", "chromium"])
    return 0


def absent_files(libraries: dict[str, str]) -> list[str]:
    """Like `absent`, by file: loading an LLVM into this process would be a waste."""
    known = subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=False).stdout
    return [package for library, package in libraries.items() if library not in known]


def _quietly(command: list[str]) -> None:
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)


def _installer() -> list[str]:
    """Return the command that installs packages without asking, or nothing."""
    if not shutil.which("apt-get"):
        return []
    if os.geteuid() == 0:
        return ["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]
    sudo = shutil.which("sudo")
    if sudo and subprocess.run([sudo, "-n", "true"], capture_output=True, check=False).returncode == 0:
        return [sudo, "-n", "env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]
    return []


if __name__ == "__main__":
    sys.exit(have_browser() if "--browser" in sys.argv else main())
