"""The kinds of data sets there are, and what lists the items of each."""

from collections.abc import Callable, Mapping
from pathlib import Path

from pcrdiff.datasets import kitti, modelnet40, threedmatch
from pcrdiff.datasets.items import RawItem

READERS: Mapping[str, Callable[[Path], list[RawItem]]] = {
    "modelnet40": modelnet40.read_items,
    "3dmatch": threedmatch.read_items,
    "kitti": kitti.read_items,
}
