"""Joints are found on rigs of many tools, by names, by their place, by shape, or as somebody says."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons import rigs

from interpose.clip import Clip, Skeleton
from interpose.errors import FileError, RequestError
from interpose.skeletons import JOINTS, find_mapping, names
from interpose.skeletons.mapfile import map_text, read_map


def named(skeleton: Skeleton) -> dict[str, str]:
    joints = find_mapping(skeleton).joints
    return {name: skeleton.names[joint] for name, joint in zip(JOINTS, joints) if joint is not None}


def renamed(skeleton: Skeleton, prefix: str = "bone") -> Skeleton:
    return replace(skeleton, names=tuple(f"{prefix}{j}" for j in range(len(skeleton))))


@pytest.mark.parametrize("rig", rigs.RIGS)
def test_every_rig_is_mapped_without_help(cmu_walk, rig):
    clip, expected = rigs.build(rig, cmu_walk)
    assert named(clip.skeleton) == expected
    mapping = find_mapping(clip.skeleton)
    assert mapping.usable
    assert mapping.surely in ("name", "chain")


@pytest.mark.parametrize("rig", ["mixamo", "smplx", "rokoko", "unity"])
def test_without_names_the_shape_tells(cmu_walk, rig):
    clip, expected = rigs.build(rig, cmu_walk)
    mapping = find_mapping(renamed(clip.skeleton))
    found = {name: joint for name, joint in zip(JOINTS, mapping.joints) if joint is not None}
    assert {name: clip.skeleton.names[joint] for name, joint in found.items()} == {
        name: own for name, own in expected.items() if name in found
    }
    assert len(found) >= 19
    assert mapping.usable
    assert mapping.surely == "shape"


def test_a_horse_is_no_humanoid(cmu_walk):
    """The same tree with a level back: arms and legs hang down from it."""
    clip, _ = rigs.build("smpl", cmu_walk)
    bones = clip.skeleton.rest_translation.copy()
    for joint, name in enumerate(clip.skeleton.names):
        if name.startswith(("Spine", "Neck", "Head")):
            bones[joint] = bones[joint][[0, 2, 1]]
        elif name[2:] in ("Elbow", "Wrist", "Hand"):
            bones[joint] = [0, -abs(bones[joint, 0]), 0]
    mapping = find_mapping(renamed(replace(clip.skeleton, rest_translation=bones)))
    assert not mapping.usable
    assert "Hips" in mapping.lacking


@pytest.mark.parametrize(
    ("own", "said"),
    [
        ("lfemur", "LeftUpLeg"),
        ("thigh_l", "LeftUpLeg"),
        ("L_Hip", "LeftUpLeg"),
        ("Bip01 L Thigh", "LeftUpLeg"),
        ("UpperLeg.L", "LeftUpLeg"),
        ("LEFT_UPLEG", "LeftUpLeg"),
        ("character:Left_Up_Leg", "LeftUpLeg"),
        ("lThighBend", "LeftUpLeg"),
        ("leftupleg", "LeftUpLeg"),
        ("LEFTFOREARM", "LeftForeArm"),
        ("LeftUpLeg_bind", "LeftUpLeg"),
        ("LeftUpLeg_skin", "LeftUpLeg"),
    ],
)
def test_left_and_right_in_every_spelling(cmu_walk, own, said):
    skeleton = replace(
        cmu_walk.skeleton, names=tuple(own if n == said else n for n in cmu_walk.skeleton.names), roles={}
    )
    mapping = find_mapping(skeleton)
    assert skeleton.names[mapping[said]] == own


def test_what_somebody_says_stands(cmu_walk):
    skeleton = replace(cmu_walk.skeleton, roles={"LeftHand": "LThumb", "RightToe": ""})
    mapping = find_mapping(skeleton)
    assert skeleton.names[mapping["LeftHand"]] == "LThumb"
    assert mapping.how[JOINTS.index("LeftHand")] == "given"
    assert mapping["RightToe"] is None
    others = [name for name in JOINTS if name not in ("LeftHand", "RightToe")]
    plain = find_mapping(cmu_walk.skeleton)
    assert all(mapping[name] == plain[name] for name in others)


@pytest.mark.parametrize(
    ("roles", "words"),
    [
        ({"Hip": "Hips"}, "Did you mean Hips"),
        ({"Hips": "Pelvis"}, "Hips cannot be Pelvis"),
        ({"LeftArm": "Hips", "RightArm": "Hips"}, "Hips twice"),
        ({"Hips": "LeftFoot"}, "Hips cannot be LeftFoot"),
        ({"LeftUpLeg": "RightUpLeg"}, "LeftUpLeg cannot be RightUpLeg"),
        ({"LeftUpLeg": "LeftFoot", "LeftFoot": "LeftUpLeg"}, "cannot be"),
        ({"root": "LeftUpLeg", "Head": "Head"}, "does not hang below LeftUpLeg"),
        ({"root": "nobody"}, "no joint nobody"),
    ],
)
def test_what_somebody_says_wrongly_is_said(cmu_walk, roles, words):
    with pytest.raises(RequestError, match=words):
        find_mapping(replace(cmu_walk.skeleton, roles=roles))


def test_several_characters_in_one_file(cmu_walk):
    """Two people and a ball: the first whole one is taken, or the one that is named."""
    one = cmu_walk.skeleton
    names = (*(f"A:{n}" for n in one.names), *(f"B:{n}" for n in one.names), "ball")
    shifted = tuple(p + len(one) if p >= 0 else -1 for p in one.parents)
    bones = np.concatenate([one.rest_translation, one.rest_translation, np.zeros((1, 3))])
    both = Skeleton(names, (*one.parents, *shifted, -1), bones)
    assert both.names[find_mapping(both)["Head"]] == "A:Head"
    chosen = find_mapping(replace(both, roles={"root": "B:Hips"}))
    assert {both.names[joint][:2] for joint in chosen.mapped[1]} == {"B:"}
    assert len(chosen.mapped[0]) == 22


@pytest.mark.parametrize(
    ("own", "odd", "role"),
    [
        ("LeftArm", "LeftOberarm", "LeftArm"),
        ("RightUpLeg", "RightHaunch", "RightUpLeg"),
        ("LeftForeArm", "LeftElbo", "LeftForeArm"),
        ("RightLeg", "RightKnie", "RightLeg"),
        ("RightFoot", "RFt", "RightFoot"),
        ("Spine1", "Thing", "Spine2"),
    ],
)
def test_one_odd_name_is_found_by_its_place(cmu_walk, own, odd, role):
    skeleton = replace(
        cmu_walk.skeleton, names=tuple(odd if n == own else n for n in cmu_walk.skeleton.names)
    )
    mapping, plain = find_mapping(skeleton), find_mapping(cmu_walk.skeleton)
    assert mapping.joints == plain.joints
    assert mapping.how[JOINTS.index(role)] == "chain"


def test_names_of_another_language_are_found_by_shape_with_the_whole_trunk(cmu_walk):
    mapping = find_mapping(renamed(cmu_walk.skeleton, "gelenk"))
    plain = find_mapping(cmu_walk.skeleton)
    odd = [n for n, a, b in zip(JOINTS, mapping.joints, plain.joints) if a != b]
    assert not odd


def test_a_pelvis_beside_the_spine_is_found_by_shape(cmu_walk):
    """Legs hang from a joint of their own, beside the spine, as in MikuMikuDance."""
    old = rigs.build("smpl", cmu_walk)[0].skeleton
    legs = [old.index(name) for name in ("L_Hip", "R_Hip")]
    parents = [
        -1,
        0,
        *(1 if j in legs else above + (above > 0) for j, above in enumerate(old.parents[1:], 1)),
    ]
    bones = np.insert(old.rest_translation, 1, 0.0, axis=0)
    beside = Skeleton((old.names[0], "pelvis", *old.names[1:]), tuple(parents), bones)
    found, plain = (find_mapping(renamed(skeleton)) for skeleton in (beside, old))
    assert found.usable
    assert found["Hips"] == 0
    assert tuple(j and j - 1 for j in found.joints) == plain.joints


def _with(skeleton: Skeleton, at: str, name: str, bones: list) -> Skeleton:
    """A chain of joints hung from a joint."""
    names, parents, offsets = list(skeleton.names), list(skeleton.parents), list(skeleton.rest_translation)
    above = skeleton.index(at)
    for number, bone in enumerate(bones):
        names.append(f"{name}{number}")
        parents.append(above)
        offsets.append(np.array(bone))
        above = len(names) - 1
    return Skeleton(tuple(names), tuple(parents), np.array(offsets))


def test_capes_and_swords_do_not_confuse(cmu_walk):
    dressed = _with(cmu_walk.skeleton, "Spine1", "cape", [[0, -0.2, -0.1]] * 6)
    armed = _with(dressed, "RightHand", "sword", [[0, 0.1, 0.4]] * 3)
    assert find_mapping(renamed(armed)).joints == find_mapping(cmu_walk.skeleton).joints
    assert find_mapping(armed).joints == find_mapping(cmu_walk.skeleton).joints


def test_names_are_read_character_by_character(cmu_walk):
    """Prefixes are those of a character, not of the file, which may hold props first."""
    one = cmu_walk.skeleton
    names = (*(f"prop{j}" for j in range(13)), *(f"Bob_{n}" for n in one.names))
    parents = (-1, *range(12), *(p + 13 if p >= 0 else -1 for p in one.parents))
    both = Skeleton(names, parents, np.concatenate([np.full((13, 3), 0.1), one.rest_translation]))
    mapping = find_mapping(both)
    assert mapping.surely in ("name", "chain")
    assert both.names[mapping["LeftHand"]] == "Bob_LeftHand"


@pytest.mark.parametrize("extras", [0, 200])
def test_what_names_share_is_their_own_word(cmu_walk, extras):
    """Not the first word of whichever joint comes first: of a root that is called otherwise, or of a body
    below which most joints are of a face."""
    old = cmu_walk.skeleton
    body = old.names if extras else tuple(f"Hero_{name}" for name in old.names)
    names = ("Scene_Root", *body, *(f"Face_{number:02d}" for number in range(extras)))
    head = 1 + old.index("Head")
    parents = (-1, *(parent + 1 for parent in old.parents), *[head] * extras)
    rest = np.concatenate([np.zeros((1, 3)), old.rest_translation, np.tile([0.0, 0.02, 0.05], (extras, 1))])
    mapping, plain = find_mapping(Skeleton(names, parents, rest)), find_mapping(old)
    assert mapping.joints == tuple(None if joint is None else joint + 1 for joint in plain.joints)
    assert mapping.how == plain.how


def test_bones_without_length_are_no_body(cmu_walk):
    flat = replace(cmu_walk.skeleton, rest_translation=np.zeros((31, 3)))
    assert not find_mapping(flat).usable


def test_a_map_file_says_what_was_found_and_is_read_back(cmu_walk, tmp_path):
    path = tmp_path / "map.json"
    path.write_text(map_text(find_mapping(cmu_walk.skeleton)))
    held = json.loads(path.read_text())
    assert list(held["joints"]) == list(JOINTS), "those that were not found, too"
    assert {*held["unused"], *held["joints"].values()} == {*cmu_walk.skeleton.names}
    nameless = renamed(cmu_walk.skeleton)
    roles = {
        name: nameless.names[cmu_walk.skeleton.index(own)] if own else ""
        for name, own in read_map(path).items()
    }
    given = find_mapping(replace(nameless, roles=roles))
    assert given.joints == find_mapping(cmu_walk.skeleton).joints
    assert given.surely == "given"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("no json", "no JSON"),
        ("[]", 'no object "joints"'),
        ('{"joints": {"Hips": 3}}', "not a name"),
        ('{"joints": {"LeftFinger": "x"}}', "unknown canonical joint"),
    ],
)
def test_bad_map_files(tmp_path, text, words):
    path = tmp_path / "map.json"
    path.write_text(text)
    with pytest.raises((FileError, RequestError), match=words):
        read_map(path)


def test_missing_joints_are_derived(cmu_walk):
    """Without toes, shoulders and all but one spine joint: weights are sums of one, lengths plausible."""
    clip, _ = rigs.build("child", cmu_walk)
    mapping = find_mapping(clip.skeleton)
    assert set(mapping.missing) == {
        *("Spine1", "Spine2", "Neck", "LeftShoulder", "RightShoulder", "LeftToe", "RightToe")
    }
    ends = [row for row in range(22) if row not in mapping.levers]
    assert np.allclose(mapping.weights[ends].sum(axis=1), 1)
    assert set(mapping.levers) == {JOINTS.index("LeftToe"), JOINTS.index("RightToe")}


def test_anything_may_be_called_anything(cmu_walk):
    """Names of any kind never break the mapping."""
    rng = np.random.default_rng(0)
    letters = np.array(list("abcLRlr_.:- 0129éß"))
    for _ in range(50):
        count = len(cmu_walk.skeleton)
        names = tuple("".join(rng.choice(letters, rng.integers(1, 9))) + str(j) for j in range(count))
        find_mapping(replace(cmu_walk.skeleton, names=names))
    lone = Clip(Skeleton(("x",), (-1,), np.zeros((1, 3))), np.ones((1, 1, 4)) / 2, np.zeros((1, 1, 3)), 30.0)
    assert not find_mapping(lone.skeleton).usable


def beside(skeleton: Skeleton, helpers: dict[str, str]) -> Skeleton:
    """The skeleton with a leaf before each of some joints, where that begins, by the joints' names."""
    names, parents, rest, at = [], [], [], {}
    for joint, name in enumerate(skeleton.names):
        above = skeleton.parents[joint]
        for helper in (key for key, like in helpers.items() if like == name):
            names.append(helper)
            parents.append(at[above])
            rest.append(skeleton.rest_translation[joint])
        at[joint] = len(names)
        names.append(name)
        parents.append(at[above] if above >= 0 else -1)
        rest.append(skeleton.rest_translation[joint])
    return Skeleton(names, parents, np.array(rest))


