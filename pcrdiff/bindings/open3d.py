"""Open3D, loaded so that it needs no system package."""

import ctypes
from importlib import resources

# open3d 0.20 links libusb for depth cameras nobody uses here; the wheel libusb-package carries it.
for library in sorted(resources.files("libusb_package").iterdir(), key=lambda entry: entry.name):
    if ".so" in library.name:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)

import open3d  # noqa: E402  (after its library, or the import fails)

__all__ = ["open3d"]
