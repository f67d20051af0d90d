"""Deep Closest Point (Wang & Solomon 2019), second version: a transformer between the clouds."""

from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.models.pointers import Features, PointerMethod
from pcrdiff.registration import Sources, Targets


class Transformer(nn.Module):
    """One encoder and one decoder block, the norms first, no dropout (Vaswani et al. 2017).

    Points have no order, so no position is encoded.
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
        """What attention to the encoded other cloud adds to the features of the first."""
        memory = self.norm_encoder(self.encoder(other))
        added: Tensor = self.norm_decoder(self.decoder(features, memory))
        return added


class DCPv2(PointerMethod):
    """Features of each point conditioned on both clouds, to soft matches, to the pose."""

    name = "dcp_v2"

    def __init__(self, feature_dim: int, neighbours: int) -> None:
        """As in the first version; ``feature_dim`` is a multiple of four, the attention's heads."""
        super().__init__(feature_dim, neighbours)
        self.transformer = Transformer(feature_dim)

    def features(self, source: Sources, target: Targets) -> Features:
        """Those of the graph network, and what the transformer adds to them (Sec. 4.2)."""
        p, q = self.encoder(source), self.encoder(target)
        return p + self.transformer(p, q), q + self.transformer(q, p)
