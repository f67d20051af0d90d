"""``pcrdiff.register`` on real pairs: errors, verdicts, seconds; and what its verdicts learn from.

``python -m benchmarks.any_clouds [--pairs N] [--learn]``, where there is real data. Half of the
scenes and the training shapes are for learning, the others are for the table.
"""

import argparse
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import h5py
import numpy as np
import torch
from jaxtyping import Float64
from tqdm import tqdm

from pcrdiff.any_clouds import EVIDENCE, LADDER, VERDICTS, Prepared, register_arrays, search
from pcrdiff.datasets import kitti, threedmatch
from pcrdiff.datasets.items import RecordedPair
from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pcrdiff.verdict import fit_verdict

Points = Float64[np.ndarray, "_ 3"]
Pose = Float64[np.ndarray, "4 4"]
DATA = Path(os.environ.get("PCRDIFF_REAL_DATA", "../shared/data"))
SHAPES = ("bathtub", "bed", "chair", "monitor", "sofa", "toilet")
"""Of ModelNet10, those that no turn maps onto themselves."""
RUNGS = tuple(dict.fromkeys(rung for rungs in LADDER.values() for rung in rungs))
KEPT, JITTER = 717, 0.01
RIGHT = 0.1
"""An answer is right that displaces the source by less, RMS, in units of the larger cloud's radius."""
SEED = 7


@dataclass(frozen=True)
class Case:
    """Two clouds, and the pose between them; None where they show different things."""

    kind: str
    source: Points
    target: Points
    T_target_source: Pose | None

    def error(self, T: Pose) -> float:
        """RMS displacement of the source's points; infinite where no pose is right."""
        if self.T_target_source is None:
            return float("inf")
        off = (T - self.T_target_source)[:3]
        moved = self.source @ off[:, :3].T + off[:, 3]
        return float(np.sqrt(np.square(moved).sum(axis=1).mean()))


