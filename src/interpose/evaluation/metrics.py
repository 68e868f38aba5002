"""Measures of a motion. Those that the finishing reports, too, live beside it."""

from interpose.finish.measures import (
    SLIDE_HEIGHT,
    acceleration,
    bone_deviation,
    foot_slide,
    foot_travel,
    joint_error,
    seam_jump,
    speed,
    stance_speed,
)

__all__ = [
    "SLIDE_HEIGHT",
    "acceleration",
    "bone_deviation",
    "foot_slide",
    "foot_travel",
    "joint_error",
    "seam_jump",
    "speed",
    "stance_speed",
]
