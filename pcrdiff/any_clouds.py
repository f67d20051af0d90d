"""Registering any two clouds: their unit, extent and overlap are not known, nor is any truth.

Poses of matched features are refined and verified (``pcrdiff.hypotheses``). Where their answer is
in doubt, random rotations and samples of the moved CB that ships join them, which help with two
clouds of one object. How likely an answer is right was learned from pairs whose truth is known.
"""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import torch
from jaxtyping import Float64
from safetensors import safe_open
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from torch import Tensor

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import FeatureMatching
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.consistency import consistent_poses
from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.geometry.rotation import matrix_from_quaternion
from pcrdiff.hypotheses import Refinement, Search, Starts, Verified
from pcrdiff.methods.pcrdiffusion_cb_moved import PCRDiffusionCBMoved
from pcrdiff.models.refined_walks import RefinedWalks
from pcrdiff.registration import EVIDENCE as FIT
from pcrdiff.verdict import Verdict

Points = Float64[np.ndarray, "_ 3"]
Pose = Float64[np.ndarray, "4 4"]
Kind = Literal["features", "random", "diffusion"]
"""Where start poses come from."""
Choice = Literal["auto", "features", "random", "diffusion"]

WEIGHTS = Path(__file__).parent / "weights"
NETWORK = WEIGHTS / "pcrdiffusion_cb_moved" / "modelnet40-rpm.safetensors"
VERDICTS = Path(__file__).with_suffix(".json")
POINTS = 4_000
"""About as many are left of the cloud that fills more voxels."""
FINEST = 1 / 150
"""The smallest voxels that are tried."""
SPACING = 1.5
"""Voxels are this many times as large as the median distance between neighbours, or larger."""
EXTENT = 95.0
"""Percentile of the distances from the centroid that counts as a cloud's radius."""
LEAST_MATCHES, MOST_MATCHES = 3, 1_500
"""Of features; more would only take time."""
COARSE_POINTS = 700
EVIDENCE = (*FIT, "support", "supporting")
"""Beside how well an answer fits: the logarithm of the number of matches that support it, and their
share."""
STARTS = {"features": 8, "random": 64, "diffusion": 8}
LADDER: dict[str, tuple[tuple[Kind, ...], ...]] = {
    "auto": (("features",), ("features", "random", "diffusion")),
    "features": (("features",),),
    "random": (("random",),),
    "diffusion": (("diffusion",),),
}
"""Sources of starts, tried until an answer is trusted."""


@dataclass(frozen=True)
class Registration:
    """An answer for two clouds, in their own frames and unit."""

    T_target_source: Pose
    """Carries the source into the target's frame, in float64."""
    verdict: Literal["trust", "doubt"]
    probability: float
    """That the answer is right, from what speaks for it."""
    overlap: float
    """Share of both clouds' points that lie near the other cloud."""
    rmse: float
    """Of the distances from those of the source to their nearest point of the target."""
    method: str
    """Where the start poses came from."""
    seconds: float


