"""The checksums of a dataset's files, in the form that `sha256sum --check` reads."""

import hashlib
from pathlib import Path

from scene.files import write_text

FILE = "SHA256SUMS"


def checksums_of(folder: Path) -> str:
    """Return a line for each file below a folder, but for the checksums themselves and hidden files."""
    lines = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and name != FILE and not any(part.startswith(".") for part in name.split("/")):
            with open(path, "rb") as file:
                lines.append(f"{hashlib.file_digest(file, 'sha256').hexdigest()}  {name}\n")
    return "".join(lines)


def write_checksums(folder: Path) -> None:
    """Write SHA256SUMS into a folder."""
    write_text(folder / FILE, checksums_of(folder))


def differences(expected: str, folder: Path) -> list[str]:
    """Return what differs from checksums that were taken before, a sentence a file."""
    before, now = (
        {name: value for value, name in (line.split("  ", 1) for line in text.splitlines())}
        for text in (expected, checksums_of(folder))
    )
    said = [f"{name} is gone" for name in before if name not in now]
    said += [f"{name} has changed" for name in before if name in now and now[name] != before[name]]
    return said + [f"{name} is new" for name in now if name not in before]
