"""DVC stage ``acquire``: a raw data set in its official layout: synthetic, local or downloaded."""

import argparse
import shutil
from collections.abc import Callable
from pathlib import Path

from pcrdiff.datasets.download import Archive, download_archives, refuse_download
from pcrdiff.datasets.manifest import refuse_foreign, write_manifest
from pipeline.compute.progress import bar
from pipeline.settings.params import Acquire, pick, read_params
from pipeline.settings.seeding import stream
from pipeline.synthetic.kitti import write_kitti
from pipeline.synthetic.modelnet40 import write_modelnet40
from pipeline.synthetic.threedmatch import write_threedmatch
from pipeline.tracking.journal import journal
from pipeline.tracking.run import project_root


def main(argv: list[str] | None = None) -> None:
    """Read params, acquire the data set, write its manifest."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    section = pick(params.acquire, args.dataset, "acquire")
    with journal(params={"dataset": args.dataset, "source": section.source}):
        acquire(section, args.out, seed=params.seed)


WRITERS: dict[str, Callable[..., None]] = {
    "modelnet40": write_modelnet40,
    "3dmatch": write_threedmatch,
    "kitti": write_kitti,
}


def acquire(section: Acquire, out: Path, *, seed: int) -> None:
    """Put a data set, or the manifest of one that lies elsewhere, into ``out``.

    A folder that acquire made before is replaced, and only when the new one is whole. Whatever
    else is there stays, and is refused.

    Raises:
        ValueError: The data set cannot be had this way, or an archive is not what it should be.
        OSError: A folder or server cannot be read, or the disk is full.
        FileExistsError: What lies at ``out`` was not made by acquire.
    """
    if section.source == "local":
        _refuse_overlap(Path(str(section.root)), out)
    refuse_foreign(out)
    partial, retired = (out.with_name(f".{out.name}.{state}") for state in ("partial", "retired"))
    _discard(partial)
    _discard(retired)
    try:
        root = _fill(section, partial, seed)
        write_manifest(root, partial, source=section.source, base=project_root(), progress=bar)
    except BaseException:
        _discard(partial)
        raise
    if out.exists():
        out.rename(retired)  # a folder half removed would be nobody's
    partial.rename(out)
    _discard(retired)


def _refuse_overlap(root: Path, out: Path) -> None:
    """Refuse a local data set that replacing ``out`` would remove, here or in the main project."""
    folder = (project_root() / root.expanduser()).resolve()
    for place in (out.resolve(), (project_root() / out).resolve()):
        for own in (place, place.with_name(f".{place.name}.partial")):
            if folder.is_relative_to(own) or own.is_relative_to(folder):
                raise ValueError(
                    f"a local data set needs a folder apart from {out}, which acquire replaces, "
                    f"got root {root}: move the data set and name its new folder"
                )


def _discard(path: Path) -> None:
    """Remove what an earlier run left half done; of a link the link alone."""
    if path.is_symlink() or path.is_file():
        path.unlink()
    else:
        shutil.rmtree(path, ignore_errors=True)


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
