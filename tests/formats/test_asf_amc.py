"""ASF/AMC: what the numbers mean, finding the skeleton, writing, and damaged files."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from interpose import formats
from interpose.cli import main
from interpose.errors import FileError, RequestError
from interpose.geometry import rotations
from interpose.skeletons import find_mapping

# The joints of CMU's BVH files and the bones of its skeletons that they stand for.
SAME = {
    "Hips": "root",
    "LowerBack": "lowerback",
    "Spine": "upperback",
    "Spine1": "thorax",
    "Neck": "lowerneck",
    "Neck1": "upperneck",
    "Head": "head",
    "LHipJoint": "lhipjoint",
    "LeftUpLeg": "lfemur",
    "LeftLeg": "ltibia",
    "LeftFoot": "lfoot",
    "LeftToeBase": "ltoes",
    "LeftShoulder": "lclavicle",
    "LeftArm": "lhumerus",
    "LeftForeArm": "lradius",
    "LeftHand": "lwrist",
    "LeftFingerBase": "lhand",
    "LeftHandIndex1": "lfingers",
    "LThumb": "lthumb",
}
SAME |= {
    re.sub("^Left", "Right", re.sub("^L(Hip|Thumb)", r"R\1", joint)): "r" + bone[1:]
    for joint, bone in SAME.items()
    if joint.startswith(("Left", "LHip", "LThumb"))
}

# A body in Vicon's form as HDM05 has it: Windows line ends, a comment with a path that is not UTF-8.
BODY_ASF = """\
# AST/ASF file generated using VICON BodyLanguage
:version 1.10
:name VICON
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   written by a test
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lfemur
     direction 0.34202 -0.939693 0
     length 7.2
     axis 0 0 20  XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name ltibia
     direction 0.34202 -0.939693 0
     length 7.9
     axis 0 0 20  XYZ
    dof rx
    limits (-10.0 170.0)
  end
  begin
     id 3
     name lfoot
     direction 0.1 -0.4 0.9
     length 2.7
     axis -90 7.62852e-016 20  XYZ
    dof rx rz
    limits (-45.0 90.0)
           (-70.0 inf)
  end
  begin
     id 4
     name head
     direction 0 1 0
     length 0
  end
:hierarchy
  begin
    root lfemur head
    lfemur ltibia
    ltibia lfoot
  end
"""
BODY_AMC = """\
#!OML:ASF X:\\fM-rBonn\\Tido.ASF
:FULLY-SPECIFIED
:DEGREES
1
root 11.352 18.1848 -1.04479 -25.885 84.6616 -378.765
lfemur -4.54612 0.838574 26.6141
ltibia 22.8796
lfoot -11.9533 -6.18738
2
root 11.4587 18.1807 -1.04182 -25.6768 84.7323 -378.591
lfemur -4.3 0.9 26.5
ltibia 23.1
lfoot -11.8 1.6201e-014
3
root 11.5 18.2 -1.04 -25.4 84.8 -378.4
lfemur -4.1 0.95 26.4
ltibia 23.4
lfoot -11.7 -6.1
"""


@pytest.fixture
def body(tmp_path):
    """A skeleton and a motion, as bytes; and the files written from them."""
    (tmp_path / "HDM_xy.asf").write_bytes(windows(BODY_ASF))
    path = tmp_path / "HDM_xy_walk_001_120.amc"
    path.write_bytes(windows(BODY_AMC))
    return path


def windows(text: str) -> bytes:
    return text.replace("\n", "\r\n").encode().replace(b"fM-r", b"f\xfcr ")


def write(folder, asf: str, amc: str):
    (folder / "a.asf").write_text(asf)
    (folder / "a.amc").write_text(amc)
    return folder / "a.amc"


def about(axis, degrees):
    return rotations.about(axis, np.radians(degrees))


def numbers(path):
    """Per frame and bone the texts of the numbers."""
    frames: list[dict[bytes, list[bytes]]] = []
    for line in path.read_bytes().splitlines():
        words = line.split()
        if len(words) == 1 and words[0].isdigit():
            frames.append({})
        elif frames:
            frames[-1][words[0]] = words[1:]
    return frames


# What the numbers mean -----------------------------------------------------------------------------------


def test_the_same_trial_as_bvh(data):
    """Joint positions are those of the BVH form of the trial, but for bones that this conversion lacks.

    It has no room for the three bones whose end has several children of its own (thorax, both wrists): their
    children start where they do. With these three of length zero, all 31 joints agree.
    """
    bvh = formats.load(data / "cmu_02_03.bvh")
    amc = formats.load(data / "cmu_02_03.amc")
    order = [amc.skeleton.index(SAME[name]) for name in bvh.skeleton.names]
    assert sorted(order) == list(range(31))
    assert (len(amc), amc.fps) == (40, 120)
    assert amc.source.unit == pytest.approx(bvh.source.unit, rel=1e-9)
    assert "CMU" in amc.source.describe()[1]

    expected, found = bvh.positions(), amc.positions()[:, order]
    off = np.linalg.norm(expected - found, axis=-1).max(axis=0)
    lower = [j for j, name in enumerate(bvh.skeleton.names) if re.search("Hip|Leg|Foot|Toe|Back|Spine", name)]
    assert len(lower) == 14
    assert off[lower].max() < 2e-5  # metres

    rest = amc.skeleton.rest_translation.copy()
    for joint, parent in enumerate(amc.skeleton.parents):
        if amc.skeleton.names[parent] in ("thorax", "lwrist", "rwrist"):
            rest[joint] = 0.0
    same = replace(amc, skeleton=replace(amc.skeleton, rest_translation=rest))
    np.testing.assert_allclose(same.positions()[:, order], expected, atol=2e-5)


def test_every_canonical_joint_is_found(data):
    mapping = find_mapping(formats.load(data / "cmu_02_03.amc").skeleton)
    assert mapping.missing == ()
    assert 0.8 < mapping.leg_length < 0.9


def test_axes_orders_and_units(tmp_path):
    """Angles in radians, another order of axis and degrees of freedom, a preset root: against matrices."""
    asf = """
