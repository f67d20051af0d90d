"""KISS-Matcher (Lim et al. 2025) by its authors' library."""

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.bindings.isolation import Isolated
from pcrdiff.bindings.kiss_matcher import kiss_match
from pcrdiff.bindings.open3d_registration import centred, check_pose, check_support
from pcrdiff.geometry.rigid import from_parts, invert
from pcrdiff.registration import check_clouds


class KISSMatcher:
    """Matches features, keeps the largest consistent core of matches, and fits it robustly.

    The library's defaults, but two that are meant for scans in metres: the size of the voxels,
    of which every other length is a multiple, and that each voxel is thinned to one point.
    The library turns normals towards the origin, so both clouds are laid about it first. Its
    threads race for the normals' bits and it dies of clouds so sparse that no point has a
    feature: it runs in a child process of one thread.
    """

    name = "kiss_matcher"

    def __init__(self, voxel_size: float, timeout: float) -> None:
        """``voxel_size`` in the clouds' unit; ``timeout`` of a pair in seconds."""
        self.voxel_size = voxel_size
        self.isolated = Isolated(self.name, timeout)

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Match and fit; nothing is drawn.

        Raises:
            ValueError: Also when the matches that agree with the answer fix no pose.
            RuntimeError: The library ended its process, or did not answer in time.
        """
        del generator
        check_clouds(self.name, source, target)
        return torch.stack([self._register(p, q) for p, q in zip(source, target, strict=True)])

    def _register(
        self, source: Float[Tensor, "n 3"], target: Float[Tensor, "m 3"]
    ) -> Float64[Tensor, "4 4"]:
        (p, T_source_p), (q, T_target_q) = centred(source), centred(target)
        clouds = p.float().numpy(), q.float().numpy()
        R, t, p_agreeing, q_agreeing = self.isolated.call(kiss_match, *clouds, self.voxel_size)
        check_support(self.name, p_agreeing, q_agreeing, "that agree")
        pose = from_parts(torch.from_numpy(R), torch.from_numpy(t))
        check_pose(self.name, pose.numpy())
        return T_target_q @ pose @ invert(T_source_p)
