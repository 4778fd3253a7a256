"""The checksums of a dataset's files, in the form that `sha256sum --check` reads."""

import hashlib
from pathlib import Path

FILE = "SHA256SUMS"


def sums_of(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file below a folder, by name, but for the checksums' own and hidden files."""
    sums = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and name != FILE and not any(part.startswith(".") for part in name.split("/")):
            with open(path, "rb") as file:
                sums[name] = hashlib.file_digest(file, "sha256").hexdigest()
    return sums


def checksums_of(folder: Path) -> str:
    """Return a line for each file of `sums_of`."""
    return "".join(f"{value}  {name}\n" for name, value in sums_of(folder).items())


def differences(expected: str, folder: Path) -> list[str]:
    """Return what differs from checksums that were taken before, a sentence a file."""
    before = {name: value for value, name in (line.split("  ", 1) for line in expected.splitlines())}
    now = sums_of(folder)
    said = [f"{name} is gone" for name in before if name not in now]
    said += [f"{name} has changed" for name in before if name in now and now[name] != before[name]]
    return said + [f"{name} is new" for name in now if name not in before]