:units
 length 1 # times an inch
 angle rad
:root
 order rz rx ty ry tx tz
 axis yzx
 position 1 2 3
 orientation 0.3 -0.2 0.9
:bonedata
begin
 name upper
 direction 0 2 0
 length 30
 axis 0.4 0.5 -0.6 zxy
 dof ry tz rx l tx
end
begin
 name lower
 direction 1 0 0
 length 5
 dof tz
end
begin
 name tip
 direction 1 0 0
 length 5
end
:hierarchy
begin
 root upper
 upper lower tip
end
"""
    amc = ":RADIANS\n1\nroot .1 .2 7 .3 8 9\nupper 0.7 0.25 -0.8 1.5 0.5\nlower 0.125\n"
    clip = formats.load(write(tmp_path, asf, amc), unit=0.01)
    assert clip.skeleton.names == ("root", "upper", "lower", "tip")

    # "first about the fixed z, then x, then y" is what SciPy writes in small letters
    preset = Rotation.from_euler("yzx", [0.3, -0.2, 0.9])
    root = preset * Rotation.from_euler("zxy", [0.1, 0.2, 0.3])
    axes = Rotation.from_euler("zxy", [0.4, 0.5, -0.6])
    upper = root * axes * Rotation.from_euler("yx", [0.7, -0.8]) * axes.inv()
    at_root = np.array([1, 2, 3]) + preset.apply([8, 7, 9])
    at_upper = at_root + root.apply(axes.apply([0.5, 0, 0.25]))
    at_tip = at_upper + upper.apply([0, 31.5, 0])
    at_lower = at_tip + upper.apply([0, 0, 0.125])
    expected = 0.01 * np.array([at_root, at_upper, at_lower, at_tip])
    np.testing.assert_allclose(clip.positions()[0], expected, atol=1e-9)
    turned = clip.kinematics()[0][0, 1]
    assert rotations.angle(turned, np.roll(upper.as_quat(), 1)) < 1e-7

    # and back: everything that these degrees of freedom can do is written
    other = amc.replace(".25 -0.8 1.5 0.5", ".35 -0.9 1.75 0.25").replace("0.125", "0.5")
    moved = formats.load(write(tmp_path, asf, other.replace("root .1 .2 7", "root .2 .1 6")), unit=0.01)
    assert formats.save(clip.with_motion(moved.rotation, moved.translation), tmp_path / "b.amc") == ()
    again = formats.load(tmp_path / "b.amc", unit=0.01, skeleton=tmp_path / "a.asf")
    np.testing.assert_allclose(again.positions(), moved.positions(), atol=1e-6)


def test_degrees_unless_said_otherwise(tmp_path, body):
    """The skeleton's unit of angles is for the skeleton; the motion says its own, if it does."""
    turned = formats.load(body).rotation
    bare = body.with_name("HDM_xy_bare.amc")
    bare.write_bytes(windows(BODY_AMC.replace(":DEGREES\n", "")))
    np.testing.assert_array_equal(formats.load(bare).rotation, turned)
    bare.write_bytes(windows(BODY_AMC.replace(":DEGREES\n", ":RADIANS\n")))
    assert rotations.angle(formats.load(bare).rotation[:, 1], turned[:, 1]).min() > 0.1


