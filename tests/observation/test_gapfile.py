"""Gaps from JSON: by hand, from a report, and with every slip of the pen."""

from __future__ import annotations

import json

import pytest

from interpose.errors import FileError
from interpose.observation import Gap
from interpose.observation.gapfile import EXAMPLE, read_gaps


@pytest.fixture
def read(tmp_path, cmu_walk):
    def read(content: object) -> list[Gap]:
        path = tmp_path / "gaps.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return read_gaps(path, cmu_walk)

    return read


def test_every_way_to_write_a_gap(read):
    entries = [
        {"frames": "120:160"},
        {"frames": [200, 230], "joints": ["LeftArm", "LeftHand"]},
        {"start": 5, "stop": 9, "joints": None},
        {"frames": "1s:1.5s"},
        {"frames": "200:"},
    ]
    gaps = [Gap(120, 160), Gap(200, 230, ("LeftArm", "LeftHand")), Gap(5, 9), Gap(30, 45), Gap(200, 209)]
    assert read(entries) == gaps
    assert read({"gaps": entries, "comment": "by hand"}) == gaps
    assert read([]) == []


def test_the_example_in_the_messages_is_right(read):
    assert read(EXAMPLE) == [Gap(120, 160), Gap(120, 159), Gap(200, 230, ("LeftArm",))]


def test_a_report_can_be_replayed(read):
    entry = {"start": 5, "stop": 9, "joints": ["LeftArm"], "method": "spline", "seam_after": 0.1, "notes": []}
    report = {"method": "auto", "gaps": [entry], "open": [], "file": "take.bvh"}
    assert read(report) == [Gap(5, 9, ("LeftArm",))]


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ("120:160", "an object"),
        ({"frames": "120"}, "START:STOP"),
        ({"frames": "160:120"}, "0 <= START < STOP"),
        ({"frames": [-3, 4]}, "0 <= START < STOP"),
        ({"frames": [1.5, 4]}, "whole numbers"),
        ({"frames": [True, 4]}, "whole numbers"),
        ({"frames": [1, 2, 3]}, "START:STOP"),
        ({"start": 3}, "START:STOP"),
        ({}, "START:STOP"),
        ({"frames": "1:2", "joints": "LeftArm"}, "list of names"),
        ({"frames": "1:2", "joints": []}, "list of names"),
        ({"frames": "1:2", "joint": ["LeftArm"]}, "no joint"),
    ],
)
def test_bad_entries_are_named(read, entry, why):
    with pytest.raises(FileError, match=r"gap number 2 in .*gaps\.json") as error:
        read([{"frames": "1:2"}, entry])
    assert why in error.value.why
    assert "Write" in error.value.fix
    assert len(str(error.value).splitlines()) == 3


@pytest.mark.parametrize(
    "content", ["", "{", "[1,", "{}", "3", '{"gaps": 4}', "[" * 100_000, "[" + "1" * 5001 + "]"]
)
def test_files_without_gaps_are_refused(read, content):
    with pytest.raises(FileError, match="gaps"):
        read(content)


@pytest.mark.parametrize("more", [{"method": "linear"}, {"method": "linear", "joint": ["LeftArm"]}])
def test_what_a_list_of_gaps_does_not_know_is_refused(read, more):
    """Also where it is a word of reports: nobody would do as it says."""
    with pytest.raises(FileError, match="cannot be understood"):
        read(json.dumps([{"frames": "100:110", **more}]))


def test_missing_binary_and_folder(tmp_path, cmu_walk):
    binary = tmp_path / "binary.json"
    binary.write_bytes(bytes(range(256)))
    for path in (binary, tmp_path, tmp_path / "nowhere.json"):
        with pytest.raises(FileError, match="cannot read"):
            read_gaps(path, cmu_walk)
