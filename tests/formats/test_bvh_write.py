"""Writing BVH: nothing changes but what was changed."""

from __future__ import annotations

import os
import re
from dataclasses import replace

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip, Skeleton
from interpose.errors import FileError, RequestError
from interpose.geometry import rotations
from interpose.skeletons import find_mapping


def motion_lines(path):
    return path.read_bytes().split(b"MOTION")[1].splitlines()[3:]


def test_unchanged_is_byte_identical(data, cmu_walk, tmp_path):
    formats.save(cmu_walk, tmp_path / "b.bvh")
    assert (tmp_path / "b.bvh").read_bytes() == (data / "cmu_walk.bvh").read_bytes()
    copied = cmu_walk.with_motion(cmu_walk.rotation.copy(), cmu_walk.translation.copy())
    formats.save(copied, tmp_path / "c.bvh")
    assert (tmp_path / "c.bvh").read_bytes() == (data / "cmu_walk.bvh").read_bytes()


def test_only_changed_numbers_change(data, cmu_walk, tmp_path):
    """A joint turned in some frames and the root moved in another: only those numbers have other text."""
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    joint = cmu_walk.skeleton.index("LeftForeArm")
    turn = rotations.exp(np.array([0.2, -0.1, 0.3]))
    rotation[50:60, joint] = rotations.multiply(turn, rotation[50:60, joint])
    translation[100, 0, 1] += 0.01
    changed = cmu_walk.with_motion(rotation, translation)
    path = tmp_path / "b.bvh"
    formats.save(changed, path)
    column = 3 + 3 * joint
    for frame, (was, now) in enumerate(
        zip(motion_lines(data / "cmu_walk.bvh"), motion_lines(path), strict=True)
    ):
        differs = {i for i, (a, b) in enumerate(zip(was.split(), now.split(), strict=True)) if a != b}
        if 50 <= frame < 60:
            assert differs == {column, column + 1, column + 2}
        else:
            assert differs == ({1} if frame == 100 else set())
    again = formats.load(path)
    assert rotations.angle(again.rotation, rotation).max() < 1e-5
    np.testing.assert_allclose(again.translation, translation, atol=3e-6)  # four decimals of 5.6 cm
    untouched = np.ones(rotation.shape[:2], bool)
    untouched[50:60, joint] = False
    np.testing.assert_array_equal(again.rotation[untouched], rotation[untouched])


@pytest.mark.parametrize("up", ["y", "z"])
def test_units_axes_and_line_ends_survive(tmp_path, make_bvh, body, up):
    """Changes are written in the file's own unit and axes, between its own blanks and line ends."""
    rng = np.random.default_rng(1)
    joints = [(n, d, o if up == "y" else (o[0], -o[2], o[1]), c) for n, d, o, c in body]
    values = np.round(rng.uniform(-20, 20, (8, 30)), 3)
    path = tmp_path / "a.bvh"
    path.write_bytes(make_bvh(joints, values, blank="\t ", end=" \r\n").encode())
    clip = formats.load(path)
    assert clip.source.up == up
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[3] = rotations.normalize(rng.standard_normal((len(joints), 4)))
    translation[3] += 0.1
    formats.save(clip.with_motion(rotation, translation), tmp_path / "b.bvh")
    again = formats.load(tmp_path / "b.bvh", up=up)
    assert rotations.angle(again.rotation, rotation).max() < 1e-4
    np.testing.assert_allclose(again.translation, translation, atol=1e-5)
    was, now = path.read_bytes(), (tmp_path / "b.bvh").read_bytes()
    assert re.sub(rb"[-\d.]+", b"0", was) == re.sub(rb"[-\d.]+", b"0", now)
    for frame in (0, 2, 4, 7):
        assert motion_lines(path)[frame] == motion_lines(tmp_path / "b.bvh")[frame]


def test_who_lies_may_be_read_back_standing_and_it_is_said(cmu_walk, tmp_path):
    """A few seconds of somebody who lies look like another axis up; told which it is, they are the same."""
    turn = rotations.about("X", np.array(np.pi / 2))
    rotation, translation = cmu_walk.rotation.copy(), rotations.rotate(turn, cmu_walk.translation)
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    lies = cmu_walk.with_motion(rotation, translation)
    for clip in (lies, replace(lies, source=None)):
        (said,) = formats.save(clip, tmp_path / "lies.bvh", force=True)
        assert "--up=y" in said
        back = formats.load(tmp_path / "lies.bvh", up="y")
        np.testing.assert_allclose(back.positions(), lies.positions(), atol=1e-4)
        assert not formats.save(back, tmp_path / "again.bvh", force=True), "it was given"
    assert not formats.save(cmu_walk, tmp_path / "walk.bvh")


