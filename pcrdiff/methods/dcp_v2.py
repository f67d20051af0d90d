"""Deep Closest Point (Wang & Solomon 2019), second version: a transformer between the clouds."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.models.dgcnn import DGCNN
from pcrdiff.models.losses import rotation_loss, translation_loss
from pcrdiff.models.matching import fit_pointers
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds


class Transformer(nn.Module):
    """One encoder and one decoder block, the norms first, no dropout (Vaswani et al. 2017).

    Points come in no order, so no position is encoded.
    """

    def __init__(self, dim: int, heads: int = 4) -> None:
        """``dim`` of the features, a multiple of ``heads``; twice as wide inside the blocks."""
        super().__init__()
        self.encoder = nn.TransformerEncoderLayer(
            dim, heads, 2 * dim, dropout=0.0, batch_first=True, norm_first=True
        )
        self.decoder = nn.TransformerDecoderLayer(
            dim, heads, 2 * dim, dropout=0.0, batch_first=True, norm_first=True
        )
        self.norm_encoder, self.norm_decoder = nn.LayerNorm(dim), nn.LayerNorm(dim)

    def forward(
        self, features: Float[Tensor, "batch n dim"], other: Float[Tensor, "batch m dim"]
    ) -> Float[Tensor, "batch n dim"]:
        """What the first cloud's points learn from the other cloud, once that has read itself."""
        memory = self.norm_encoder(self.encoder(other))
        told: Tensor = self.norm_decoder(self.decoder(features, memory))
        return told


class DCPv2(LearnedMethod):
    """Features of every point that know of both clouds, to soft matches, to the pose."""

    name = "dcp_v2"

    def __init__(self, feature_dim: int, neighbours: int) -> None:
        """``feature_dim`` of a point, 512 in DCP; ``neighbours`` on its graph, 20 in DCP."""
        super().__init__()
        self.encoder = DGCNN(feature_dim, neighbours)
        self.transformer = Transformer(feature_dim)
        self.neighbours = neighbours

    def estimate(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> Float[Tensor, "batch 4 4"]:
        """T_target_source, in one pass (Secs. 4.1 to 4.4)."""
        source_features, target_features = self.encoder(source), self.encoder(target)
        return fit_pointers(
            source,
            target,
            source_features + self.transformer(source_features, target_features),
            target_features + self.transformer(target_features, source_features),
        )

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Eq. (16); nothing is drawn."""
        del generator
        T_estimate = self.estimate(pairs.source, pairs.target)
        T_truth = pairs.T_target_source.to(T_estimate)
        return {
            "rotation": rotation_loss(T_estimate, T_truth),
            "translation": translation_loss(T_estimate, T_truth),
        }

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Estimate T_target_source; nothing is drawn."""
        del generator
        check_clouds(self.name, source, target, minimum=self.neighbours)
        return self.estimate(source, target)