def test_helpers_that_are_called_like_what_they_help_are_none_of_it(cmu_walk):
    """Leaves that come first in the file: of elbow, ankle, collar and thigh."""
    plain = cmu_walk.skeleton
    leaves = {
        "LeftElbow": "LeftForeArm",
        "LeftAnkle": "LeftFoot",
        "LeftCollar": "LeftShoulder",
        "RightThigh": "RightUpLeg",
    }
    expected = named(plain)
    found = named(beside(plain, leaves))
    assert found == expected


def test_of_rigify_s_bones_those_that_deform_are_the_body(cmu_walk):
    """Files with all of them hold each limb several times, ORG- first."""
    clip, expected = rigs.build("rigify", cmu_walk)
    old = clip.skeleton
    assert any(name.startswith("DEF-") for name in old.names)
    more = tuple(name.replace("DEF-", "ORG-") if "DEF-" in name else f"ORG-{name}" for name in old.names)
    count = len(old)
    parents = (
        -1,
        *(parent + 1 for parent in old.parents),
        *(p + 1 + count if p >= 0 else 0 for p in old.parents),
    )
    rest = np.concatenate([np.zeros((1, 3)), old.rest_translation, old.rest_translation])
    names = ("root", *more, *old.names)
    assert named(Skeleton(names, parents, rest)) == expected