def test_unit_up_and_rate(body):
    clip = formats.load(body)
    assert clip.source.unit == pytest.approx(0.0254 / 0.45)
    assert clip.fps == 120
    assert "assumed" in clip.source.describe()[3]
    np.testing.assert_allclose(clip.root[0], np.array([11.352, 18.1848, -1.04479]) * 0.0254 / 0.45)
    assert formats.load(body, fps=60).fps == 60
    upright = formats.load(body, up="z", unit="cm")
    np.testing.assert_allclose(upright.root[0], np.array([0.11352, -0.0104479, -0.181848]))
    turn = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0, 0])
    np.testing.assert_allclose(
        upright.positions() * (0.0254 / 0.45) / 0.01, rotations.rotate(turn, clip.positions()), atol=1e-12
    )
    said = body.with_name("HDM_xy_rate.amc")
    said.write_bytes(windows(BODY_AMC.replace(":DEGREES", ":DEGREES\n:SAMPLES-PER-SECOND 50")))
    assert formats.load(said).fps == 50


def test_a_body_in_centimetres(data, tmp_path):
    """A length unit that gives no plausible legs as inches: the legs decide."""
    text = (data / "cmu_02.asf").read_text().replace("length 0.45", "length 1.0")
    scaled = re.sub(r"^(\s+length )(\d\S*)", lambda m: f"{m[1]}{float(m[2]) * 5.6444:.6f}", text, flags=re.M)
    (tmp_path / "a.asf").write_text(scaled.replace("length 5.644400", "length 1.0", 1))
    shutil.copy(data / "cmu_02_03.amc", tmp_path / "a.amc")
    clip = formats.load(tmp_path / "a.amc")
    assert clip.source.unit == 0.01
    assert "leg of 0.84 m" in clip.source.describe()[1]


# Finding the skeleton ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("motion", "beside", "found"),
    [
        ("walk.amc", ["run.asf", "walk.asf"], "walk.asf"),
        ("Walk.AMC", ["run.asf", "walk.ASF"], "walk.ASF"),
        ("02_01.amc", ["01.asf", "02.asf", "0.asf"], "02.asf"),
        ("02_01.filled.amc", ["02.asf", "02_01.asf", "02_0.asf"], "02_01.asf"),
        ("HDM_bd_run_001_120.amc", ["HDM_bk.asf", "HDM_bd.asf", "HDM.asf"], "HDM_bd.asf"),
        ("walk.amc", ["other.asf"], "other.asf"),
        ("walk2.amc", ["walk.asf", "run.asf"], None),
        ("walk.amc", [], None),
    ],
)
def test_the_skeleton_beside_it(tmp_path, motion, beside, found):
    for name in beside:
        (tmp_path / name).write_text(BODY_ASF)
    (tmp_path / motion).write_text(BODY_AMC)
    if found:
        assert formats.load(tmp_path / motion).source.asf.path.name == found
        return
    with pytest.raises(FileError, match="--skeleton") as caught:
        formats.load(tmp_path / motion)
    assert all(name in caught.value.why for name in beside)


def test_a_skeleton_by_name(tmp_path, body):
    (tmp_path / "folder").mkdir()
    moved = shutil.move(body, tmp_path / "folder" / "x.amc")
    clip = formats.load(moved, skeleton=tmp_path / "HDM_xy.asf")
    assert "given" in clip.source.describe()[0]
    with pytest.raises(FileError, match="no such file"):
        formats.load(moved, skeleton=tmp_path / "HDM_xz.asf")
    with pytest.raises(RequestError, match="skeleton does not apply"):
        formats.load(tmp_path / "HDM_xy.bvh", skeleton=tmp_path / "HDM_xy.asf")
    with pytest.raises(RequestError, match="frame rate"):
        formats.load(moved, skeleton=tmp_path / "HDM_xy.asf", fps=0)
    with pytest.raises(RequestError, match="frame rate"):
        formats.load(moved, skeleton=tmp_path / "HDM_xy.asf", fps="120")  # type: ignore[arg-type]
    with pytest.raises(RequestError, match="skeleton"):
        formats.load(moved, skeleton=3)  # type: ignore[arg-type]