@pytest.mark.parametrize(("leg", "said"), [(0.3, True), (0.6, False), (0.9, False), (1.5, True)])
def test_bodies_whose_unit_would_be_mistaken_are_told_of(cmu_walk, tmp_path, leg, said):
    """Legs of a small child in centimetres are those of a grown-up in inches."""
    body = cmu_walk.scaled(leg / find_mapping(cmu_walk.skeleton).leg_length)
    notes = formats.save(body, tmp_path / "body.bvh")
    assert ["--unit=cm" in note for note in notes] == [True] * said
    back = [formats.load(tmp_path / "body.bvh", unit=unit) for unit in ("cm", None)]
    off = [np.abs(some.positions() - body.positions()).max() for some in back]
    assert off[0] < 1e-4
    assert (off[1] > 0.1) == said


def test_bones_of_amc_end_where_they_did(data, tmp_path):
    clip = formats.load(data / "cmu_02_03.amc")
    formats.save(clip, tmp_path / "walk.bvh")
    nodes = {node.name: node for node in formats.load(tmp_path / "walk.bvh").source.header.nodes}
    bones = {bone.name: bone for bone in clip.source.asf.bones}
    ends = [name for name, node in nodes.items() if node.ends]
    assert {"head", "ltoes", "rtoes", "lthumb"} < {*ends}
    for name in ends:
        length = 100 * clip.source.unit * bones[name].length
        assert np.linalg.norm(nodes[name].ends[0]) == pytest.approx(length, abs=1e-4), name
    # They go on as their bones do: feet point ahead, and down a little.
    toe = np.array(nodes["ltoes"].ends[0])
    assert toe[2] > 0.9 * np.linalg.norm(toe)


@pytest.mark.parametrize("up", ["y", "z", "x", "-y", "-z", "-x"])
def test_it_is_said_as_the_reader_will_take_it_whatever_is_up(cmu_walk, tmp_path, up):
    """Somebody who leans half over, so that it is close: notes are there where files are read otherwise."""
    notes, wrong = [], []
    for degrees in range(30, 80, 5):
        turn = rotations.about("X", np.array(np.radians(degrees)))
        rotation, translation = cmu_walk.rotation.copy(), rotations.rotate(turn, cmu_walk.translation)
        rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
        leans = replace(cmu_walk.with_motion(rotation, translation), source=None)
        path = tmp_path / f"{degrees}.bvh"
        formats.save(leans, path)
        given = formats.load(path, up=up)
        estimated = replace(given, source=replace(given.source, up_how="estimated"))
        notes.append(bool(formats.save(estimated, tmp_path / f"{degrees}.again.bvh")))
        wrong.append(formats.load(tmp_path / f"{degrees}.again.bvh").source.up != up)
    assert notes == wrong
    assert any(wrong)


def test_curves_do_not_jump(tmp_path, make_bvh):
    """Angles written for a joint that turns on and on through gimbal lock and half turns stay continuous."""
    joints = [("Root", 0, (0, 0, 0), "xyzZXY"), ("Tip", 1, (0, 170, 0), "ZXY")]
    frames = 200
    values = np.zeros((frames, 9))
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    clip = formats.load(path)
    angles = np.stack([np.linspace(0, 12, frames), np.linspace(0, 9, frames), np.full(frames, 0.3)], axis=-1)
    rotation = clip.rotation.copy()
    rotation[1:, 1] = rotations.from_euler(angles, "ZXY")[1:]
    # quaternions say nothing about full turns or sign
    rotation[::2, 1] *= -1
    formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "b.bvh")
    written = np.array([line.split() for line in motion_lines(tmp_path / "b.bvh")], float)[:, 6:]
    assert np.abs(np.diff(written[1:], axis=0)).max() < 5
    again = formats.load(tmp_path / "b.bvh")
    assert rotations.angle(again.rotation, rotation).max() < 1e-4


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "YXZ", "XZY"])
@pytest.mark.parametrize("middle", [90.0, -90.0])
def test_gimbal_lock(tmp_path, make_bvh, order, middle):
    """In gimbal lock the written angles continue those before the change."""
    joints = [("Root", 0, (0, 0, 0), "xyzZXY"), ("Tip", 1, (0, 170, 0), order)]
    values = np.zeros((5, 9))
    values[:, 6:] = np.stack([np.linspace(30, 34, 5), np.full(5, middle), np.full(5, 50)], axis=-1)
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    clip = formats.load(path)
    rotation = clip.rotation.copy()
    rotation[2:, 1] *= -1
    formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "b.bvh")
    written = np.array([line.split() for line in motion_lines(tmp_path / "b.bvh")], float)
    np.testing.assert_allclose(written, values, atol=1e-3)


