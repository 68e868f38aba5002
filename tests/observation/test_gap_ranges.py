"""Ranges as people write them: frames, seconds, and an end that is left out."""

from __future__ import annotations

import pytest

from interpose.errors import RequestError
from interpose.observation import Gap


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("12:40", (12, 40)),
        ("1s:1.5s", (30, 45)),
        ("100:", (100, 209)),
        (":1s", (0, 30)),
        (" 1s : 2s ", (30, 60)),
    ],
)
def test_of_a_clip(cmu_walk, text, expected):
    assert len(cmu_walk) == 209
    gap = Gap.parse(text, clip=cmu_walk)
    assert (gap.start, gap.stop) == expected


@pytest.mark.parametrize("text", ["", ":", "12", "1s", "a:b", "1.5:3", "s:2", "nans:4s", "infs:", "1e999s:"])
def test_what_is_no_range(cmu_walk, text):
    with pytest.raises(RequestError, match="cannot read the gap"):
        Gap.parse(text, clip=cmu_walk)


def test_seconds_and_open_ends_need_a_clip():
    assert Gap.parse("3:4") == Gap(3, 4)
    for text in ("1s:2s", "3:", ":3"):
        with pytest.raises(RequestError):
            Gap.parse(text)