# Writing -------------------------------------------------------------------------------------------------


def test_unchanged_is_byte_identical(data, body, tmp_path):
    for path in (data / "cmu_02_03.amc", body):
        clip = formats.load(path)
        copied = clip.with_motion(clip.rotation.copy(), clip.translation.copy())
        assert formats.save(copied, tmp_path / "out.amc", force=True) == ()
        assert (tmp_path / "out.amc").read_bytes() == path.read_bytes()


def test_only_changed_numbers_change(data, tmp_path):
    """A thigh turned in some frames and the root moved in another; curves go on where they were."""
    path = data / "cmu_02_03.amc"
    clip = formats.load(path)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    thigh = clip.skeleton.index("lfemur")
    turn = rotations.exp(np.array([0.2, -0.1, 0.3]))
    rotation[10:15, thigh] = -rotations.multiply(turn, rotation[10:15, thigh])
    translation[20, 0, 1] += 0.01
    formats.save(clip.with_motion(rotation, translation), tmp_path / "b.amc")
    for frame, (was, now) in enumerate(zip(numbers(path), numbers(tmp_path / "b.amc"), strict=True)):
        differs = {(bone, i) for bone in was for i, text in enumerate(was[bone]) if now[bone][i] != text}
        if 10 <= frame < 15:
            assert differs == {(b"lfemur", 0), (b"lfemur", 1), (b"lfemur", 2)}
            assert np.abs(np.array(was[b"lfemur"], float) - np.array(now[b"lfemur"], float)).max() < 30
        else:
            assert differs == ({(b"root", 1)} if frame == 20 else set())
    again = formats.load(tmp_path / "b.amc", skeleton=data / "cmu_02.asf")
    assert rotations.angle(again.rotation, rotation).max() < 1e-5
    np.testing.assert_allclose(again.translation, translation, atol=1e-6)


def test_what_a_joint_cannot_do_is_passed_on_and_said(body, tmp_path):
    """A knee has one axis: what is beyond it is lost, as little as possible; the foot keeps its direction."""
    clip = formats.load(body)
    rotation = clip.rotation.copy()
    knee, foot = clip.skeleton.index("ltibia"), clip.skeleton.index("lfoot")
    bent = rotations.multiply(
        about("Z", 20.0),
        rotations.multiply(about("X", 50.0), about("Z", -20.0)),
    )
    rotation[1, knee] = bent  # about the knee's own axis, which stands 20 degrees off
    assert formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "a.amc") == ()
    assert numbers(tmp_path / "a.amc")[1][b"ltibia"] == [b"50"]

    aside = rotations.multiply(bent, rotations.exp(np.radians(10.0) * np.array([0.34202, -0.939693, 0])))
    rotation[1, knee] = aside
    (note,) = formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "b.amc")
    assert "ltibia: 10.0 degrees" in note
    assert numbers(tmp_path / "b.amc")[1][b"ltibia"] == [b"50"]
    assert numbers(tmp_path / "b.amc")[1][b"lfoot"] == numbers(body)[1][b"lfoot"]  # it did not change

    rotation[1, foot] = rotations.multiply(rotation[1, foot], rotations.exp(np.array([0.1, 0, 0])))
    changed = clip.with_motion(rotation, clip.translation)
    formats.save(changed, tmp_path / "c.amc")
    again = formats.load(tmp_path / "c.amc", skeleton=body.with_name("HDM_xy.asf"))
    off = np.degrees(rotations.angle(again.kinematics()[0][1], changed.kinematics()[0][1]))
    assert off[knee] == pytest.approx(10.0, abs=0.01)
    assert off[foot] < 8.0

    still = clip.skeleton.index("head")
    rotation[2, still] = rotations.exp(np.array([0, 0.5, 0]))
    (note,) = formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "d.amc")
    assert "head: 28.6 degrees" in note


