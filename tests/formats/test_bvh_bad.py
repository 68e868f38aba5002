"""Damaged BVH files: one error each, with the place and what to do, and never anything else."""

from __future__ import annotations

import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interpose import formats
from interpose.errors import FileError, RequestError
from interpose.formats.bvh import header, motion_text
from interpose.geometry import rotations

JOINTS = [("Root", 0, (0, 0, 0), "xyzZXY"), ("Tip", 1, (0, 170, 0), "ZXY")]
VALUES = np.round(np.random.default_rng(1).uniform(-50, 50, (4, 9)), 3).astype(str)


@pytest.fixture
def good(make_bvh):
    return make_bvh(JOINTS, VALUES)


def error(tmp_path, text):
    path = tmp_path / "a.bvh"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(FileError) as caught:
        formats.load(path)
    assert caught.value.what
    assert caught.value.why
    assert caught.value.fix
    assert "\n" not in caught.value.what + caught.value.why + caught.value.fix
    return caught.value.why


def number(value, text):
    """The line of the first occurrence."""
    return text[: text.index(value)].count("\n") + 1


def test_not_a_bvh_file(tmp_path, good):
    assert "empty" in error(tmp_path, "")
    assert "empty" in error(tmp_path, " \r\n\t")
    assert "binary" in error(tmp_path, b"Kaydara FBX Binary  \x00\x1a\x00")
    assert "binary" in error(tmp_path, good.encode("utf-16"))
    assert "HIERARCHY" in error(tmp_path, "<html></html>")
    assert "HIERARCHY" in error(tmp_path, good[10:])
    assert "MOTION" in error(tmp_path, good.partition("MOTION")[0])


def test_paths(tmp_path, good):
    (tmp_path / "walk1.bvh").write_text(good)
    with pytest.raises(FileError, match=r"Did you mean walk1\.bvh"):
        formats.load(tmp_path / "walk.bvh")
    (tmp_path / "folder.bvh").mkdir()
    with pytest.raises(FileError, match="directory"):
        formats.load(tmp_path / "folder.bvh")
    with pytest.raises(FileError, match="no folder"):
        formats.load(tmp_path / "nowhere" / "a.bvh")
    with pytest.raises(RequestError, match=r"\.bvh, \.npz"):
        formats.load(tmp_path / "walk.mp3")
    with pytest.raises(FileError):
        formats.load(tmp_path / ("x" * 400 + ".bvh"))
    with pytest.raises(FileError):
        formats.load(tmp_path / "nul\0.bvh")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("  JOINT", "  }\n  JOINT", "JOINT stands at the wrong place"),
        ("}\nMOTION", "MOTION", "braces do not balance"),
        ("}\nMOTION", "}\n}\nMOTION", "never opened"),
        ("{", "", "expected"),
        ("OFFSET 0 170 0", "OFFSET 0 170", "OFFSET needs three numbers"),
        ("OFFSET 0 170 0", "OFFSET 0 nan 0", "OFFSET needs three numbers"),
        ("OFFSET 0 170 0", "OFFSET 0 1e300 0", "OFFSET needs three numbers"),
        ("OFFSET 0 170 0", "OFFSET 0 170 0 0", "OFFSET needs three numbers"),
        ("    OFFSET 0 170 0\n", "", "Tip has no OFFSET"),
        ("OFFSET 0 170 0", "OFFSET 0 0 0", "length zero"),
        ("CHANNELS 3", "CHANNELS 4", "CHANNELS says 4, 3 names follow"),
        ("CHANNELS 3", "CHANNELS x", "CHANNELS says x"),
        ("CHANNELS 3", "CHANNELS ³", "CHANNELS says ³"),
        ("OFFSET 0 170 0", "OFFSET 0 ١٧ 0", "OFFSET needs three numbers"),
        ("CHANNELS 3 Z", "CHANNELS 3 W", "unknown or repeated"),
        ("CHANNELS 3 Zrotation", "CHANNELS 3 Xrotation", "unknown or repeated"),
        ("ROOT", "BONE", "cannot understand 'BONE'"),
        ("ROOT Root", "ROOT Root\nROOT Other", "expected"),
        ("Frames: 4", "Frames: four", "no number of frames"),
        ("Frames: 4", "Frames: -4", "no number of frames"),
        ("Frames: 4", "", "no number of frames"),
        ("Frames: 4", "Frames: 0", "no frames"),
        ("Frames: 4", "Frames: 3", "36 numbers follow"),
        ("Frames: 4", "Frames: 5", "holds 4"),
        ("Frames: 4", "Frames: 999999999999", "truncated"),
        ("Time: 0.0333333", "Time: 0", "frame time is 0"),
        ("Time: 0.0333333", "Time: -0.1", "frame time is -0.1"),
        ("Time: 0.0333333", "Time: nan", "frame time is nan"),
        ("Time: 0.0333333", "Time: 8.33333", "a frame takes 8.33333 seconds"),
        ("Time: 0.0333333", "Time: 1e-320", "frame time is"),
        ("Time: 0.0333333", "Time: 1e-9", "a frame takes 1e-09 seconds"),
        ("Frame Time: 0.0333333", "", "no frame time"),
    ],
)
def test_header(tmp_path, good, old, new, why):
    assert old in good
    assert why in error(tmp_path, good.replace(old, new, 1))


