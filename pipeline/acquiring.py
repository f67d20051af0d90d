"""Getting a raw data set by whichever way its params name."""

import shutil
from collections.abc import Callable
from pathlib import Path

from pcrdiff.data.acquisition import (
    Archive,
    download_archives,
    refuse_download,
    write_manifest,
)
from pcrdiff.data.synthetic.kitti import write_kitti
from pcrdiff.data.synthetic.modelnet40 import write_modelnet40
from pcrdiff.data.synthetic.threedmatch import write_threedmatch
from pipeline.invocation import project_root
from pipeline.params import Acquire
from pipeline.progress import bar
from pipeline.seeding import stream

WRITERS: dict[str, Callable[..., None]] = {
    "modelnet40": write_modelnet40,
    "3dmatch": write_threedmatch,
    "kitti": write_kitti,
}


def acquire(section: Acquire, out: Path, *, seed: int) -> None:
    """Put a data set, or the manifest of one that lies elsewhere, into ``out``.

    A folder that is there already is replaced, and only when the new one is whole.

    Raises:
        ValueError: The data set cannot be had this way, or an archive is not what it should be.
        OSError: A folder or server cannot be read, or the disk is full.
    """
    partial = out.with_name(f".{out.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    try:
        root = _fill(section, partial, seed)
        write_manifest(root, partial, source=section.source, base=project_root(), progress=bar)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    shutil.rmtree(out, ignore_errors=True)
    partial.rename(out)


def _fill(section: Acquire, folder: Path, seed: int) -> Path:
    if section.source == "local":
        return Path(str(section.root))
    if section.source == "download":
        refuse_download(section.family)
        archives = [Archive(a.url, a.sha256) for a in section.archives]
        cache = project_root() / ".pcrdiff" / "downloads"
        download_archives(archives, folder, cache=cache, progress=bar)
        return folder
    seed = stream(seed, f"acquire/{section.family}")
    WRITERS[section.family](folder, seed=seed, progress=bar, **(section.synthetic or {}))
    return folder