@pytest.mark.parametrize("up", ["y", "z", "-x"])
def test_axes_of_joints_that_have_few(data, up):
    """What is turned about them can be written, what is turned about another cannot."""
    clip = formats.load(data / "cmu_02_03.amc", up=up)
    axes = formats.axes(clip, clip.source)
    assert {clip.skeleton.names[joint]: about.shape[-1] for joint, about in axes.items()} == {
        bone.name: count for bone in clip.source.asf.bones if (count := len(bone.dof)) < 3
    }

    def lost(joint: int, axis: np.ndarray) -> float:
        rotation = clip.rotation.copy()
        rotation[:, joint] = rotations.multiply(rotations.exp(1e-3 * axis), rotation[:, joint])
        turned = clip.with_motion(rotation, clip.translation)
        held = formats.held(turned, clip.source)
        return float(rotations.angle(held.rotation[:, joint], rotation[:, joint]).max())

    for joint, about in axes.items():
        for axis in np.moveaxis(about, -1, 0):
            assert lost(joint, axis) < 1e-5
        other = np.eye(3) - about @ np.swapaxes(about, -1, -2)
        assert (
            lost(joint, rotations.normalize(other[..., np.argmax(np.linalg.norm(other[0], axis=0))])) > 9e-4
        )


def test_longer_and_shorter(body, tmp_path):
    """Frames go on counting; the rate has no place in the file, and that is said."""
    body.write_bytes(body.read_bytes().rstrip())
    clip = formats.load(body)
    longer = clip.with_motion(np.tile(clip.rotation, (2, 1, 1)), np.tile(clip.translation, (2, 1, 1)))
    formats.save(longer, tmp_path / "long.amc")
    again = formats.load(tmp_path / "long.amc", skeleton=tmp_path / "HDM_xy.asf")
    np.testing.assert_allclose(again.positions(), longer.positions(), atol=1e-6)
    assert b"\r\n6\r\nroot" in (tmp_path / "long.amc").read_bytes()
    short = clip.with_motion(clip.rotation[:2], clip.translation[:2])
    (note,) = formats.save(replace(short, fps=60.0), tmp_path / "short.amc")
    assert "60 fps" in note
    assert body.read_bytes().startswith((tmp_path / "short.amc").read_bytes())


def test_a_cut_keeps_its_text_and_is_counted_from_the_first_number_on(data, tmp_path):
    whole = formats.load(data / "cmu_02_03.amc")
    (tmp_path / "cmu_02.asf").write_bytes((data / "cmu_02.asf").read_bytes())
    assert formats.save(whole.slice(5, 9), tmp_path / "cmu_02_03.amc") == ()
    header, *texts = re.split(rb"(?m)^\d+\r?\n", (data / "cmu_02_03.amc").read_bytes())
    cut = b"".join(b"%d\r\n" % (41 + k) + text for k, text in enumerate(texts[5:9]))
    assert (tmp_path / "cmu_02_03.amc").read_bytes() == header + cut
    again = formats.load(tmp_path / "cmu_02_03.amc")
    assert np.array_equal(again.rotation, whole.rotation[5:9])


def test_other_clips_are_refused(cmu_walk, body, tmp_path):
    with pytest.raises(RequestError, match=r"\.bvh instead"):
        formats.save(cmu_walk, tmp_path / "a.amc")
    clip = formats.load(body)
    other = replace(clip.skeleton, rest_translation=clip.skeleton.rest_translation * 1.1)
    with pytest.raises(RequestError, match=r"no longer the one of HDM_xy\.asf"):
        formats.save(replace(clip, skeleton=other), tmp_path / "a.amc")
    assert not (tmp_path / "a.amc").exists()


def test_convert_to_bvh(data, tmp_path, capsys):
    """The joints of the BVH file lie where those of the ASF/AMC files do."""
    out = tmp_path / "out.bvh"
    code = main(["convert", str(data / "cmu_02_03.amc"), str(out), "--skeleton", str(data / "cmu_02.asf")])
    assert code in (0, None)
    assert "skeleton: cmu_02.asf, given" in capsys.readouterr().out
    amc, bvh = formats.load(data / "cmu_02_03.amc"), formats.load(out)
    assert bvh.skeleton.names == amc.skeleton.names
    np.testing.assert_allclose(bvh.positions(), amc.positions(), atol=1e-6)


# Damaged files -------------------------------------------------------------------------------------------


def error(folder, asf, amc):
    (folder / "a.asf").write_bytes(asf.encode() if isinstance(asf, str) else asf)
    (folder / "a.amc").write_bytes(amc.encode() if isinstance(amc, str) else amc)
    with pytest.raises(FileError) as caught:
        formats.load(folder / "a.amc")
    assert caught.value.what
    assert caught.value.why
    assert caught.value.fix
    assert "\n" not in caught.value.what + caught.value.why + caught.value.fix
    return caught.value.why


