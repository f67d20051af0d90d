"""KISS-Matcher (Lim et al. 2025) by its authors' library."""

import torch

from pcrdiff.bindings.isolation import Isolated
from pcrdiff.bindings.kiss_matcher import kiss_match
from pcrdiff.geometry.rigid import centred, check_pose, from_parts, invert
from pcrdiff.geometry.span import check_support
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


class KISSMatcher(PairwiseMethod):
    """Matches features, keeps the largest consistent core of matches, and fits it robustly.

    The library's defaults, but two that are meant for scans in metres: the size of the voxels,
    of which every other length is a multiple, and that each voxel is thinned to one point.
    The library turns normals towards the origin, so both clouds are centred there first. Its
    threads race for the normals' bits and it crashes on clouds so sparse that no point has a
    feature: it runs in a child process of one thread.
    """

    name = "kiss_matcher"

    def __init__(self, voxel_size: float, timeout: float) -> None:
        """``voxel_size`` in the clouds' unit; ``timeout`` of a pair in seconds."""
        self.voxel_size = voxel_size
        self.isolated = Isolated(self.name, timeout)

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Match and fit; nothing is drawn.

        Raises:
            ValueError: The matches that agree with the answer fix no pose.
            RuntimeError: The library ended its process, or did not answer in time.
        """
        (p, T_source_p), (q, T_target_q) = centred(source), centred(target)
        clouds = p.float().numpy(), q.float().numpy()
        R, t, p_agreeing, q_agreeing = self.isolated.call(kiss_match, *clouds, self.voxel_size)
        check_support(self.name, p_agreeing, q_agreeing, "that agree")
        pose = from_parts(torch.from_numpy(R), torch.from_numpy(t))
        return T_target_q @ check_pose(self.name, pose.numpy()) @ invert(T_source_p)