class Prepared:
    """Two clouds about their centroids, thinned on voxels, the larger one's radius as the unit."""

    def __init__(self, source: Points, target: Points) -> None:
        """Clouds in any frame and unit.

        Raises:
            ValueError: A cloud lies in one place, or has too few points, or is far smaller than
                the other.
        """
        self.means = source.mean(axis=0), target.mean(axis=0)
        clouds = [cloud - mean for cloud, mean in zip((source, target), self.means, strict=True)]
        self.unit = float(max(np.percentile(np.linalg.norm(c, axis=1), EXTENT) for c in clouds))
        if not self.unit > 0:
            raise ValueError("register needs clouds with an extent, got points in one place")
        self.voxel, thinned = _thin([cloud / self.unit for cloud in clouds])
        self.source, self.target = (torch.from_numpy(cloud) for cloud in thinned)

    def propose(self, kind: Kind, *, generator: torch.Generator) -> Starts:
        """Start poses of one kind."""
        count = STARTS[kind]
        match kind:
            case "features":
                return self._match(count)
            case "random":  # a normal vector of four entries has no preferred direction
                turned = torch.randn(count, 4, generator=generator, dtype=torch.float64)
                return from_parts(matrix_from_quaternion(turned), torch.zeros(count, 3).double())
            case "diffusion":
                walks = RefinedWalks(_network(), count, self.refinement)
                p, q = self.source.float(), self.target.float()
                return walks.propose(p, q, count, generator=generator).double()

    @cached_property
    def matches(self) -> tuple[Float64[Tensor, "matches 3"], Float64[Tensor, "matches 3"]]:
        """Points whose features are each other's nearest, evenly chosen where there are many."""
        matching = FeatureMatching(self.tolerance, 5 * self.voxel, 100, 2 * self.voxel)
        p, q = matching.match(self.source.float(), self.target.float(), mutual=True)
        few = torch.linspace(0, len(p) - 1, min(len(p), MOST_MATCHES)).long()
        return p[few], q[few]

    @property
    def tolerance(self) -> float:
        """How far a match may lie off a pose that it supports."""
        return 1.5 * self.voxel

    def _match(self, count: int) -> Starts:
        """The best supported poses of the matches; none where there are too few."""
        p, q = self.matches
        if len(p) < LEAST_MATCHES:
            return torch.zeros(0, 4, 4, dtype=torch.float64)
        return consistent_poses(p.float(), q.float(), self.tolerance)[:count].double()

    def evidence(self, found: Verified) -> Float64[np.ndarray, " numbers"]:
        """What speaks for an answer: how well it fits, and which matches of features support it."""
        p, q = self.matches
        off = (transform(found.T_target_source, p) - q).norm(dim=-1)
        support = int((off <= self.tolerance).sum())
        counted = np.array([np.log1p(support), support / max(1, len(p))])
        return np.concatenate([found.evidence, counted])

    @property
    def refinement(self) -> Refinement:
        """How starts are refined on voxels of this size."""
        v = self.voxel
        return Refinement((3 * v, 1.5 * v), 1.5 * v, 2 * v, COARSE_POINTS, finalists=3)

    def outside(self, T: Float64[Tensor, "4 4"]) -> Pose:
        """A pose of these clouds as one of the clouds that were given."""
        R, pose = Rotation.from_matrix(T[:3, :3].numpy()).as_matrix(), np.eye(4)
        pose[:3, :3] = R  # to the last bit: it turns coordinates of millions of metres
        pose[:3, 3] = self.unit * T[:3, 3].numpy() + self.means[1] - R @ self.means[0]
        return pose

    def rmse(self, T: Float64[Tensor, "4 4"]) -> float:
        """Of the distances of the source's points that lie near the target, in the given unit."""
        moved = transform(T, self.source).numpy()
        distances = np.asarray(cKDTree(self.target.numpy()).query(moved)[0])
        near = distances[distances < 2 * self.voxel]
        return self.unit * float(np.sqrt(np.square(near).mean()))


def register_arrays(source: Points, target: Points, method: str, seed: int) -> Registration:
    """Register two arrays; see :func:`pcrdiff.register`.

    Raises:
        ValueError: There is no such method, or as there.
    """
    if method not in LADDER:
        raise ValueError(f"register needs a method among {', '.join(LADDER)}, got {method!r}")
    began, generator = time.perf_counter(), torch.Generator().manual_seed(seed)
    clouds, answer, failure = Prepared(source, target), None, None
    for kinds in LADDER[method]:
        try:
            answer = _weighed(clouds, kinds, generator=generator)
        except ValueError as error:  # these starts lead nowhere, further ones may
            failure = error
        if answer and answer.trusted:
            break
    if answer is None:
        raise failure or ValueError("register found no pose")
    return Registration(
        clouds.outside(answer.found.T_target_source),
        "trust" if answer.trusted else "doubt",
        answer.probability,
        answer.found.overlap,
        clouds.rmse(answer.found.T_target_source),
        answer.kinds,
        time.perf_counter() - began,
    )


