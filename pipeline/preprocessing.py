"""From a raw data set to the pairs of a scenario, and a record of how they were made."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pcrdiff.data import kitti, modelnet40, threedmatch
from pcrdiff.data.acquisition import read_manifest, read_source
from pcrdiff.data.raw import RawItem
from pcrdiff.data.scenarios import Corruption, Split, choose_shown, make_pairs, split_items
from pcrdiff.registration import Pairs
from pcrdiff.spreading import Spread, in_turn
from pipeline.artifacts import Streamed
from pipeline.invocation import project_root
from pipeline.params import Scenario
from pipeline.progress import bar
from pipeline.seeding import stream

READERS: dict[str, Callable[[Path], list[RawItem]]] = {
    "modelnet40": modelnet40.read_items,
    "3dmatch": threedmatch.read_items,
    "kitti": kitti.read_items,
}
LICENCES = {
    "modelnet40": "academic use (modelnet.cs.princeton.edu)",
    "3dmatch": "terms of 7-Scenes and SUN3D (3dmatch.cs.princeton.edu)",
    "kitti": "CC BY-NC-SA 3.0 (www.cvlibs.net)",
}
SYNTHETIC_LICENCE = "MIT, made by this project"


@dataclass(frozen=True)
class Preprocessed:
    """The content of a pair file; see ``pipeline.artifacts.write_pairs``."""

    splits: Mapping[str, Streamed]
    """Made as they are written."""
    label: str
    attributes: Mapping[str, object]


def preprocess(
    name: str,
    scenario: Scenario,
    family: str,
    raw: Path,
    *,
    seed: int,
    spread: Spread = in_turn,
) -> Preprocessed:
    """List the pairs of one scenario; each is made when it is asked for.

    Raises:
        FileNotFoundError: The raw data set is not there, or a file of it is gone.
        ValueError: A raw file is malformed, too small for the scenario, or lacks normals that the
            scenario wants given: also while the pairs are made.
    """
    items = READERS[family](read_manifest(raw, base=project_root()))
    chosen = split_items(items, Split(**scenario.split.model_dump()))
    corruption = Corruption(
        scenario.num_points,
        scenario.sampling,
        scenario.max_rotation,
        scenario.max_translation,
        scenario.jitter_deviation,
        scenario.jitter_clip,
        scenario.keep,
        scenario.normals,
    )
    splits = {}
    for split, index in chosen.items():
        seeds = [stream(seed, f"{name}/{split}")]
        shown = choose_shown(index, getattr(scenario.pairs, split), seeds)
        blocks = make_pairs(items, shown, corruption, seeds, bar, spread)
        splits[split] = Streamed(len(shown), _of(scenario.dataset, blocks))
    source, sha256 = read_source(raw)
    provenance = {
        "dataset": scenario.dataset,
        "source": source,
        "files_sha256": sha256,
        "items": {split: len(index) for split, index in chosen.items()},
        "licence": SYNTHETIC_LICENCE if source == "synthetic" else LICENCES[family],
        "scenario": scenario.model_dump(),
    }
    label = "category" if family == "modelnet40" else "scene"
    attributes = {"scenario": name, "unit": "unit sphere", "seed": seed, "provenance": provenance}
    return Preprocessed(splits, label, attributes)


def _of(dataset: str, blocks: Iterator[Pairs]) -> Iterator[Pairs]:
    """The same blocks; what is wrong with one is said of the data set."""
    try:
        yield from blocks
    except ValueError as error:
        raise ValueError(f"{dataset}: {error}") from error