def test_not_such_a_file(tmp_path):
    for asf, amc in ((BODY_ASF, "{}"), ("{}", BODY_AMC)):
        assert "empty" in error(tmp_path, asf.format(""), amc.format(""))
        assert "empty" in error(tmp_path, asf.format(" \r\n"), amc.format(" \r\n"))
        assert "binary" in error(tmp_path, asf.format("Kaydara\0"), amc.format("Kaydara\0"))
        assert "line 1: " in error(tmp_path, asf.format("<html>"), amc.format("<html>"))
    assert "no frames" in error(tmp_path, BODY_ASF, ":FULLY-SPECIFIED\n:DEGREES\n")
    assert "no frames" in error(tmp_path, BODY_ASF, BODY_ASF.partition(":root")[0].replace(" ", ":"))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("  length 0.45", "  length 0", "line 6: the length unit is '0'"),
        ("  length 0.45", "  length nan", "line 6: the length unit is 'nan'"),
        ("angle deg", "angle grad", "line 7: the angle unit is 'grad'"),
        (":root", ":roof", "no section :root"),
        (":hierarchy", ":hierarchies", "no section :hierarchy"),
        (":bonedata", ":bones", "there is no bone 'lfemur'"),
        ("order TX TY TZ", "order TX TX TZ", "unknown or repeated degrees of freedom"),
        ("order TX TY TZ RX RY RZ", "order TX TY TZ RX RY L", "l"),
        ("   order TX TY TZ RX RY RZ\n", "", "no order"),
        ("position 0 0 0", "position 0 0", "line 13: position needs three numbers"),
        ("axis XYZ", "axis XYX", "order of the axis is 'XYX'"),
        ("     name ltibia\n", "", "line 27: the bone that begins here has no name"),
        ("name ltibia", "name left tibia", "name is 'left tibia'"),
        ("name ltibia", "name lfemur", "two bones lfemur"),
        ("name ltibia", "name root", "two bones root"),
        ("length 7.9", "length -7.9", "the length is '-7.9'"),
        ("length 7.9", "length inf", "the length is 'inf'"),
        ("     length 7.9\n", "", "the bone ltibia has no length"),
        ("direction 0.1 -0.4 0.9", "direction 0 0 0", "direction of lfoot is zero"),
        ("direction 0.1 -0.4 0.9", "direction 0.1 -0.4 1e99", "direction needs three numbers"),
        ("direction 0.1 -0.4 0.9", "directions 0.1 -0.4 0.9", "the bone lfoot has no direction"),
        ("dof rx rz", "dof rx rw", "unknown or repeated degrees of freedom: rx rw"),
        ("  end\n  begin\n     id 2", "  begin\n     id 2", "line 26: a bone begins inside of another"),
        ("  end\n:hier", ":hier", "stands inside of a bone"),
        ("    root lfemur head\n", "    root lfemur head hat\n", "there is no bone 'hat'"),
        ("    root lfemur head\n", "    root lfemur\n", "does not join head to the root"),
        ("    lfemur ltibia\n", "    lfemur ltibia head\n", "head has two parents"),
        ("    root lfemur head\n", "    root head\n    lfoot lfemur\n", "does not join lfemur to the root"),
        ("    ltibia lfoot\n  end\n", "    ltibia lfoot\n", "has no end: it is truncated"),
    ],
)
def test_damaged_skeletons(tmp_path, old, new, why):
    assert old in BODY_ASF
    assert why in error(tmp_path, BODY_ASF.replace(old, new, 1), BODY_AMC)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("lfoot -11.9533 -6.18738", "foot -11.9533 -6.18738", "line 8: a.asf has no bone 'foot'"),
        (
            "lfoot -11.9533 -6.18738",
            "lfoot -11.9533",
            "line 8: lfoot has 1 numbers, a.asf gives it 2 (rx rz)",
        ),
        ("lfoot -11.9533 -6.18738", "ltibia 12", "line 8: ltibia stands twice"),
        ("root 11.352 18.1848 -1.04479 -25.885 84.6616 -378.765\n", "", "no root"),
        ("lfoot -11.8 1.6201e-014", "foot -11.8 1.6201e-014", "line 13: 'foot' stands where"),
        ("lfoot -11.8 1.6201e-014", "lfoot -11.8", "line 13: lfoot has 1 numbers, in the first frame 2"),
        ("lfoot -11.8 1.6201e-014", "lfoot -11.8 1.6201e-014 3", "line 13: lfoot has 3 numbers"),
        ("lfoot -11.8 1.6201e-014", "lfoot -11.8 nan", "line 13: 'nan' is no number"),
        ("lfoot -11.8 1.6201e-014", "lfoot -11.8 -1.#IND", "line 13: '-1.#IND' is no number"),
        ("lfoot -11.8 1.6201e-014", "lfoot -11.8 1e99", "line 13: 1e99 is out of every range"),
        ("lfoot -11.8 1.6201e-014", "lfoot -11.8 1_0", "line 13: '1_0' is no number"),
        ("lfoot -11.8 1.6201e-014\n", "", "line 13: frame 2 ends before lfoot"),
        (
            "ltibia 23.1\nlfoot -11.8 1.6201e-014\n",
            "lfoot -11.8 1.6201e-014\nltibia 23.1\n",
            "line 12: 'lfoot'",
        ),
        ("\n3\n", "\n4\n", "line 14: frame 4 stands where frame 3 should"),
        ("\n3\n", "\n", "line 14: 'root' stands where the number of frame 3 should"),
        ("\nltibia 23.4\nlfoot -11.7 -6.1\n", "\n", "frame 3 lacks its last bones: it is truncated"),
        (" -6.1\n", "", "line 18: lfoot has 1 numbers"),
        (":DEGREES", ":SAMPLES-PER-SECOND x", "line 3: the frame rate is 'x'"),
        (":DEGREES", ":SAMPLES-PER-SECOND 0.1", "line 3: the frame rate is '0.1'"),
    ],
)
def test_damaged_motions(tmp_path, old, new, why):
    assert old in BODY_AMC
    assert why in error(tmp_path, BODY_ASF, BODY_AMC.replace(old, new, 1))