def scans(learning: bool, count: int) -> Iterator[Case]:
    """Fragments of 3DMatch: overlapping, overlapping little, and of different scenes."""
    root, generator = DATA / "3dmatch", np.random.default_rng(SEED)
    low = [
        pair
        for folder in sorted((DATA / "3dlomatch").glob("*-evaluation"))
        for pair in threedmatch.read_log(root, folder / "gt.log")
    ]
    every = [pair for pair in threedmatch.read_recorded_pairs(root) if not _follow(pair)]
    scenes = sorted({pair.group for pair in every})
    scenes = scenes[: len(scenes) // 2] if learning else scenes[len(scenes) // 2 :]
    for kind, pairs, many in (("3DMatch", every, count), ("3DLoMatch", low, count // 2)):
        some = [pair for pair in pairs if pair.group in scenes]
        for k in generator.choice(len(some), min(many, len(some)), replace=False):
            yield _case(kind, root, some[k])
    first, second = ([pair for pair in every if pair.group == scene] for scene in scenes[:2])
    for k in range(count // 2):
        other = _case("", root, first[k * len(first) // count]).source
        yield Case("different scenes", _case("", root, second[k]).source, other, None)


def _follow(pair: RecordedPair) -> bool:
    """Whether the fragments follow each other: the official recall leaves such pairs out."""
    a, b = (int(name.rpartition("_")[2]) for name in (pair.source, pair.target))
    return abs(a - b) == 1


def _case(kind: str, root: Path, pair: RecordedPair) -> Case:
    source, target = (
        threedmatch.read_fragment(root / f"{name}.ply")[:, :3]
        for name in (pair.source, pair.target)
    )
    return Case(kind, source, target, np.array(pair.T_target_source))


def shapes(learning: bool, count: int) -> Iterator[Case]:
    """Crops of ModelNet10's shapes under any rotation, each of 70 % by itself, with jitter."""
    generator = np.random.default_rng(SEED)
    names = (DATA / "modelnet10_hdf5_1024" / "shape_names.txt").read_text().split()
    part = "train" if learning else "test"
    with h5py.File(DATA / "modelnet10_hdf5_1024" / f"ply_data_{part}0.h5") as file:
        data, labels = np.array(file["data"], np.float64), np.array(file["label"]).ravel()
    good = np.flatnonzero(np.isin(labels, [names.index(shape) for shape in SHAPES]))
    chosen = generator.choice(good, count + count // 2, replace=False)
    for k in chosen[:count]:
        T = draw_pose(PoseRange(None, 0.5, -0.5), generator=generator)
        source, target = (_crop(data[k], generator) for _ in range(2))
        yield Case("ModelNet10, crops", source, target @ T[:3, :3].T + T[:3, 3], T)
    for k, other in zip(chosen[count:], chosen, strict=False):
        source, target = (_crop(data[each], generator) for each in (k, other))
        yield Case("different shapes", source, target, None)


def _crop(cloud: Points, generator: np.random.Generator) -> Points:
    kept = cloud[np.argsort(cloud @ generator.normal(size=3))[: int(0.7 * len(cloud))]]
    kept = kept[generator.permutation(len(kept))[:KEPT]]
    return kept + generator.normal(scale=JITTER, size=kept.shape)


def drives(count: int) -> Iterator[Case]:
    """Scans of KITTI, ten metres apart by the recorded poses, which are off by about a metre."""
    root = DATA / "kitti"
    for pair in kitti.read_recorded_pairs(root)[:count]:
        source, target = (kitti.read_scan(_scan(root, name)) for name in (pair.source, pair.target))
        yield Case("KITTI", source, target, np.array(pair.T_target_source))


def _scan(root: Path, name: str) -> Path:
    sequence, number = name.split("/")
    return root / "sequences" / sequence / "velodyne" / f"{number}.bin"


def learn(cases: Sequence[Case]) -> Mapping[str, object]:
    """Fit a verdict to the answers from each set of sources."""
    with ProcessPoolExecutor() as pool:
        rows = [*tqdm(pool.map(_answers, cases), total=len(cases), desc="learn")]
    return {
        " + ".join(rung): asdict(
            fit_verdict(
                np.array([row[number][0] for row in rows]),
                np.array([row[number][1] for row in rows]),
            )
        )
        for number, rung in enumerate(RUNGS)
    }


def _answers(case: Case) -> list[tuple[Float64[np.ndarray, " numbers"], bool]]:
    """What speaks for the answer from each set of sources, and whether it is right."""
    torch.set_num_threads(1)
    clouds, rows = Prepared(case.source, case.target), []
    for rung in RUNGS:
        try:
            found = search(clouds, rung, generator=torch.Generator().manual_seed(SEED))
        except ValueError:
            rows.append((np.full(len(EVIDENCE), np.nan), False))
            continue
        right = case.error(clouds.outside(found.T_target_source)) < RIGHT * clouds.unit
        rows.append((clouds.evidence(found), right))
    return rows


def tabulate(cases: Sequence[Case]) -> Iterator[str]:
    """One line for each kind of pairs."""
    rows: dict[str, list[tuple[bool, bool, float, float]]] = {}
    for case in tqdm(cases, desc="register"):
        unit = Prepared(case.source, case.target).unit
        try:
            given = register_arrays(case.source, case.target, "auto", SEED)
        except ValueError:
            rows.setdefault(case.kind, []).append((False, False, np.nan, np.nan))
            continue
        error = case.error(given.T_target_source)
        row = (error < RIGHT * unit, given.verdict == "trust", error, given.seconds)
        rows.setdefault(case.kind, []).append(row)
    yield f"{'':20}{'pairs':>6}{'right %':>9}{'trusted %':>11}{'wrong of trusted':>18}{'median error':>14}{'s':>7}"
    for kind, found in rows.items():
        right, trusted = (np.array([row[column] for row in found]) for column in (0, 1))
        errors, seconds = (np.array([row[column] for row in found]) for column in (2, 3))
        wrong = int((trusted & ~right).sum())
        middle = float(np.median(errors[right])) if right.any() else np.nan
        yield (
            f"{kind:20}{len(right):6}{100 * right.mean():9.1f}{100 * trusted.mean():11.1f}"
            f"{wrong:18}{middle:14.3f}{np.nanmedian(seconds):7.2f}"
        )


def main(argv: list[str] | None = None) -> None:
    """Learn the verdicts, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=40, help="of each kind")
    parser.add_argument("--learn", action="store_true", help="write the verdicts that ship")
    args = parser.parse_args(argv)
    torch.set_num_threads(1)
    cases = [*scans(args.learn, args.pairs), *shapes(args.learn, args.pairs)]
    if args.learn:
        VERDICTS.write_text(json.dumps(learn(cases), indent=1) + "\n", encoding="utf-8")
        return
    for line in tabulate([*cases, *drives(args.pairs)]):
        sys.stdout.write(line + "\n")


if __name__ == "__main__":
    main()
