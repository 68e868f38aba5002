"""What a BVH file means: numbers, units, axes, channels."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.formats.bvh import BvhSource
from interpose.geometry import rotations


def numbers(rng, frames, columns, size=60):
    return np.round(rng.uniform(-size, size, (frames, columns)), 4)


@pytest.mark.parametrize("order", ["".join(p) for p in itertools.permutations("XYZ")])
def test_rotation_orders(tmp_path, make_bvh, order):
    """Every Tait-Bryan order means the product of its turns from left to right; positions may stand last."""
    joints = [("Root", 0, (0, 0, 0), order + "yzx"), ("Tip", 1, (0, 10, 0), order[::-1])]
    values = numbers(np.random.default_rng(1), 5, 9, 170)
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    clip = formats.load(path, unit=0.5, up="y")
    expected = rotations.from_euler(np.radians(values[:, :3]), order)
    np.testing.assert_allclose(clip.rotation[:, 0], expected, atol=1e-14)
    expected = rotations.from_euler(np.radians(values[:, 6:]), order[::-1])
    np.testing.assert_allclose(clip.rotation[:, 1], expected, atol=1e-14)
    np.testing.assert_allclose(clip.translation[:, 0], 0.5 * values[:, [5, 3, 4]], atol=1e-14)


@pytest.mark.parametrize("channels", ["", "Y", "XZ", "xyz", "zY", "xyzZXY"])
def test_any_number_of_channels(tmp_path, make_bvh, channels):
    joints = [("Root", 0, (1, 2, 3), channels), ("Tip", 1, (0, 10, 0), "ZXY")]
    values = numbers(np.random.default_rng(2), 4, len(channels) + 3)
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    clip = formats.load(path, unit=1, up="y")
    order = [c for c in channels if c.isupper()]
    expected = rotations.identity(4)
    for axis in order:
        turn = rotations.about(axis, np.radians(values[:, channels.index(axis)]))
        expected = rotations.multiply(expected, turn)
    np.testing.assert_allclose(clip.rotation[:, 0], expected, atol=1e-14)
    for i, axis in enumerate("xyz"):  # an axis without a channel stays at the OFFSET
        column = values[:, channels.index(axis)] if axis in channels else np.full(4, i + 1.0)
        np.testing.assert_allclose(clip.translation[:, 0, i], column)


def test_layout_does_not_matter(tmp_path, make_bvh, body):
    """Tabs, Windows line ends, exponents, frames wrapped over lines or on one line: the same clip."""
    values = numbers(np.random.default_rng(3), 6, 30, 40)
    plain = make_bvh(body, values)
    head, _, _ = plain.partition("0.0333333\n")
    words = [f"{v:.6e}" for v in values.ravel()]
    wrapped = "\n".join(" ".join(words[i : i + 7]) for i in range(0, len(words), 7))
    variants = {
        "plain": plain,
        "windows": make_bvh(body, values, end="\r\n"),
        "mac": make_bvh(body, values, end="\r"),
        "tabs": make_bvh(body, values, blank="\t"),
        "spaces": make_bvh(body, values, blank="   ", end=" \n\n"),
        "wrapped": head + "0.0333333\n" + wrapped,
        "one line": head + "0.0333333\n" + " ".join(words),
        "marked": "\ufeff" + plain.lower().replace("offset", "Offset"),
    }
    clips = {}
    for name, text in variants.items():
        path = tmp_path / f"{name}.bvh"
        path.write_bytes(text.encode())
        clips[name] = formats.load(path)
    for name, clip in clips.items():
        np.testing.assert_array_equal(clip.rotation, clips["plain"].rotation, err_msg=name)
        np.testing.assert_array_equal(clip.translation, clips["plain"].translation, err_msg=name)


@pytest.mark.parametrize(
    ("text", "fps"),
    [
        *(("0.0333333", 30), ("0.033333", 30), (".0083333", 120), ("0.0416667", 24), ("0.04", 25)),
        *(
            ("0.016667", 60),
            ("1.6666667e-2", 60),
            ("0.0333667", 30000 / 1001),
            ("0.0123", 1 / 0.0123),
            ("2", 0.5),
            *(("0.0167", 60), ("0.0417", 24), ("0.0334", 30000 / 1001), ("0.016683", 60000 / 1001)),
        ),
    ],
)
def test_frame_time(tmp_path, make_bvh, body, text, fps):
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(body, np.zeros((2, 30)), time=text))
    assert formats.load(path).fps == fps


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(0.01, 1), (1, 0.01), (10, 0.001), (1 / 2.54, 0.0254), (0.01 * 0.45 / 0.0254, 0.0254 / 0.45)],
)
def test_unit_from_the_legs(tmp_path, make_bvh, body, factor, unit):
    scaled = [(n, d, np.multiply(o, factor).tolist(), c) for n, d, o, c in body]
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(scaled, np.zeros((2, 30))))
    clip = formats.load(path)
    assert clip.source.unit == unit
    assert "estimated" in clip.source.unit_how
    leg = np.linalg.norm(clip.skeleton.rest_translation[[2, 3]], axis=1).sum()
    np.testing.assert_allclose(leg, 0.87)


def test_unit_given_or_unknowable(tmp_path, make_bvh, body):
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(body, np.zeros((2, 30))))
    for unit, size in (("m", 1), ("MM", 0.001), ("inch", 0.0254), (0.02, 0.02), ("0.5", 0.5)):
        clip = formats.load(path, unit=unit)
        assert (clip.source.unit, clip.source.unit_how) == (size, "given")
    for wrong in ("parsec", 0, -1, float("nan")):
        with pytest.raises(RequestError):
            formats.load(path, unit=wrong)
    with pytest.raises(RequestError):
        formats.load(path, up="w")
    path.write_text(make_bvh([("a", 0, (0, 0, 0), "xyzZXY"), ("b", 1, (0, 170, 0), "ZXY")], np.zeros((2, 9))))
    assert formats.load(path).source.unit == 0.01  # something as long as a body
    path.write_text(make_bvh([("a", 0, (0, 0, 0), "xyzZXY"), ("b", 1, (0, 1e5, 0), "ZXY")], np.zeros((2, 9))))
    assert formats.load(path).source.unit_how.startswith("assumed")


def test_z_up(tmp_path, make_bvh, body):
    """A file with Z up is turned as a whole: the same joints stand at the same places, turned."""
    lying = [(n, d, (o[0], -o[2], o[1]), c) for n, d, o, c in body]
    values = numbers(np.random.default_rng(4), 5, 30, 25)
    values[:, :3] *= 0.1  # bodies do not fly about
    path = tmp_path / "z.bvh"
    path.write_text(make_bvh(lying, values))
    clip = formats.load(path)
    assert clip.source.up == "z"
    assert "estimated" in clip.source.up_how
    untouched = formats.load(path, up="y").positions()
    expected = np.stack([untouched[..., 0], untouched[..., 2], -untouched[..., 1]], axis=-1)
    np.testing.assert_allclose(clip.positions(), expected, atol=1e-12)
    head, foot = clip.skeleton.index("Head"), clip.skeleton.index("LeftFoot")
    assert (clip.positions()[:, head, 1] > clip.positions()[:, foot, 1] + 0.8).all()
    assert clip.skeleton.rest_translation[head, 1] == pytest.approx(0.4)


@pytest.mark.parametrize("rooted", [False, True])
@pytest.mark.parametrize("axis", ["y", "z"])
def test_who_crawls_is_on_the_floor(tmp_path, cmu_walk, axis, rooted):
    """The head is ahead of the feet, not above them, all the time: the floor tells what is up. A root that
    stays at the origin tells nothing."""
    down = rotations.about("X", np.array(np.radians(85.0)))
    facing = rotations.twist_about(cmu_walk.rotation[:, 0], np.array([0.0, 1.0, 0.0]))
    upright = rotations.multiply(rotations.conjugate(facing), cmu_walk.rotation[:, 0])
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[:, 0] = rotations.multiply(facing, rotations.multiply(down, upright))
    lying = replace(cmu_walk, rotation=rotation, source=None)
    translation[:, 0, 1] -= lying.positions()[..., 1].min(axis=1)
    translation[:, 0] += [3.0, 0.0, -3.0]
    lying = replace(lying, rotation=rotation.copy(), translation=translation)
    path, written = tmp_path / "crawl.bvh", lying
    if axis == "z":
        turn = rotations.about("X", np.array(np.pi / 2))
        rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
        written = replace(lying, rotation=rotation, translation=rotations.rotate(turn, translation))
    formats.save(below_a_root(written) if rooted else written, path)
    clip = formats.load(path)
    assert clip.source.up == axis
    np.testing.assert_allclose(clip.positions()[:, int(rooted) :], lying.positions(), atol=1e-4)


def below_a_root(clip):
    """The clip with one joint more, at the origin, from which its root hangs."""
    old = clip.skeleton
    bones = np.append(np.zeros((1, 3)), old.rest_translation, axis=0)
    skeleton = Skeleton(("Reference", *old.names), (-1, *(parent + 1 for parent in old.parents)), bones)
    turned = np.append(rotations.identity(len(clip), 1), clip.rotation, axis=1)
    moved = np.append(np.zeros((len(clip), 1, 3)), clip.translation, axis=1)
    return Clip(skeleton, turned, moved, clip.fps, (0, 1))


@pytest.mark.parametrize(
    ("up", "file"),
    [("x", [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), ("-y", [[1, 0, 0], [0, -1, 0], [0, 0, -1]])],
)
def test_other_axes_up(tmp_path, make_bvh, body, up, file):
    """A body that stands along X, or on its head: read upright, whole and unharmed."""
    turn = np.array(file, float)  # from the clip's axes to the file's
    lying = [(n, d, tuple(turn @ np.array(o)), c) for n, d, o, c in body]
    path, values = tmp_path / "body.bvh", numbers(np.random.default_rng(4), 5, 30, 25)
    values[:, :3] *= 0.1
    path.write_text(make_bvh(lying, values))
    clip = formats.load(path)
    assert clip.source.up == up
    head, foot = clip.skeleton.index("Head"), clip.skeleton.index("LeftFoot")
    assert (clip.positions()[:, head, 1] > clip.positions()[:, foot, 1] + 0.8).all()
    untouched = formats.load(path, up="y").positions()
    np.testing.assert_allclose(clip.positions(), untouched @ turn, atol=1e-9)
    formats.save(clip, tmp_path / "again.bvh")
    assert (tmp_path / "again.bvh").read_bytes() == path.read_bytes()


def six(body, rng, replaces, frames=20):
    """The body with six channels a joint; position channels near the OFFSET or near zero."""
    joints = [(n, d, o, "xyzZXY") for n, d, o, c in body]
    values = np.round(rng.uniform(-20, 20, (frames, 6 * len(body))), 4)
    for j, (_, _, offset, _) in enumerate(body):
        base = np.array(offset) if replaces or j == 0 else np.zeros(3)
        values[:, 6 * j : 6 * j + 3] = np.round(base + 0.01 * rng.standard_normal((frames, 3)), 6)
    return joints, values


@pytest.mark.parametrize("replaces", [True, False])
def test_position_channels(tmp_path, make_bvh, body, replaces):
    """Channels near the OFFSET replace it, channels near zero add to it: bones have one length either way."""
    joints, values = six(body, np.random.default_rng(5), replaces)
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    clip = formats.load(path)
    assert clip.source.positions == ("replace" if replaces else "add")
    assert clip.translated == tuple(range(len(body)))
    bones = np.linalg.norm(clip.translation[:, 1:], axis=-1)
    rest = np.linalg.norm(clip.skeleton.rest_translation[1:], axis=-1)
    np.testing.assert_allclose(bones, np.broadcast_to(rest, bones.shape), atol=1e-3)
    np.testing.assert_allclose(clip.root[:, 1], 0.9, atol=1e-3)  # the root's channels replace its OFFSET
    forced = formats.load(path, joint_positions="add" if replaces else "replace")
    assert forced.source.positions_how == "given"
    assert not np.allclose(forced.translation[:, 2], clip.translation[:, 2], atol=0.1)


@pytest.mark.parametrize("low", [0.15, 0.5, 1.0])
def test_hips_below_a_root_are_where_their_channels_say_however_low(tmp_path, make_bvh, body, low):
    """Of who crawls or lies they are far from their OFFSET; what is added to it is at zero or below."""
    (hips, _, offset, _), *others = body
    joints = [("Root", 0, (0, 0, 0), "xyzZXY"), (hips, 1, offset, "xyzZXY")]
    joints += [(name, depth + 1, where, "ZXY") for name, depth, where, _ in others]
    time, values = np.linspace(0, 1, 60)[:, None], np.zeros((60, 12 + 3 * len(others)))
    way = np.concatenate([2 * time, 0.03 * np.sin(9 * time), -3 * time], axis=1) + low * np.array(offset)
    for meaning, written in (("replace", way), ("add", way - offset)):
        values[:, 6:9] = written
        (tmp_path / "a.bvh").write_text(make_bvh(joints, values))
        clip = formats.load(tmp_path / "a.bvh", unit=1.0, up="y")
        assert clip.source.positions == meaning
        np.testing.assert_allclose(clip.translation[:, 1], way, atol=1e-4)


def test_add_by_the_letter_moves_roots_too(tmp_path, make_bvh, body):
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(body, np.zeros((2, 30))))
    np.testing.assert_allclose(formats.load(path).root, 0)
    np.testing.assert_allclose(formats.load(path, joint_positions="add").root, [[0, 0.9, 0]] * 2)


def test_bones_that_only_channels_give(tmp_path, make_bvh):
    joints = [("a", 0, (0, 0, 0), "xyzZXY"), ("b", 1, (0, 0, 0), "xyzZXY")]
    values = np.zeros((3, 12))
    values[:, 7] = 150
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    clip = formats.load(path)
    np.testing.assert_allclose(clip.skeleton.rest_translation[1], [0, 1.5, 0])


def test_several_roots_and_equal_names(tmp_path, make_bvh):
    joints = [
        ("Body", 0, (0, 0, 0), "xyzZXY"),
        ("Hand", 1, (0, 100, 0), "ZXY"),
        ("Hand", 1, (0, 90, 0), "ZXY"),
        ("Prop Box", 0, (5, 0, 0), "XYZ"),
        ("Hand", 1, (0, 70, 0), ""),
    ]
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, numbers(np.random.default_rng(6), 3, 15)))
    clip = formats.load(path, unit=0.01)
    assert clip.skeleton.names == ("Body", "Hand", "Hand#2", "Prop Box", "Hand#3")
    assert clip.skeleton.roots == (0, 3) == clip.translated
    np.testing.assert_allclose(clip.translation[:, 1], [[0.05, 0, 0]] * 3)
    assert formats.save(clip, tmp_path / "b.bvh") == ()
    assert (tmp_path / "b.bvh").read_bytes() == path.read_bytes()


def test_describe(cmu_walk):
    source = cmu_walk.source
    assert isinstance(source, BvhSource)
    assert len(cmu_walk) == 209
    assert cmu_walk.fps == 30
    unit, up = source.describe()
    assert "0.0564444 m (CMU), estimated from a leg of 0.8" in unit
    assert up.startswith("up: Y, estimated")


def test_against_pymotion(data, tmp_path, make_bvh, body):
    """Another library sees the same rotations and positions."""
    bvh = pytest.importorskip("pymotion.io.bvh")
    fk = pytest.importorskip("pymotion.ops.skeleton").fk
    joints, values = six(body, np.random.default_rng(7), True)
    (tmp_path / "six.bvh").write_text(make_bvh(joints, values))
    for path in (data / "cmu_walk.bvh", tmp_path / "six.bvh"):
        clip = formats.load(path)
        other = bvh.BVH()
        other.load(str(path))
        rots, pos, parents, offsets, _, _ = other.get_data()
        agreement = np.abs((rots * clip.rotation).sum(axis=-1))
        np.testing.assert_allclose(agreement, 1.0, atol=1e-12)
        np.testing.assert_allclose(clip.local_translation(), pos * clip.source.unit, atol=1e-12)
        theirs, _ = fk(rots, pos[:, 0], offsets, parents)
        if path.stem == "cmu_walk":
            np.testing.assert_allclose(clip.positions(), theirs * clip.source.unit, atol=1e-6)


@pytest.mark.parametrize("replaces", [True, False])
@pytest.mark.parametrize("low", [False, True])
@pytest.mark.parametrize("there", [-230.0, -60.0, 10.0, 190.0])
@pytest.mark.parametrize("turned", [False, True])
def test_hips_whose_offset_is_a_place_far_away_are_as_high_as_they_are(
    tmp_path, make_bvh, replaces, low, there, turned
):
    """On the other side of the origin: their height tells, and not that they are nowhere near."""
    hips = [("Root", 0, (0.0, 0.0, 0.0), "xyzZXY"), ("Hips", 1, (209.3, 92.7, -309.3), "xyzZXY")]
    if turned:  # Z up
        hips[1] = ("Hips", 1, (209.3, 309.3, 92.7), "xyzZXY")
    joints = [*hips, ("Spine", 2, (0.0, 0.0, 20.0) if turned else (0.0, 20.0, 0.0), "ZXY")]
    rng = np.random.default_rng(0)
    values = np.zeros((60, 15))
    # It walks towards the other side of the floor, so that each axis of it is the steadier one for a while.
    way = np.linspace(0, 40 if replaces else 30, 60)
    heights = 25.0 if low else 80.0
    place = np.stack([there - 0.1 * way, heights + rng.normal(0, 9, 60), 300.0 + 0.2 * way], axis=1)
    if not replaces:
        place[:, 1] = place[:1, 1] + 0.2 * (place[:, 1] - place[:1, 1])
    if turned:
        place = place[:, [0, 2, 1]]
    values[:, 6:9] = place if replaces else place - place[0]
    path = tmp_path / "a.bvh"
    path.write_text(make_bvh(joints, values))
    assert formats.load(path).source.positions == ("replace" if replaces else "add")
