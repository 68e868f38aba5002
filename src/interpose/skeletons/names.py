"""What a joint's name says: a side and a part of the body, in the spellings of many tools.

Names are cut into words (`mixamorig:LeftUpLeg` into left, up, leg; `CC_Base_L_Thigh` into cc, base, l,
thigh), words that only name the tool are dropped, and what is left is looked up. Known are LAFAN1, CMU and
other BVH conversions, ASF/AMC of CMU and HDM05, Bandai-Namco, Mixamo, HumanIK and Vicon, Unreal, Unity, VRM,
SMPL and SMPL-X, Rokoko, Xsens, OptiTrack, Biped, Character Creator, Daz, MakeHuman, Rigify and MikuMikuDance.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

# What words mean. "shoulder", "leg", "foot" and "hip" mean different joints in different tools: the chain
# that they are in decides.
PARTS = {
    "hips": "hips hip pelvis root cog bodyroot",
    "spine": "spine chest abdomen abdomenlower abdomenupper chestlower chestupper upperchest lowerchest ab "
    "waist lowerback upperback midback back thorax torso l lumbar stomach body belly",
    "neck": "neck lowerneck upperneck neckbase necklower neckupper necktwist",
    "head": "head skull",
    "clavicle": "clavicle collar collarbone clav scapula",
    "shoulder": "shoulder shldr",
    "upperarm": "arm upperarm uparm uarm humerus bicep shldrbend upperarmbend armupper",
    "forearm": "forearm lowerarm lowarm loarm farm radius elbow forearmbend lowerarmbend armlower",
    "hand": "hand wrist",
    "thigh": "thigh upperleg upleg uleg femur thighbend upperlegbend legupper",
    "leg": "leg",
    "shin": "shin calf knee tibia lowerleg lowleg loleg shinbend leglower",
    "ankle": "ankle",
    "foot": "foot",
    "toe": "toe toes toebase ball football toebig",
}
MEANING = {word: part for part, words in PARTS.items() for word in words.split()}
SIDED = {
    "clavicle",
    "shoulder",
    "upperarm",
    "forearm",
    "hand",
    "thigh",
    "leg",
    "shin",
    "ankle",
    "foot",
    "toe",
}

LEFT, RIGHT = {"left", "l", "lft", "lt"}, {"right", "r", "rgt", "rt"}
# Words that say nothing about the body, and words of joints that hang from others and are none of the 22.
_TOOLS = (
    "mixamorig bip biped cc base def org j c m jnt joint bone jt skeleton character armature rig sk b bind "
    "skin skel stretch npc"
)
_EXTRAS = (
    "twist roll ik end nub tip effector helper pole target ctrl fk sec adj eye jaw tongue brow lip cheek "
    "hair finger thumb index middle mid ring pinky little metacarpal metatarsal metatarsals palm carpal "
    "heel weapon prop facial face teeth muscle ribs rib breast pectoral glute skirt tail ear nose lid share "
    "gun site lookat scale ponytail cloth belt bag"
)
TOOLS, EXTRAS = set(_TOOLS.split()), set(_EXTRAS.split())
CUT = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


# MikuMikuDance's names are Japanese; longer words stand before those that they hold. Its second legs, which
# carry what the first ones do plus inverse kinematics, end in D: they are none of the body's.
JAPANESE = {
    "全ての親": "root",
    "下半身": "pelvis share",
    "上半身": "spine",
    "センター": "cog",
    "グルーブ": "cog",
    "腰キャンセル": "share",
    "足首": "ankle",
    "手首": "wrist",
    "手捩": "forearm twist",
    "腕捩": "arm twist",
    "つま先": "toe",
    "足先": "toe share",
    "ひざ": "knee",
    "ひじ": "elbow",
    "親指": "thumb",
    "人指": "index",
    "中指": "middle",
    "薬指": "ring",
    "小指": "pinky",
    "左": "left",
    "右": "right",
    "目": "eye",
    "腰": "hips",
    "肩": "collar",
    "腕": "arm",
    "足": "thigh",
    "首": "neck",
    "頭": "head",
}
DEFORMS = re.compile(r"DEF\W")  # how names of bones begin that deform, beside those that move them (Rigify)


@dataclass(frozen=True)
class Said:
    """What a name says: the part (a key of PARTS, or None) and the side: -1 left, 1 right, 0 neither."""

    part: str | None
    side: int = 0


def words(name: str) -> list[str]:
    """The words of a name, in lower case and English, without its namespace and what stands in brackets."""
    if not name.isascii():
        name = unicodedata.normalize("NFKC", name)  # letters and numbers may be wide ones
        for japanese, english in JAPANESE.items():
            name = name.replace(japanese, f" {english} ")
    return [word.lower() for word in CUT.findall(re.sub(r"\[.*?\]", "", re.split(r"[:|]", name)[-1]))]


def _shared(named: list[list[str]]) -> list[str]:
    """The first words that (nearly) all names share: a prefix of the tool or of the character."""
    shared: list[str] = []
    while True:
        count = len(shared)
        firsts = [one[count] for one in named if len(one) > count + 1 and one[:count] == shared]
        common = max(set(firsts), key=firsts.count, default="")
        if len(firsts) < 3 or firsts.count(common) < 0.8 * len(named):
            return shared
        shared.append(common)


def read(names: tuple[str, ...], deforming: bool = False) -> list[Said]:
    """What the names of a skeleton's joints say; or those alone of joints that deform, as of Rigify's."""
    cut = [words(name) for name in names]
    if deforming:
        cut = [one if one[:1] == ["def"] else [] for one in cut]
    shared = _shared(cut)
    readings = []
    for count in range(len(shared) + 1):
        prefix = shared[:count]
        readings.append([_say(one[count:] if one[:count] == prefix else one) for one in cut])
    # A prefix may be a word for a part or a side: what leaves most of a body is none of it.
    return max(readings, key=lambda said: len({(one.part, one.side) for one in said}))


def _say(cut: list[str]) -> Said:
    side = 0
    kept = []
    for word in cut:
        if word in LEFT | RIGHT and not side:
            side = -1 if word in LEFT else 1
        elif not word.isdigit() and word not in TOOLS:
            kept.append(word)
    if len(kept) == 2 and kept[0] in ("arm", "leg") and kept[1] in MEANING and "".join(kept) not in MEANING:
        kept = kept[1:]  # LLegThigh
    plain = "".join(kept)
    extra = EXTRAS & set(kept)
    if not side and plain not in MEANING:
        side, plain = _glued(plain)
    if extra and plain not in MEANING:
        return Said(None, side)
    part = MEANING.get(plain)
    if plain == "l" or (side and part in ("spine", "neck", "head", "hips") and plain not in ("hip",)):
        return Said(None, side)
    if side and plain == "hip":
        return Said("hip", side)
    if not side and part in SIDED:
        return Said("hips" if plain == "hip" else None, 0)
    return Said(part, side)


def _glued(plain: str) -> tuple[int, str]:
    """A side that is glued to the word, its first letter or all of it: lfemur, thighl, leftupleg."""
    for glued, side in (("left", -1), ("right", 1), ("l", -1), ("r", 1)):
        for rest in (plain.removeprefix(glued), plain.removesuffix(glued)):
            if rest != plain and (MEANING.get(rest) in SIDED or rest == "hip"):
                return side, rest
    return 0, plain