def test_style_of_numbers(tmp_path, make_bvh):
    """As many decimals as the file has, and zeros at the end only where it has them."""
    joints = [("Root", 0, (0, 0, 0), "xyzZXY"), ("Tip", 1, (0, 170, 0), "ZXY")]
    for text, expected in (("1.000000", b"50.123457"), ("1.23456 1 0.00012345678", b"50.12346")):
        path = tmp_path / f"{len(text)}.bvh"
        path.write_text(make_bvh(joints, [(text.split() * 9)[:9]] * 3))
        clip = formats.load(path)
        translation = clip.translation.copy()
        translation[1, 0, 0] = 0.501234567
        formats.save(clip.with_motion(clip.rotation, translation), tmp_path / "out.bvh", force=True)
        assert motion_lines(tmp_path / "out.bvh")[1].split()[0] == expected


def test_longer_shorter_slower(data, cmu_walk, tmp_path):
    """The header stays, with another number of frames or frame time; common frames keep their text."""
    original = motion_lines(data / "cmu_walk.bvh")
    head = (data / "cmu_walk.bvh").read_bytes().partition(b"MOTION")[0]
    short = replace(cmu_walk, rotation=cmu_walk.rotation[:50], translation=cmu_walk.translation[:50])
    formats.save(short, tmp_path / "short.bvh")
    assert motion_lines(tmp_path / "short.bvh") == original[:50]
    longer = replace(
        cmu_walk,
        rotation=np.concatenate([cmu_walk.rotation, cmu_walk.rotation[::-1]]),
        translation=np.concatenate([cmu_walk.translation, cmu_walk.translation[::-1]]),
        fps=60.0,
    )
    formats.save(longer, tmp_path / "long.bvh")
    text = (tmp_path / "long.bvh").read_bytes()
    assert text.startswith(head)
    assert b"Frames: 418\nFrame Time: 0.016666667\n" in text
    assert motion_lines(tmp_path / "long.bvh")[:209] == original
    again = formats.load(tmp_path / "long.bvh")
    assert (again.fps, len(again)) == (60, 418)
    assert rotations.angle(again.rotation, longer.rotation).max() < 1e-5


def test_cuts_and_joins_keep_their_text(data, cmu_walk, tmp_path):
    """Of frames of the same file in any order, whatever lies between them: angles beyond 180 degrees, say,
    would be lost if numbers were made anew."""
    original = motion_lines(data / "cmu_walk.bvh")
    formats.save(cmu_walk.slice(60, 90).slice(-10, 30), tmp_path / "cut.bvh")
    assert motion_lines(tmp_path / "cut.bvh") == original[80:90]
    formats.save(cmu_walk.take([208, 3, 3, 7, 8]), tmp_path / "picked.bvh")
    assert motion_lines(tmp_path / "picked.bvh") == [original[frame] for frame in (208, 3, 3, 7, 8)]
    moved = cmu_walk.slice(20, 30)
    moved = moved.with_motion(moved.rotation, moved.translation + 1.0)
    parts = [cmu_walk.slice(100, 140), moved, cmu_walk.slice(0, 30)]
    formats.save(cmu_walk.joined(parts), tmp_path / "joined.bvh")
    lines = motion_lines(tmp_path / "joined.bvh")
    assert lines[:40] + lines[50:] == original[100:140] + original[:30]
    turns = [line.split(b" ")[3:] for line in (*lines[40:50], *original[20:30])]
    assert turns[:10] == turns[10:]
    np.testing.assert_allclose(formats.load(tmp_path / "joined.bvh").root[40:50], moved.root, atol=1e-5)
    longer = cmu_walk.joined([cmu_walk, formats.load(data / "cmu_walk.bvh")]).slice(200, 215)
    formats.save(longer, tmp_path / "both.bvh")
    assert motion_lines(tmp_path / "both.bvh")[:9] == original[200:]
    np.testing.assert_allclose(formats.load(tmp_path / "both.bvh").positions(), longer.positions(), atol=1e-4)


def test_extending_a_file_without_a_last_line_end(tmp_path, make_bvh, body):
    values = np.round(np.random.default_rng(3).uniform(-9, 9, (3, 30)), 3)
    path = tmp_path / "a.bvh"
    path.write_bytes(make_bvh(body, values).rstrip().encode())
    clip = formats.load(path)
    formats.save(clip, tmp_path / "same.bvh")
    assert (tmp_path / "same.bvh").read_bytes() == path.read_bytes()
    longer = clip.with_motion(np.tile(clip.rotation, (2, 1, 1)), np.tile(clip.translation, (2, 1, 1)))
    formats.save(longer, tmp_path / "b.bvh")
    again = formats.load(tmp_path / "b.bvh")
    np.testing.assert_allclose(again.positions(), longer.positions(), atol=1e-5)