@pytest.mark.parametrize(
    "value", ["nan", "inf", "-inf", "1e999", "1e12", "abc", "1,5", "0x10", "1_0", "--1", "1.2.3"]
)
def test_no_number(tmp_path, good, value):
    """Anything but a sensible number is named, with its line."""
    text = good.replace(VALUES[2, 4], value)
    why = error(tmp_path, text)
    assert f"line {number(value, text)}" in why
    assert value in why


def test_what_to_do_with_numbers_that_are_too_many_helps(tmp_path, good):
    for text, fix in (
        (good.replace("Frames: 4", "Frames: 3", 1), "Frames: 4"),
        (f"{good}\n1 2 3\n", "Delete"),
    ):
        path = tmp_path / "a.bvh"
        path.write_text(text)
        with pytest.raises(FileError) as caught:
            formats.load(path)
        assert fix in caught.value.fix


def test_wrong_counts_name_the_line(tmp_path, good):
    lines = good.splitlines()
    for change in (lines[-2] + " 1.5", lines[-2].rpartition(" ")[0]):
        text = "\n".join([*lines[:-2], change, lines[-1], ""])
        why = error(tmp_path, text)
        assert f"line {len(lines) - 1} has {len(change.split())} numbers, its channels ask for 9" in why
    # one line too long and one too short: the sum fits, the frames do not
    moved = [*lines[:-3], lines[-3] + " 1", lines[-2].partition(" ")[2], lines[-1]]
    assert f"line {len(lines) - 2} has 10 numbers" in error(tmp_path, "\n".join(moved))


def test_truncated(tmp_path, good):
    lines = good.splitlines(keepends=True)
    assert "holds 3:" in error(tmp_path, "".join(lines[:-1]))
    why = error(tmp_path, "".join(lines[:-2]) + " ".join(lines[-2].split()[:5]))
    assert "holds 2 and 5 of the 9 numbers of one more" in why
    assert "holds 0" in error(tmp_path, "".join(lines[:-4]))


def test_nesting_and_joints_are_limited(tmp_path):
    deep = "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\n" + "JOINT j\n{\nOFFSET 0 1 0\n" * 100_000 + "\nMOTION\n"
    start = time.perf_counter()
    assert "joints" in error(tmp_path, deep)
    assert time.perf_counter() - start < 2


def test_deep_is_fine(tmp_path):
    depth = 500
    text = "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n" + "JOINT j\n{\nOFFSET 0 1 0\n" * depth
    path = tmp_path / "a.bvh"
    path.write_text(text + "}\n" * (depth + 1) + "MOTION\nFrames: 1\nFrame Time: 1\n10\n")
    clip = formats.load(path)
    assert len(clip.skeleton) == depth + 1
    assert len(set(clip.skeleton.names)) == depth + 1


@pytest.mark.parametrize("part", ["header", "motion"])
def test_endless_line(tmp_path, good, monkeypatch, part):
    """A line without end is refused after a few blocks, whatever the size of the file says."""
    monkeypatch.setattr(motion_text, "BLOCK", 1 << 14)
    monkeypatch.setattr(motion_text, "LINE_LIMIT", 1 << 16)
    monkeypatch.setattr(motion_text, "HEADER_LIMIT", 1 << 16)
    monkeypatch.setattr(header, "HEADER_LIMIT", 1 << 16)
    size = 64 << 20
    text = good if part == "motion" else good.partition("OFFSET")[0]
    text = text.replace("Frames: 4", f"Frames: {size // 60}").rstrip()
    path = tmp_path / "a.bvh"
    path.write_text(text + " ")
    with path.open("r+b") as file:
        file.seek(len(text))
        file.write(b" 1" * (1 << 18))
        file.truncate(size)
    tracemalloc.start()
    start = time.perf_counter()
    with pytest.raises(FileError, match=r"longer than|no MOTION"):
        formats.load(path)
    seconds, (_, peak) = time.perf_counter() - start, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 1
    assert peak - size < 4 << 20  # the buffer is reserved, its pages never touched


