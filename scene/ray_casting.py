"""Open3D, imported so that it also works on a bare machine."""

import ctypes
from typing import Any


def import_open3d() -> Any:
    """Return the module open3d, where libusb-1.0 is not installed, too.

    Open3D is linked against it; the copy that a Python package brings is loaded first.
    """
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d
