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


def install(packages: list[str]) -> None:
    """Install Debian packages, where that may be done without asking: as root, or by sudo without a password."""
    if not packages or not shutil.which("apt-get"):
        return
    sudo = [] if os.geteuid() == 0 else ["sudo", "-n"]
    if sudo and (
        not shutil.which("sudo") or subprocess.run([*sudo, "true"], capture_output=True, check=False).returncode
    ):
        return
    print(f"installing {' '.join(packages)}", flush=True)
    # One by one: an older release that lacks a helpful one must still get the needed ones.
    installs = (["install", "-y", "-qq", "--no-install-recommends", package] for package in packages)
    for words in (["update", "-qq"], *installs):
        command = [*sudo, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", *words]
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)


def main() -> int:
    """Install what is missing; return the exit code for make."""
    if sys.platform != "linux":
        return 0
    install([*absent(NEEDED), *absent(HELPFUL)])
    if needed := absent(NEEDED):
        libraries = ", ".join(library for library, package in NEEDED.items() if package in needed)
        print(
            f"rgbn needs system libraries that are not here, and may not install them itself. Run:\n"
            f"  sudo apt-get install {' '.join(needed)}\n"
            f"(or your system's packages of {libraries}), then again.",
            file=sys.stderr,
        )
        return 2
    if absent(HELPFUL):
        print("Optional: `sudo apt-get install libllvm19` makes rendering several times faster.")
    return 0


if __name__ == "__main__":
    if "--browser" not in sys.argv:
        sys.exit(main())
    # The Chromium that the studio is tested in; its tests are skipped without.
    if not shutil.which("chromium"):
        install(["chromium"])