def test_far_too_much(tmp_path, monkeypatch):
    from interpose.formats.asf_amc import amc_text, asf

    monkeypatch.setattr(amc_text, "FILE_LIMIT", 100)
    assert "larger than" in error(tmp_path, BODY_ASF, BODY_AMC)
    monkeypatch.setattr(asf, "SIZE_LIMIT", 100)
    assert "larger than" in error(tmp_path, BODY_ASF, BODY_AMC)


def test_comments_and_blanks_stay(tmp_path):
    """Comments anywhere, commas and parentheses as blanks, frames that count in steps, bones left out."""
    amc = BODY_AMC.replace("\n2\n", "\n# two\n5 # again\n").replace("\n3\n", "\n\n9\n")
    amc = amc.replace("ltibia 23.1", "ltibia (23.1), # bent").replace("lfoot", "#lfoot")
    path = write(tmp_path, BODY_ASF, amc)
    clip = formats.load(path)
    assert len(clip) == 3
    assert (clip.rotation[:, clip.skeleton.index("lfoot")] == [1, 0, 0, 0]).all()
    rotation = clip.rotation.copy()
    rotation[1, clip.skeleton.index("lfemur")] = [1, 0, 0, 0]
    formats.save(clip.with_motion(rotation, clip.translation), tmp_path / "b.amc")
    expected = path.read_text().replace("lfemur -4.3 0.9 26.5", "lfemur 0 0 0")
    assert (tmp_path / "b.amc").read_text() == expected


# Anything at all ------------------------------------------------------------------------------------------


@st.composite
def skeletons(draw):
    """An ASF text, its bones with their degrees of freedom, and what a motion of it has to say."""
    number = st.floats(-170, 170).map(lambda value: f"{value:.5g}")
    some = st.permutations(["rx", "ry", "rz", "tx", "ty", "tz", "l"])
    axis = st.permutations("XYZ").map("".join)
    root = draw(st.permutations(["TX", "TY", "TZ", "RX", "RY", "RZ"]))
    count = draw(st.integers(1, 6))
    lines = [":units", f" length {draw(st.sampled_from(['0.45', '1', '2.54']))}", ":root"]
    lines += [f" order {' '.join(root)}", f" axis {draw(axis)}", " position 0.5 -1 2"]
    lines += [f" orientation {draw(number)} {draw(number)} {draw(number)}", ":bonedata"]
    dof = {"root": root}
    for bone in range(count):
        dof[f"b{bone}"] = draw(some)[: draw(st.integers(0, 7))]
        lines += ["begin", f" name b{bone}", " direction 0.6 -0.8 0", f" length {bone + 1}"]
        lines += [f" axis {draw(number)} {draw(number)} {draw(number)} {draw(axis)}"]
        lines += [f" dof {' '.join(dof[f'b{bone}'])}", "end"]
    lines += [":hierarchy", "begin"]
    for bone in range(count):
        parent = draw(st.integers(-1, bone - 1))
        lines.append(f"{'root' if parent < 0 else f'b{parent}'} b{bone}")
    return "\n".join([*lines, "end", ""]), {bone: tokens for bone, tokens in dof.items() if tokens}


