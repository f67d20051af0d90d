"""Point cloud registration by diffusion: the library."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pcrdiff.any_clouds import Choice, Registration


def register(
    source: Any,  # noqa: ANN401  NumPy, torch and paths; none is imported before it is needed
    target: Any,  # noqa: ANN401
    *,
    method: "Choice" = "auto",
    seed: int = 0,
) -> "Registration":
    """Find the pose that lays one cloud on the other, and say whether it can be trusted.

    Two scans of one scene or of one object, in any unit and frame, that overlap by about a third or
    more. Start poses are refined by generalized ICP and verified; nothing is assumed to be known.

    Args:
        source: The cloud that moves: ``[n, 3]`` points as an array or tensor, with further columns
            that are left out, or the path of a file (see ``pcrdiff.any_files.read_any``).
        target: The cloud that stays.
        method: Where the start poses come from: matched ``features``, ``random`` rotations, or
            ``diffusion``, the samples of the network that ships. ``auto`` takes features first, and
            all three together where the answer is in doubt.
        seed: Of the random draws; the same seed gives the same answer.

    Returns:
        The pose in the clouds' own frames and unit, and what speaks for it.

    Raises:
        FileNotFoundError, ValueError: A file or a cloud is not what it should be, or no pose is
            found; the sentence says which.
    """
    from pcrdiff.any_clouds import register_arrays
    from pcrdiff.any_files import as_points

    p, q = as_points(source, "source"), as_points(target, "target")
    return register_arrays(p, q, method, seed)


__all__ = ["register"]