def test_where_the_bones_that_deform_are_no_body_the_others_are(cmu_walk):
    """Of Rigify's own rigs, on which they hang one by one from the others."""
    old, parents, rest = (
        cmu_walk.skeleton,
        list(cmu_walk.skeleton.parents),
        cmu_walk.skeleton.rest_translation,
    )
    names = [f"ORG-{name}" for name in old.names] + [f"DEF-{name}" for name in old.names]
    skeleton = Skeleton(names, [*parents, *range(len(old))], np.concatenate([rest, np.zeros_like(rest)]))
    assert find_mapping(skeleton).joints == find_mapping(old).joints


@pytest.mark.parametrize("limb", ["Leg", "Arm"])
def test_names_of_two_limbs_tell_the_sides_of_all_four(cmu_walk, limb):
    """A body that faces backwards in its zero pose, without toes to tell."""
    old, keep = cmu_walk.skeleton, []
    for joint, name in enumerate(old.names):
        if not any(part in name for part in ("Toe", "Finger", "Thumb", "Index")):
            keep.append(joint)
    at = {joint: row for row, joint in enumerate(keep)}
    parents = [at.get(old.parents[joint], -1) for joint in keep]
    rest = old.rest_translation[keep] * [-1.0, 1.0, -1.0]
    told = [old.names[joint] for joint in keep]
    letters = [
        ("_L" if "Left" in name else "_R") if limb in name and ("Left" in name or "Right" in name) else ""
        for name in told
    ]
    mapping = find_mapping(Skeleton([f"q{row}{letter}" for row, letter in enumerate(letters)], parents, rest))
    assert mapping.usable
    for part in ("UpLeg", "Leg", "Arm", "ForeArm"):
        own = mapping["Left" + part]
        assert own is not None
        assert "Left" in told[own], part


