"""From a raw data set to the pairs of a scenario, and a record of how they were made."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pcrdiff.data import kitti, modelnet40, threedmatch
from pcrdiff.data.acquisition import read_manifest, read_source
from pcrdiff.data.raw import RawItem
from pcrdiff.data.scenarios import Corruption, Split, make_pairs, split_items
from pcrdiff.registration import Pairs
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

    splits: Mapping[str, Pairs]
    label: str
    attributes: Mapping[str, object]


def preprocess(name: str, scenario: Scenario, family: str, raw: Path, *, seed: int) -> Preprocessed:
    """Make the pairs of one scenario.

    Raises:
        FileNotFoundError: The raw data set is not there, or a file of it is gone.
        ValueError: A raw file is malformed, too small for the scenario, or lacks normals that the
            scenario wants given.
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
    counts = scenario.pairs.model_dump()
    try:
        splits = {
            split: make_pairs(
                items, index, counts[split], corruption, [stream(seed, f"{name}/{split}")], bar
            )
            for split, index in chosen.items()
        }
    except ValueError as error:
        raise ValueError(f"{scenario.dataset}: {error}") from error
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
