"""DVC stage ``preprocess``: a raw data set to the pair file of one scenario."""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path

from pcrdiff.clouds.surface import DegenerateShape
from pcrdiff.datasets.families import READERS
from pcrdiff.datasets.items import RawItem
from pcrdiff.datasets.manifest import Manifest, read_manifest
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.loops import Spread, in_turn
from pcrdiff.pairs.scenarios import (
    Corruption,
    Shown,
    Split,
    choose_shown,
    find_degenerate,
    make_pairs,
    split_items,
)
from pcrdiff.registration import Pairs
from pipeline.compute.machine import settle
from pipeline.compute.progress import bar
from pipeline.compute.workers import spread_over
from pipeline.formats.pairs import Streamed, write_pairs
from pipeline.settings.params import Scenario, pick, read_params
from pipeline.settings.seeding import stream
from pipeline.tracking.journal import journal
from pipeline.tracking.run import project_root


def main(argv: list[str] | None = None) -> None:
    """Read params and the raw items, make the pairs of each split, write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--raw", type=Path, required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    section = pick(params.scenarios, args.scenario, "scenarios")
    family = params.acquire[section.dataset].family
    settle(threads=1)  # a pair has no work for more
    noted = {"dataset": section.dataset, "num_points": section.num_points}
    with journal(params={"scenario": args.scenario, **noted}, inputs=[args.raw]) as notes:
        spread = spread_over(params.compute, threads=1)
        made = preprocess(args.scenario, section, family, args.raw, seed=params.seed, spread=spread)
        write_pairs(args.pairs, made.splits, made.label, made.attributes)
        pairs = {f"{name}_pairs": split.count for name, split in made.splits.items()}
        dropped = {f"{name}_dropped": len(shapes) for name, shapes in made.dropped.items()}
        notes.metrics(pairs | dropped)


LICENCES = {
    "modelnet40": "academic use (modelnet.cs.princeton.edu)",
    "3dmatch": "terms of 7-Scenes and SUN3D (3dmatch.cs.princeton.edu)",
    "kitti": "CC BY-NC-SA 3.0 (www.cvlibs.net)",
}
SYNTHETIC_LICENCE = "MIT, made by this project"
SHAPE_POINTS = 1024
"""Of the whole shape beside a pair whose answers are measured: to validate and to test."""
DOUBLED_NAMED = 5
"""Doubled contents that are named before they are only counted."""


@dataclass(frozen=True)
class Preprocessed:
    """The content of a pair file; see ``pipeline.formats.pairs``."""

    splits: Mapping[str, Streamed]
    """Made as they are written."""
    label: str
    attributes: Mapping[str, object]
    dropped: Mapping[str, Sequence[str]]
    """Per split, the shape of each pair that was left out as degenerate."""


def preprocess(
    name: str, scenario: Scenario, family: str, raw: Path, *, seed: int, spread: Spread = in_turn
) -> Preprocessed:
    """List the pairs of one scenario; each is made when it is asked for.

    Content that stands in more than one split is named on stderr: what a method is tested on, it
    has then seen in training.

    Raises:
        FileNotFoundError: The raw data set is not there, or a file of it is gone.
        ValueError: A raw file is malformed, too small for the scenario, or lacks normals that the
            scenario wants given: also while the pairs are made. A shape is degenerate, and the
            scenario does not drop such, or drops all of a split.
    """
    manifest = read_manifest(raw, base=project_root())
    items = READERS[family](manifest.root)
    chosen = split_items(items, Split(**scenario.split.model_dump()))
    doubled = find_doubled(items, chosen, manifest.digests)
    if doubled:
        sys.stderr.write(f"pcrdiff preprocess: {_say_doubled(scenario.dataset, doubled)}\n")
    poses = PoseRange(scenario.max_rotation, scenario.max_translation, scenario.min_translation)
    corruption = Corruption(
        poses=poses,
        **{
            each.name: getattr(scenario, each.name)
            for each in fields(Corruption)
            if each.name not in ("poses", "shape_points")
        },
    )
    splits, dropped = {}, dict[str, list[str]]()
    for split, index in chosen.items():
        seeds = [stream(seed, f"{name}/{split}")]
        every = choose_shown(index, getattr(scenario.pairs, split), seeds)
        find = partial(find_degenerate, items, every, corruption, seeds, bar, spread)
        shown: Shown = every
        if scenario.degenerate == "drop" and (numbers := find()):
            dropped[split] = [items[every[k]].name for k in numbers]
            shown = _without(every, numbers, f"{scenario.dataset} {split}")
        kept = replace(corruption, shape_points=0 if split == "train" else SHAPE_POINTS)
        blocks = make_pairs(items, shown, kept, seeds, bar, spread)
        splits[split] = Streamed(len(shown), _of(scenario.dataset, blocks, find))
    provenance = {
        **_origin(scenario, family, manifest),
        "items": {split: len(index) for split, index in chosen.items()},
        **({"dropped_as_degenerate": dropped} if dropped else {}),
    }
    label = "category" if family == "modelnet40" else "scene"
    attributes = {"scenario": name, "unit": "unit sphere", "seed": seed, "provenance": provenance}
    return Preprocessed(splits, label, attributes, dropped)


def _origin(scenario: Scenario, family: str, manifest: Manifest) -> dict[str, object]:
    """Where the pairs come from, under which licence, and how they were made."""
    return {
        "dataset": scenario.dataset,
        "source": manifest.source,
        "files_sha256": manifest.sha256,
        "licence": SYNTHETIC_LICENCE if manifest.source == "synthetic" else LICENCES[family],
        "scenario": {key: v for key, v in scenario.model_dump().items() if key != "degenerate"},
    }


def find_doubled(
    items: Sequence[RawItem], chosen: Mapping[str, Sequence[int]], digests: Mapping[Path, str]
) -> list[dict[str, RawItem]]:
    """Find content that stands in more than one split.

    Args:
        items: All items of the data set.
        chosen: Which of them each split has.
        digests: The sha256 of the files, by their real paths.

    Returns:
        For each such content the first item of each split that has it.
    """
    met: dict[str, dict[str, RawItem]] = {}
    for split, indices in chosen.items():
        for item in (items[index] for index in indices):
            content = item.sha256 or (item.file and digests.get(item.file.resolve()))
            if content:
                met.setdefault(content, {}).setdefault(split, item)
    return [by_split for by_split in met.values() if len(by_split) > 1]


def _say_doubled(dataset: str, doubled: Sequence[Mapping[str, RawItem]]) -> str:
    named = [
        " = ".join(f"{_place(item)} in {split}" for split, item in by_split.items())
        for by_split in doubled[:DOUBLED_NAMED]
    ]
    more = f"; and {len(doubled) - DOUBLED_NAMED} more" if len(doubled) > DOUBLED_NAMED else ""
    return (
        f"{dataset} has the same content in several splits, {len(doubled)} times, so a method may be "
        f"tested on what it was trained on: {'; '.join(named)}{more}"
    )


def _place(item: RawItem) -> str:
    """The file of an item, or its name in a file that holds several."""
    return item.name if item.sha256 or item.file is None else str(item.file)


def _without(shown: Sequence[int], numbers: Sequence[int], where: str) -> dict[int, int]:
    """What the other pairs show, under their own numbers, so that their draws stay the same."""
    kept = {k: i for k, i in enumerate(shown) if k not in set(numbers)}
    if not kept:
        raise ValueError(
            f"{where} needs a shape that is not degenerate, got {len(shown)} on one line each or in "
            "one place"
        )
    return kept


def _of(
    dataset: str, blocks: Iterator[Pairs], find: Callable[[], Sequence[int]]
) -> Iterator[Pairs]:
    """The same blocks; an error in one names the data set.

    ``find`` tells which pairs are degenerate: asked when the first is met, to say how many.
    """
    try:
        yield from blocks
    except DegenerateShape as error:
        raise ValueError(
            f"{dataset}: {error}, which is one of {len(find())} degenerate pairs of its split; "
            "`degenerate: drop` of the scenario leaves them out"
        ) from error
    except ValueError as error:
        raise ValueError(f"{dataset}: {error}") from error