def test_few_channels_hold_what_they_can(tmp_path, make_bvh):
    """Hinges keep their hinge; what has no channel is lost and said."""
    joints = [("Root", 0, (0, 0, 0), "xyzZXY"), ("Knee", 1, (0, 40, 0), "X"), ("Wrist", 1, (0, 50, 0), "XY")]
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, np.zeros((6, 9))))
    clip = formats.load(path, unit=0.01)
    rotation = clip.rotation.copy()
    angles = np.radians([[100.0, 120.0], [170.0, -130.0], [190.0, 80.0]])
    rotation[1:4, 1] = rotations.about("X", angles[:, 0])
    rotation[1:4, 2] = rotations.from_euler(angles, "XY")
    assert formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "b.bvh") == ()
    again = formats.load(tmp_path / "b.bvh", unit=0.01)
    assert rotations.angle(again.rotation, rotation).max() < 1e-4
    rotation[4, 1] = rotations.about("Z", np.radians(20.0))
    (note,) = formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "c.bvh")
    assert "Knee: 20.0 degrees" in note


def test_new_file(cmu_walk, tmp_path):
    """A clip without a source gets a new header, and other joints in other order come back by name."""
    order = [0, 1, 6, 2, 7, *(j for j in range(31) if j not in (0, 1, 6, 2, 7))]
    skeleton = Skeleton(
        tuple(cmu_walk.skeleton.names[j] for j in order),
        tuple(-1 if j == 0 else order.index(cmu_walk.skeleton.parents[j]) for j in order),
        cmu_walk.skeleton.rest_translation[order],
    )
    translation = np.stack([cmu_walk.root, np.tile(skeleton.rest_translation[3], (209, 1))], axis=1)
    translation[:, 1, 0] += 0.1 * np.sin(np.arange(209))
    clip = Clip(skeleton, cmu_walk.rotation[:, order], translation, 24.0, (0, 3))
    formats.save(clip, tmp_path / "new.bvh")
    again = formats.load(tmp_path / "new.bvh")
    assert again.fps == 24
    assert again.source.unit == 0.01
    back = [again.skeleton.index(name) for name in skeleton.names]
    np.testing.assert_allclose(again.positions()[:, back], clip.positions(), atol=1e-5)
    assert sorted(again.skeleton.names[j] for j in again.translated) == sorted(
        skeleton.names[j] for j in clip.translated
    )


@pytest.mark.parametrize("spoilt", ["far", "flat", "huge", "half \ud800", "two  blanks", " one", "tab\tin"])
def test_what_could_not_be_read_again_is_not_written(cmu_walk, tmp_path, spoilt):
    skeleton, translation = cmu_walk.skeleton, cmu_walk.translation.copy()
    if spoilt == "far":
        translation[3] = 1e30
    elif spoilt not in ("flat", "huge"):
        skeleton = replace(skeleton, names=(*skeleton.names[:-1], spoilt))
    else:
        size = 1e30 if spoilt == "huge" else 0.0
        skeleton = replace(skeleton, rest_translation=size * skeleton.rest_translation)
    clips = [replace(cmu_walk, skeleton=skeleton, translation=translation, source=None)]
    clips += [replace(cmu_walk, translation=translation)] if spoilt == "far" else []
    for clip in clips:
        with pytest.raises(RequestError) as error:
            formats.save(clip, tmp_path / "a.bvh")
        assert len(str(error.value).splitlines()) == 3
        assert not list(tmp_path.iterdir())


def test_whole_or_not_at_all(cmu_walk, tmp_path, monkeypatch):
    path = tmp_path / "b.bvh"
    formats.save(cmu_walk, path)
    before = path.read_bytes()
    with pytest.raises(RequestError, match="--force"):
        formats.save(cmu_walk, path)
    for wrong in (tmp_path / "no" / "b.bvh", tmp_path / "b.fbx", tmp_path):
        with pytest.raises(RequestError):
            formats.save(cmu_walk, wrong, force=True)
    assert not (tmp_path / "no").exists()

    def fails(clip, stream):
        stream.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(formats.FORMATS, ".bvh", formats.FORMATS[".bvh"]._replace(write=fails))
    with pytest.raises(FileError, match="No space"):
        formats.save(cmu_walk, path, force=True)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["b.bvh"]


def test_over_its_own_source(data, tmp_path):
    path = tmp_path / "a.bvh"
    path.write_bytes((data / "cmu_walk.bvh").read_bytes())
    formats.save(formats.load(path), path, force=True)
    assert path.read_bytes() == (data / "cmu_walk.bvh").read_bytes()
