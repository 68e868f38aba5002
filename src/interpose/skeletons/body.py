"""What canonical joint positions tell about a body: where it faces."""

from __future__ import annotations

from typing import Any

from array_api_compat import array_namespace

from interpose.skeletons.canonical import JOINTS

Array = Any

# Left and right joints whose line across the body tells where it faces (hips and shoulders, as Holden 2016).
PAIRS = tuple((JOINTS.index("Left" + part), JOINTS.index("Right" + part)) for part in ("UpLeg", "Arm"))


def facing(positions: Array, observed: Array | None = None) -> Array:
    """Where canonical bodies face: yaw in radians, 0 along Z.

    Each frame speaks for itself: a facing smoothed over time would carry what is unobserved into frames
    that are observed, and the other way round.

    Args:
        positions: (..., 22, 3) canonical joint positions.
        observed: (..., 22) whether each is known. Pairs of which one is unknown are left out; where no
            pair is known all are taken, and the result means nothing.

    Returns:
        (...) radians.
    """
    xp = array_namespace(positions)
    across = xp.stack([positions[..., left, :] - positions[..., right, :] for left, right in PAIRS], axis=-2)
    if observed is not None:
        known = xp.stack([observed[..., left] & observed[..., right] for left, right in PAIRS], axis=-1)
        known = known | ~xp.any(known, axis=-1, keepdims=True)
        across = xp.where(known[..., None], across, xp.zeros_like(across))
    across = xp.sum(across, axis=-2)
    return xp.atan2(-across[..., 2], across[..., 0])
