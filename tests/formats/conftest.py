"""Small BVH files made by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

Joint = tuple[str, int, Sequence[object], str]


def bvh_text(
    joints: Sequence[Joint],
    frames: Sequence[Sequence[object]],
    time: str = "0.0333333",
    count: object = None,
    blank: str = " ",
    end: str = "\n",
) -> str:
    """BVH from joints (name, depth, offset, channels) in file order and from the numbers of the frames.

    Channels are written as "xyzZXY": small letters for positions, capitals for rotations.
    """
    lines = ["HIERARCHY"]
    depth = -1
    for i, (name, level, offset, channels) in enumerate(joints):
        while depth >= level:
            lines.append("  " * depth + "}")
            depth -= 1
        indent = "  " * level
        named = [c.upper() + ("position" if c.islower() else "rotation") for c in channels]
        lines += [
            f"{indent}{'JOINT' if level else 'ROOT'} {name}",
            f"{indent}{{",
            f"{indent}  OFFSET {blank.join(map(str, offset))}",
            f"{indent}  CHANNELS {blank.join([str(len(named)), *named])}",
        ]
        depth = level
        if i + 1 == len(joints) or joints[i + 1][1] <= level:
            lines += [f"{indent}  End Site", f"{indent}  {{", f"{indent}    OFFSET 0 1.5 0", f"{indent}  }}"]
    while depth >= 0:
        lines.append("  " * depth + "}")
        depth -= 1
    lines += ["MOTION", f"Frames: {len(frames) if count is None else count}", f"Frame Time: {time}"]
    lines += [blank.join(map(str, frame)) for frame in frames]
    return end.join(lines) + end


@pytest.fixture(scope="session")
def make_bvh() -> Callable[..., str]:
    return bvh_text


# A body in centimetres, standing: enough names that legs, feet and head are found.
BODY: tuple[Joint, ...] = (
    ("Hips", 0, (0, 90, 0), "xyzZXY"),
    ("LeftUpLeg", 1, (10, 0, 0), "ZXY"),
    ("LeftLeg", 2, (0, -45, 0), "ZXY"),
    ("LeftFoot", 3, (0, -42, 0), "ZXY"),
    ("RightUpLeg", 1, (-10, 0, 0), "ZXY"),
    ("RightLeg", 2, (0, -45, 0), "ZXY"),
    ("RightFoot", 3, (0, -42, 0), "ZXY"),
    ("Spine", 1, (0, 20, 0), "ZXY"),
    ("Head", 2, (0, 40, 0), "ZXY"),
)


@pytest.fixture(scope="session")
def body() -> tuple[Joint, ...]:
    return BODY
