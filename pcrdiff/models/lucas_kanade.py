"""Lucas-Kanade on the feature of a cloud: what PointNetLK and FMR share (Aoki et al. 2019)."""

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.geometry.twist import exp_twist
from pcrdiff.models.losses import pose_loss
from pcrdiff.models.pointnet import PointNet
from pcrdiff.registration import LearnedMethod, Pairs, Poses, Sources, Targets

DAMPING = 1e-3  # of J^T J, as a share of its mean diagonal
NOTHING = 1e-9  # a mean diagonal so small that nothing can be solved for
LONGEST = 1.0  # twist of one update; a longer step is beyond the reach of the Jacobian
CONVERGED = 1e-7  # twist of the last update, below which there is no other; the authors'


class LucasKanadeMethod(LearnedMethod):
    """Gauss-Newton on the global feature of a PointNet."""

    def __init__(
        self, feature_dim: int, difference: float, train_updates: int, updates: int
    ) -> None:
        """The authors' numbers: a feature of 1024, 10 updates in training.

        ``difference`` is the step of the Jacobian's finite differences: theirs is 0.01; 0.1 reaches
        further.
        """
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.difference, self.train_updates, self.updates = difference, train_updates, updates

    def align_loss(self, pairs: Pairs) -> Float[Tensor, ""]:
        """``|G_est^-1 G_gt - I|_F`` after each update, mean over them (Aoki et al., Sec. 3)."""
        poses = align(self.encoder, pairs.source, pairs.target, self.difference, self.train_updates)
        losses = [pose_loss(T_estimate, pairs.T_target_source) for T_estimate in poses]
        return torch.stack(losses).mean().to(pairs.source)

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """Align until it converges or the updates are spent; nothing is drawn."""
        return align(self.encoder, source, target, self.difference, self.updates)[-1].to(source)


def align(
    encoder: PointNet, source: Sources, target: Targets, difference: float, updates: int
) -> list[Float64[Tensor, "batch 4 4"]]:
    """Move the source until its feature is the target's, by Gauss-Newton on the twist.

    Inverse-compositional: the target is the template, on whose side the motion is linearised, so
    its Jacobian is computed once. Both clouds count from their own means. An update passes no
    gradient to the next one.

    Args:
        encoder: Gives a cloud its feature.
        source: The cloud that moves.
        target: The cloud that stays.
        difference: Step of the Jacobian's finite differences; see :func:`pose_jacobian`.
        updates: The most that are made.

    Returns:
        T_target_source after each update, ``updates`` of them or fewer if all have converged.
    """
    p_mean, q_mean = source.mean(dim=-2), target.mean(dim=-2)
    p, q = source - p_mean.unsqueeze(-2), target - q_mean.unsqueeze(-2)
    eye = torch.eye(3).to(source).expand(len(source), 3, 3)
    from_p_mean, to_q_mean = from_parts(eye, -p_mean).double(), from_parts(eye, q_mean).double()
    features = encoder(q)
    inverse = damped_inverse(pose_jacobian(encoder, q, features, difference))
    T, done = torch.eye(4).to(from_p_mean).expand_as(from_p_mean), []
    for _ in range(updates):
        r = encoder(transform(T.to(p), p)) - features
        twist = -(inverse @ r.double().unsqueeze(-1)).squeeze(-1)  # xi = J^+ r, undone
        length = twist.norm(dim=-1, keepdim=True)
        twist = twist * (LONGEST / length.clamp(min=LONGEST))
        T_next = exp_twist(twist) @ T
        done.append(to_q_mean @ T_next @ from_p_mean)
        T = T_next.detach()
        if (length < CONVERGED).all():
            break
    return done


def pose_jacobian(
    encoder: PointNet, cloud: Sources, features: Float[Tensor, "batch dim"], difference: float
) -> Float[Tensor, "batch dim 6"]:
    """Derivative of ``features``, the cloud's, by the twist that moves it.

    By backward differences, ``(phi(Q) - phi(exp(-difference e_k) Q)) / difference``. A feature is
    linear in pieces, and a difference wide enough to span several (in radians and cloud units)
    predicts the effect of a large motion better than the slope of the piece the cloud is on.
    """
    steps = exp_twist(-difference * torch.eye(6).to(cloud))
    columns = [features - encoder(transform(T.expand(len(cloud), 4, 4), cloud)) for T in steps]
    return torch.stack(columns, dim=-1) / difference


def damped_inverse(jacobian: Float[Tensor, "batch dim 6"]) -> Float64[Tensor, "batch 6 dim"]:
    """``(J^T J + damping)^-1 J^T`` (Levenberg 1944), finite for any J."""
    J = jacobian.double()
    H = J.mT @ J
    damping = DAMPING * (H.diagonal(dim1=-2, dim2=-1).mean(dim=-1) + NOTHING)
    inverse: Tensor = torch.linalg.solve(H + damping[:, None, None] * torch.eye(6).to(H), J.mT)
    return inverse