def test_far_too_much_text(tmp_path, good, monkeypatch):
    monkeypatch.setattr(motion_text, "BLOCK", 1 << 10)
    assert "cannot fill" in error(tmp_path, good + "1 2 3\n" * 10_000)
    monkeypatch.setattr(motion_text, "FILE_LIMIT", 100)
    assert "larger than" in error(tmp_path, good)


# Anything at all ------------------------------------------------------------------------------------------

NAMES = st.text(
    st.characters(codec="utf-8", exclude_categories=["C", "Z"], exclude_characters="{}#"),
    min_size=1,
    max_size=8,
)
OFFSETS = st.floats(-1e3, 1e3).map(lambda v: f"{v:.5g}")


@st.composite
def hierarchies(draw):
    joints = []
    depth = -1
    for index in range(draw(st.integers(1, 8))):
        depth = draw(st.integers(0, depth + 1))
        channels = "".join(draw(st.permutations("xyzXYZ"))[: draw(st.integers(0 if index else 1, 6))])
        joints.append((draw(NAMES), depth, [draw(OFFSETS) for _ in range(3)], channels))
    return joints


@settings(max_examples=60)
@given(
    joints=hierarchies(),
    frames=st.integers(1, 4),
    seed=st.integers(0, 2**32),
    blank=st.sampled_from([" ", "\t", "  "]),
    end=st.sampled_from(["\n", "\r\n", " \n"]),
    up=st.sampled_from(["y", "z"]),
)
def test_any_hierarchy_round_trips(tmp_path_factory, make_bvh, joints, frames, seed, blank, end, up):
    """Unchanged: the same bytes. Changed as far as the channels can hold it: the same motion."""
    if all(set(map(float, o)) == {0.0} for _, d, o, _ in joints if d) and any(d for _, d, _, _ in joints):
        joints = [(n, d, ("0", "1", "0"), c) for n, d, _, c in joints]
    rng = np.random.default_rng(seed)
    columns = sum(len(c) for *_, c in joints)
    folder = tmp_path_factory.mktemp("any")
    rows = np.char.mod("%.7g", rng.uniform(-200, 200, (frames, columns)))
    (folder / "a.bvh").write_bytes(make_bvh(joints, rows, blank=blank, end=end).encode())
    clip = formats.load(folder / "a.bvh", unit=0.1, up=up, joint_positions="replace")
    formats.save(clip, folder / "b.bvh")
    assert (folder / "b.bvh").read_bytes() == (folder / "a.bvh").read_bytes()

    # Another motion that these channels can hold: that of a file with other numbers.
    rows = np.char.mod("%.7g", rng.uniform(-200, 200, (frames, columns)))
    (folder / "c.bvh").write_bytes(make_bvh(joints, rows, end=end).encode())
    other = formats.load(folder / "c.bvh", unit=0.1, up=up, joint_positions="replace")
    assert formats.save(clip.with_motion(other.rotation, other.translation), folder / "d.bvh") == ()
    again = formats.load(folder / "d.bvh", unit=0.1, up=up, joint_positions="replace")
    assert rotations.angle(again.rotation, other.rotation).max() < 1e-5
    np.testing.assert_allclose(again.translation, other.translation, atol=1e-4)


@settings(max_examples=300)
@given(
    edits=st.lists(
        st.tuples(
            st.floats(0, 1),
            st.integers(0, 12),
            st.one_of(
                st.binary(max_size=6),
                st.sampled_from(
                    [b"{", b"}", b"\n", b" ", b"nan", b"1e308", b"JOINT a", b"End Site", b"MOTION", b"-"]
                ),
            ),
        ),
        min_size=1,
        max_size=4,
    ),
    cut=st.floats(0, 1),
)
def test_fuzz(tmp_path_factory, make_bvh, edits, cut):
    """Damaged bytes give a FileError or a sound clip that can be written, and nothing else."""
    text = make_bvh(JOINTS, VALUES).encode()
    for place, length, new in edits:
        begin = int(place * len(text))
        text = text[:begin] + new + text[begin + length :]
    if cut > 0.9:
        text = text[: int((cut - 0.9) * 10 * len(text))]
    folder = tmp_path_factory.getbasetemp()
    (folder / "fuzz.bvh").write_bytes(text)
    try:
        clip = formats.load(folder / "fuzz.bvh")
    except FileError:
        return
    assert np.isfinite(clip.positions()).all()
    formats.save(clip, folder / "out.bvh", force=True)
    assert (folder / "out.bvh").read_bytes() == text