@settings(max_examples=60)
@given(
    skeleton=skeletons(),
    seed=st.integers(0, 2**32),
    end=st.sampled_from(["\n", "\r\n", " \n"]),
    keyword=st.sampled_from([":DEGREES", ":RADIANS"]),
    up=st.sampled_from(["y", "z"]),
)
def test_any_skeleton_round_trips(tmp_path_factory, skeleton, seed, end, keyword, up):
    """Unchanged: the same bytes. Changed as far as the degrees of freedom go: the same motion."""
    asf, dof = skeleton
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.getbasetemp()
    (folder / "any.asf").write_text(asf)
    frames = 3
    limit = 200 if keyword == ":DEGREES" else 3.5

    def motion(name):
        lines = [":FULLY-SPECIFIED", keyword]
        for frame in range(frames):
            lines.append(str(frame + 7))
            lines += [
                f"{bone} {' '.join(f'{v:.7g}' for v in rng.uniform(-limit, limit, len(tokens)))}"
                for bone, tokens in dof.items()
            ]
        (folder / name).write_bytes((end.join(lines) + end).encode())
        return formats.load(folder / name, unit=0.1, up=up, skeleton=folder / "any.asf")

    clip, other = motion("any_1.amc"), motion("any_2.amc")
    formats.save(clip, folder / "out.amc", force=True)
    assert (folder / "out.amc").read_bytes() == (folder / "any_1.amc").read_bytes()
    changed = clip.with_motion(other.rotation, other.translation)
    assert formats.save(changed, folder / "out.amc", force=True) == ()
    again = formats.load(folder / "out.amc", unit=0.1, up=up, skeleton=folder / "any.asf")
    assert rotations.angle(again.rotation, other.rotation).max() < 2e-5
    np.testing.assert_allclose(again.translation, other.translation, atol=1e-3)


@settings(max_examples=200)
@given(
    which=st.booleans(),
    edits=st.lists(
        st.tuples(
            st.floats(0, 1),
            st.integers(0, 12),
            st.one_of(
                st.binary(max_size=6),
                st.sampled_from(
                    [b"\n", b" ", b"nan", b"1e308", b"begin", b"end", b":root", b"-", b"#", b"2\n"]
                ),
            ),
        ),
        min_size=1,
        max_size=4,
    ),
    cut=st.floats(0, 1),
)
def test_fuzz(tmp_path_factory, which, edits, cut):
    """Damaged bytes give a FileError or a sound clip that can be written, and nothing else."""
    text = (BODY_ASF if which else BODY_AMC).encode()
    for place, length, new in edits:
        begin = int(place * len(text))
        text = text[:begin] + new + text[begin + length :]
    if cut > 0.9:
        text = text[: int((cut - 0.9) * 10 * len(text))]
    folder = tmp_path_factory.getbasetemp()
    (folder / "fuzz.asf").write_bytes(text if which else BODY_ASF.encode())
    (folder / "fuzz.amc").write_bytes(BODY_AMC.encode() if which else text)
    try:
        clip = formats.load(folder / "fuzz.amc")
    except FileError:
        return
    assert np.isfinite(clip.positions()).all()
    formats.save(clip, folder / "out.amc", force=True)
    assert (folder / "out.amc").read_bytes() == (folder / "fuzz.amc").read_bytes()
    rotation = np.tile([1.0, 0, 0, 0], (*clip.rotation.shape[:2], 1))
    formats.save(clip.with_motion(rotation, clip.translation), folder / "out.amc", force=True)
    assert len(formats.load(folder / "out.amc", skeleton=folder / "fuzz.asf")) == len(clip)


def test_a_motion_that_is_written_away_from_its_skeleton_says_what_it_needs(body, tmp_path):
    clip, elsewhere = formats.load(body), tmp_path / "elsewhere"
    elsewhere.mkdir()
    (note,) = formats.save(clip, elsewhere / "a.amc")
    assert ".asf" in note
    assert not formats.save(clip, body.with_name("again.amc"))
