"""Deep Closest Point (Wang & Solomon 2019), first version: DGCNN features and a soft pointer."""

from pcrdiff.models.pointers import Features, PointerMethod
from pcrdiff.registration import Sources, Targets


class DCPv1(PointerMethod):
    """Features of each cloud on its own, to soft matches, to the pose (Secs. 4.1, 4.3 and 4.4).

    The second version (``dcp_v2``) adds cross-attention between the two clouds.
    """

    name = "dcp_v1"

    def features(self, source: Sources, target: Targets) -> Features:
        """Those of the graph network."""
        return self.encoder(source), self.encoder(target)