class _Answer(NamedTuple):
    """The best fit from some kinds of starts, and how far to trust it."""

    kinds: str
    found: Verified
    probability: float
    trusted: bool


def _weighed(clouds: Prepared, kinds: Sequence[Kind], *, generator: torch.Generator) -> _Answer:
    found, name = search(clouds, kinds, generator=generator), " + ".join(kinds)
    probability = verdicts()[name].probability(clouds.evidence(found)[None])
    trusted = bool(verdicts()[name].trusts(probability).all())
    return _Answer(name, found, float(probability.item()), trusted)


def search(clouds: Prepared, kinds: Sequence[Kind], *, generator: torch.Generator) -> Verified:
    """Refine and verify the start poses of several kinds together.

    Raises:
        ValueError: There are none, or the points that the clouds share under the best answer do
            not fix it.
    """
    with torch.no_grad():
        starts = torch.cat([clouds.propose(each, generator=generator) for each in kinds])
    if len(starts) == 0:
        raise ValueError("register needs features that match, the clouds have none")
    found = Search(starts, clouds.source, clouds.target, clouds.refinement)
    return found.judge("register", len(starts))


def _thin(clouds: Sequence[Points]) -> tuple[float, list[Points]]:
    """The size of voxels that leave about ``POINTS`` of the larger cloud, and what is left.

    At least the distance between points, of which the features need several within their radius.
    """
    clouds = _checked([_on_voxels(cloud, FINEST) for cloud in clouds])
    spacing = max(float(np.median(_to_neighbour(cloud))) for cloud in clouds)
    low, high = max(FINEST, SPACING * spacing), 0.5
    for _ in range(7):
        middle = float(np.sqrt(low * high))
        many = max(len(_on_voxels(cloud, middle)) for cloud in clouds) > POINTS
        low, high = (middle, high) if many else (low, middle)
    return high, _checked([_on_voxels(cloud, high) for cloud in clouds])


def _checked(clouds: list[Points]) -> list[Points]:
    """Refuse clouds that fill too few voxels.

    Raises:
        ValueError: One of them does.
    """
    least = PCRDiffusionCBMoved.least_points
    for name, cloud in zip(("source", "target"), clouds, strict=True):
        if len(cloud) < least:
            raise ValueError(
                f"register needs clouds of {least} distinct points, the {name} cloud has "
                f"{len(cloud)}: it is too sparse, or far smaller than the other"
            )
    return clouds


def _to_neighbour(cloud: Points) -> Float64[np.ndarray, " _"]:
    """From each point the distance to the nearest other one."""
    distances: Float64[np.ndarray, " _"] = np.asarray(cKDTree(cloud).query(cloud, 2)[0])[:, 1]
    return distances


def _on_voxels(cloud: Points, size: float) -> Points:
    """The mean of the points in each voxel."""
    whole = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud))
    return np.asarray(whole.voxel_down_sample(size).points)


@cache
def _network() -> PCRDiffusionCBMoved:
    """The moved CB that ships, with one step from the mode and from noise."""
    with safe_open(NETWORK, framework="pt") as file:
        network = json.loads(file.metadata()["facts"])["network"]
        weights = {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118
    walk = Walk(network.pop("timesteps"), 1, "feedback", spacing="quadratic", start="mode")
    method = PCRDiffusionCBMoved(walk, **network)
    method.load_state_dict(weights)
    return method.eval()


@cache
def verdicts() -> Mapping[str, Verdict]:
    """What was learned of answers from each set of sources."""
    file = json.loads(VERDICTS.read_text(encoding="utf-8"))
    return {name: Verdict(**_frozen(values)) for name, values in file.items()}


def _frozen(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: tuple(each) if isinstance(each, list) else each for key, each in values.items()}