@pytest.mark.parametrize("prefix", ["Body_", "Head_", "R_", "FullBody_", "man_l_", "mixamorig:"])
@pytest.mark.parametrize("heap", [False, True])
def test_a_prefix_may_be_a_part_or_a_side(cmu_walk, prefix, heap):
    plain = cmu_walk.skeleton
    rest = (
        plain.rest_translation * [1.0, 1.0, 0.0] if not heap else np.abs(plain.rest_translation) * [0, 1, 0]
    )
    skeleton = replace(plain, names=tuple(prefix + name for name in plain.names), rest_translation=rest)
    joints = find_mapping(skeleton).joints
    assert joints == find_mapping(replace(plain, rest_translation=rest)).joints
    assert find_mapping(skeleton).surely in ("name", "chain")


@pytest.mark.parametrize(
    ("own", "role"),
    [
        ("SKEL_L_Thigh", "LeftUpLeg"),
        ("thigh_stretch.l", "LeftUpLeg"),
        ("NPC L Thigh [LThg]", "LeftUpLeg"),
        ("LLegThigh", "LeftUpLeg"),
        ("leg left knee", "LeftLeg"),
    ],
)
def test_words_of_tools_say_nothing_of_the_body(own, role):
    (said,) = names.read((own,))
    part = {"LeftUpLeg": "thigh", "LeftLeg": "shin"}[role]
    assert (said.part, said.side) == (part, -1)


def test_by_shape_names_tell_the_sides_and_both_limbs_are_cut_alike(cmu_walk):
    """Of joints whose other words say nothing, on a rig whose bones differ a little from side to side, and on
    which something stands out behind each ankle."""
    clip, _ = rigs.build("unity", cmu_walk)
    old = clip.skeleton
    expected = find_mapping(old)
    told = {}
    for joint, name in enumerate(old.names):
        side = "L" if "Left" in name else "R" if "Right" in name else "C"
        told[joint] = f"{side}_q{joint}"
    rest = old.rest_translation.copy()
    for joint, name in enumerate(old.names):
        if "Left" in name:
            rest[joint] *= 1.03
    toes = [expected.joints[JOINTS.index(side + "Toe")] for side in ("Left", "Right")]
    rest[[toe for toe in toes if toe is not None]] *= [1.0, 1.0, -1.0]
    mapping = find_mapping(Skeleton(tuple(told.values()), old.parents, rest))
    for side in ("Left", "Right"):
        for part in ("UpLeg", "Leg", "Foot", "Arm", "ForeArm", "Hand"):
            assert mapping[side + part] == expected[side + part], side + part
