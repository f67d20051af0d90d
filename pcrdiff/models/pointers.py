"""Deep Closest Point (Wang & Solomon 2019): a pose from points that point softly at others."""

from abc import abstractmethod

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.models.dgcnn import DGCNN
from pcrdiff.models.losses import rotation_loss, translation_loss
from pcrdiff.registration import LearnedMethod, Losses, Pairs, Poses, Sources, Targets

Features = tuple[Float[Tensor, "batch n dim"], Float[Tensor, "batch m dim"]]
"""Of every source point and of every target point."""


class PointerMethod(LearnedMethod):
    """DCP: DGCNN features of every point, soft matches between them, and the pose of those."""

    def __init__(self, feature_dim: int, neighbours: int) -> None:
        """``feature_dim`` of a point, 512 in DCP; ``neighbours`` on its graph, 20 in DCP."""
        super().__init__()
        self.encoder = DGCNN(feature_dim, neighbours)
        self.least_points = neighbours

    @abstractmethod
    def features(self, source: Sources, target: Targets) -> Features:
        """The features whose dot products are the scores of the matches."""

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """T_target_source, in one pass; nothing is drawn."""
        return fit_pointers(source, target, *self.features(source, target))

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Eq. (16); nothing is drawn."""
        T_estimate = self.answer(pairs.source, pairs.target, generator=generator)
        T_truth = pairs.T_target_source.to(T_estimate)
        return {
            "rotation": rotation_loss(T_estimate, T_truth),
            "translation": translation_loss(T_estimate, T_truth),
        }


def fit_pointers(
    source: Sources,
    target: Targets,
    source_features: Float[Tensor, "batch n dim"],
    target_features: Float[Tensor, "batch m dim"],
) -> Poses:
    """T_target_source that carries each source point to where it points among the target's.

    Wang & Solomon 2019 (DCP), Eqs. 10-15: a softmax over the target's points of the scaled dot
    products of the features, and a fit in which every source point weighs the same.
    """
    scores = source_features @ target_features.mT / source_features.shape[-1] ** 0.5
    return fit_rigid(source, scores.softmax(dim=-1) @ target, torch.ones_like(source[..., 0]))
