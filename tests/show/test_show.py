"""Pictures: what is in them, that they are well-formed and safe, and that the player's numbers are right."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import numpy as np
import pytest

from interpose.errors import RequestError
from interpose.observation import Gap
from interpose.show import Take, figure, line_plot, player, strip
from interpose.show.player import decode
from interpose.show.plot import Box, box_plot
from interpose.show.strip import choose_frames, excerpt, slots, view

JOINTS = {
    "Hips": (-1, 0, 0.95, 0),
    "LeftUpLeg": (0, 0.1, 0.9, 0),
    "LeftFoot": (1, 0.1, 0.08, 0),
    "LeftToe": (2, 0.1, 0.02, 0.14),
    "RightUpLeg": (0, -0.1, 0.9, 0),
    "RightFoot": (4, -0.1, 0.08, 0),
    "RightToe": (5, -0.1, 0.02, 0.14),
    "Spine": (0, 0, 1.2, 0),
    "Neck": (7, 0, 1.45, 0),
    "Head": (8, 0, 1.55, 0.02),
    "LeftArm": (8, 0.2, 1.4, 0),
    "LeftHand": (10, 0.25, 0.9, 0),
    "RightArm": (8, -0.2, 1.4, 0),
    "RightHand": (12, -0.25, 0.9, 0),
}
NAMES = list(JOINTS)
PARENTS = [int(joint[0]) for joint in JOINTS.values()]
REST = np.array([joint[1:] for joint in JOINTS.values()])
SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "</script><script>alert(1)</script>\"'&<b> {{data}} \x00"


def walk(frames: int = 90, speed: float = 1.2) -> np.ndarray:
    """(F, J, 3) a figure that walks along z and swings its feet."""
    time = np.arange(frames)[:, None] / 30
    motion = REST + np.zeros((frames, 1, 1))
    motion[:, :, 2] += speed * time
    motion[:, [2, 3], 2] += 0.3 * np.sin(6 * time)
    motion[:, [5, 6], 2] -= 0.3 * np.sin(6 * time)
    return motion


def takes(frames: int = 90) -> list[Take]:
    truth = walk(frames)
    other = truth + np.array([0, 0.03, 0.0])
    return [Take("truth", truth, "#64748b", ghost=True), Take("filled", other, "#2563c9")]


def figures(svg: str, row: int) -> list[ET.Element]:
    rows = [g for g in ET.fromstring(svg).iter(SVG + "g") if g.get("class") == "take"]
    return [g for g in rows[row].iter(SVG + "g") if (g.get("class") or "").startswith("figure")]


def data(page: str) -> dict:
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S)[1])


class Tags(HTMLParser):
    """Fails on tags that do not close; keeps all tags and the text of scripts."""

    VOID = ("meta", "input", "br", "img", "link")

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.all: list[tuple[str, dict]] = []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.all.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


# ---- strip


def test_strip_has_a_row_a_take_and_the_gap_in_its_color():
    svg = strip(takes(), PARENTS, 30, [Gap(30, 60)], names=NAMES, title="Walk", count=14)
    for row, color in ((0, "#64748b"), (1, "#2563c9")):
        drawn = figures(svg, row)
        assert len(drawn) == 14
        frames = [int(g.get("data-frame")) for g in drawn]
        assert frames == sorted(set(frames))
        assert {29, 60} <= set(frames), "the neighbours of the gap are shown"
        for g, frame in zip(drawn, frames):
            inside = 30 <= frame < 60
            assert g.get("class") == ("figure filled" if inside else "figure observed")
            # The trunk and the head have the color itself, limbs a darker and a lighter one.
            assert (color in ET.tostring(g, "unicode")) == inside
    assert sum(r.get("class") == "gap" for r in ET.fromstring(svg).iter(SVG + "rect")) == 1


def test_strip_tells_left_from_right_by_darkness():
    svg = strip(takes()[1:], PARENTS, 30, [(30, 60)], names=NAMES)
    shown = next(g for g in figures(svg, 0) if g.get("class") == "figure filled")
    colors = {p.get("stroke") for p in shown.iter(SVG + "path")}
    assert len(colors) == 3
    nameless = strip(takes()[1:], PARENTS, 30, [(30, 60)])
    shown = next(g for g in figures(nameless, 0) if g.get("class") == "figure filled")
    assert {p.get("stroke") for p in shown.iter(SVG + "path")} == {"#2563c9"}


def test_a_root_at_the_origin_above_the_hips_is_not_drawn():
    """As in the Bandai-Namco clips; the picture is that of the same motion without it."""
    plain = takes()
    above = [Take(t.name, np.insert(t.positions, 0, 0.0, axis=1), t.color, t.ghost) for t in plain]
    parents, names = [-1, *(parent + 1 for parent in PARENTS)], ["joint_Root", *NAMES]
    for joints in (None, ("LeftArm",)):
        gaps = [Gap(30, 60, joints)]
        for draw in (strip, player):
            with_root = draw(above, parents, 30, gaps, names=names)
            assert with_root == draw(plain, PARENTS, 30, gaps, names=NAMES)
    whole = strip(above, parents, 30, [Gap(30, 60, ("joint_Root",))], names=names)
    assert whole == strip(plain, PARENTS, 30, [Gap(30, 60)], names=NAMES)


def test_strip_of_some_missing_joints_tints_what_hangs_below_them():
    svg = strip(takes()[1:], PARENTS, 30, [Gap(30, 60, ("LeftArm",))], names=NAMES)
    shown = next(g for g in figures(svg, 0) if g.get("class") == "figure filled")
    colors = {p.get("stroke") for p in shown.iter(SVG + "path")}
    assert figure.mix("#2563c9", "#000000", 0.28) in colors, "the left arm is tinted"
    assert "#2563c9" not in colors, "the trunk is not"


@pytest.mark.parametrize(
    "gaps", [[], [(0, 90)], [(0, 10)], [(80, 90)], [(10, 20), (20, 30), (50, 55)], [(5, 5)]]
)
@pytest.mark.parametrize("names", [None, NAMES])
def test_strip_and_player_of_odd_gaps(gaps, names):
    svg = strip(takes(), PARENTS, 30, gaps, names=names)
    assert len(figures(svg, 0)) >= 8
    assert not re.search(r"nan|inf\b", svg)
    assert len(data(player(takes(), PARENTS, 30, gaps, names=names))["gaps"]) == len(
        [g for g in gaps if g[0] < g[1]]
    )


def test_one_frame_and_one_joint():
    svg = strip(takes(1), PARENTS, 30, [], names=NAMES)
    assert len(figures(svg, 0)) == 1
    assert data(player(takes(1), PARENTS, 30, [(0, 1)], names=NAMES))["frames"] == 1
    dot = [Take("dot", np.zeros((3, 1, 3)), "#ff0000")]
    ET.fromstring(strip(dot, [-1], 24, [(1, 2)]))
    Tags(player(dot, [-1], 24, [(1, 2)]))


def test_strip_stays_inside_the_picture():
    wide = walk()
    wide[:, 13, 2] -= 4.0  # an arm far behind: to the left of the first figure
    svg = strip([Take("wide", wide, "#2563c9")], PARENTS, 30, [(30, 60)], names=NAMES)
    first = figures(svg, 0)[0]
    xs = [float(x) for p in first.iter(SVG + "path") for x in re.findall(r"[ML](-?[\d.]+) ", p.get("d"))]
    assert min(xs) >= 0


def test_travel_goes_to_the_right():
    for way in ([0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0], [0.6, 0, 0.8]):
        right, up, viewer = view(np.array(way), True)
        assert right @ np.array(way) > 0.8
        assert up[1] > 0.9
        assert right[1] == 0
        assert np.allclose(np.cross(right, up), viewer)


def test_frames_are_denser_in_the_gap_and_long_clips_show_its_surroundings():
    gaps = figure.spans([(3000, 3060)], 9000)
    start, stop = excerpt(gaps, 9000, 30)
    assert (start, stop) == (2980, 3080)
    frames = choose_frames(gaps, start, stop, 14)
    inside = [f for f in frames if 3000 <= f < 3060]
    assert len(frames) == 14
    assert len(inside) / 60 > 1.5 * (14 - len(inside)) / 40
    assert np.ptp(np.diff(inside)) <= 1, "even inside the gap"


def test_slots_hold_their_figures_and_are_even_where_they_can_be():
    scale, edges = slots(np.array([0.5, 0.5, 2.0, 0.6]), 100, 500)
    assert scale == 100
    widths = np.diff(edges)
    assert np.allclose([edges[0], edges[-1]], [0, 500])
    assert np.allclose(widths, [97.333, 97.333, 208, 97.333], atol=0.01)
    assert np.allclose(np.diff(slots(np.full(14, 0.5), 100, 1200)[1]), 1200 / 14)
    scale, edges = slots(np.full(14, 9.0), 100, 1200)
    assert np.isclose(edges[-1], 1200), "too wide for any scale: they overlap, inside the picture"


# ---- player


def test_player_is_one_file_that_loads_nothing():
    page = player(takes(), PARENTS, 30, [Gap(30, 60)], names=NAMES, report="slide 3 cm")
    tags = Tags(page).all
    assert page.startswith("<!DOCTYPE html>")
    assert not {"link", "img", "iframe", "object", "embed", "base"} & {tag for tag, _ in tags}
    assert not any(key in ("src", "href", "srcset", "action") for _, attrs in tags for key in attrs)
    assert not re.search(r"https?:|//[a-z0-9-]+\.[a-z]|@import|url\(|\bfetch\(|XMLHttpRequest|import\(", page)
    policy = next(
        attrs["content"] for tag, attrs in tags if attrs.get("http-equiv") == "Content-Security-Policy"
    )
    assert "default-src 'none'" in policy


def test_player_controls_have_labels():
    tags = Tags(player(takes(), PARENTS, 30, [Gap(30, 60)])).all
    for tag, attrs in tags:
        if (tag == "button" and attrs["id"] != "reset") or tag == "select" or attrs.get("type") == "range":
            assert attrs.get("aria-label"), attrs


def test_positions_survive_within_a_millimetre_and_pages_are_small():
    rng = np.random.default_rng(0)
    motion = 300.0 * rng.random((300, 1, 3)) + rng.normal(0, 1, (300, 31, 3))
    motion[0, 5] += 40  # something far from the body
    two = [Take("a", motion, "#ff0000"), Take("b", motion[::-1], "#00ff00")]
    page = player(two, [-1, *range(30)], 30, [(100, 130)])
    assert len(page.encode()) < 1_000_000
    for packed, take in zip(data(page)["takes"], two):
        assert np.abs(decode(packed, 31) - take.positions).max() < 1e-3


def test_player_keeps_frame_numbers_of_an_excerpt():
    found = data(player(takes(), PARENTS, 30, [Gap(30, 60), Gap(70, 90)], span=(20, 50)))
    assert (found["first"], found["frames"], found["total"]) == (20, 30, 90)
    assert found["gaps"] == [{"start": 30, "stop": 50, "joints": None}]
    assert np.allclose(decode(found["takes"][0], len(PARENTS)), walk()[20:50], atol=1e-3)


def test_long_clips_are_cut_to_what_a_page_can_carry(monkeypatch):
    monkeypatch.setattr(sys.modules[player.__module__], "LARGEST", 2 * len(PARENTS) * 40)
    found = data(player(takes(), PARENTS, 30, [Gap(60, 70)]))
    assert found["frames"] == 40
    assert found["first"] <= 60
    assert found["first"] + 40 >= 70


def test_player_floor_and_feet():
    found = data(player(takes(), PARENTS, 30, [], names=NAMES))
    assert found["feet"] == [3, 6]
    assert found["head"] == 9
    assert abs(found["floor"] - 0.02) < 1e-3
    assert np.allclose(found["heading"], [0, 1], atol=1e-4)
    assert sorted(data(player(takes(), PARENTS, 30, []))["feet"]) == [3, 6], "without names: the lowest ends"


# ---- text from outside


def test_hostile_text_stays_text():
    names = [HOSTILE, *NAMES[1:]]
    hostile = [Take(HOSTILE, walk(), "#64748b")]
    svg = ET.fromstring(strip(hostile, PARENTS, 30, [(30, 60)], title=HOSTILE, names=names))
    kept = HOSTILE.replace("\x00", "")
    assert kept in [t.text for t in svg.iter(SVG + "text")]
    assert not list(svg.iter(SVG + "script"))

    page = player(hostile, PARENTS, 30, [(30, 60)], title=HOSTILE, report=HOSTILE, names=names)
    assert [tag for tag, _ in Tags(page).all].count("script") == 2
    assert page.count("alert(1)") == 6
    assert "<script>alert" not in page
    found = data(page)
    assert found["title"] == found["report"] == found["takes"][0]["name"] == found["names"][0] == HOSTILE

    plot = ET.fromstring(
        line_plot({HOSTILE: ([0, 1], [0, 1])}, HOSTILE, HOSTILE, HOSTILE, marks={HOSTILE: 0.5})
    )
    assert [t.text for t in plot.iter(SVG + "text")].count(kept) == 5
    boxes = ET.fromstring(
        box_plot({HOSTILE: [Box.of([1])]}, [HOSTILE], HOSTILE, HOSTILE, dots=(HOSTILE, [1]))
    )
    assert [t.text for t in boxes.iter(SVG + "text")].count(kept) == 4
    assert not list(boxes.iter(SVG + "script"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"takes": []}, "nothing to draw"),
        ({"parents": [-1]}, "positions are"),
        ({"names": ["a"]}, "names do not fit"),
        ({"fps": 0}, "frame rate"),
        ({"takes": [Take("x", np.full((4, 14, 3), np.nan), "#000000")]}, "no finite"),
        ({"takes": [Take("x", walk(), 'red"/><script>')]}, "no color"),
        ({"takes": [Take("x", walk(), "#000000"), Take("y", walk(5), "#000000")]}, "same F"),
        ({"span": (200, 300)}, "cannot draw the frames 200:300"),
    ],
)
@pytest.mark.parametrize("draw", [strip, player])
def test_what_does_not_fit_is_refused(draw, change, message):
    given = {"takes": takes(), "parents": PARENTS, "fps": 30, "gaps": [(30, 60)], "names": NAMES} | change
    with pytest.raises(RequestError, match=message):
        draw(**given)


# ---- the body


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("LeftArm", "RightArm"),
        ("lfemur", "rfemur"),
        ("LHipJoint", "RHipJoint"),
        ("thigh_l", "thigh_r"),
        ("Foot.L", "Foot.R"),
        ("mixamorig:LeftFoot", "mixamorig:RightFoot"),
        ("J_L_Toe", "J_R_Toe"),
    ],
)
def test_sides_by_name(left, right):
    names = ["root", "lowerback", left, right, "LowerBack"]
    assert figure.body(np.zeros((1, 5, 3)), [-1, 0, 0, 0, 0], names).sides == (0, 0, -1, 1, 0)


def test_motion_in_place_is_seen_from_where_the_hips_look():
    still = walk(speed=0.0)
    towards, travels = figure.heading(still, figure.body(still, PARENTS, NAMES), [])
    assert not travels
    assert np.allclose(towards, [0, 0, 1])


# ---- plots


def test_line_plot_has_every_line_and_places_values_right():
    svg = ET.fromstring(line_plot({"a": ([0, 10], [0, 4]), "b": ([0, 10], [1, 1])}, "x", "y", "t"))
    lines = [g for g in svg.iter(SVG + "g") if g.get("class") == "series"]
    assert [g.find(SVG + "title").text for g in lines] == ["a", "b"]
    points = [re.findall(r"[ML]([\d.]+) ([\d.]+)", g.find(SVG + "path").get("d")) for g in lines]
    (x0, y0), (x1, y4) = ((float(x), float(y)) for x, y in points[0])
    assert x0 < x1
    assert y0 > y4
    assert abs(float(points[1][0][1]) - (y0 + (y4 - y0) / 4)) < 0.2


def test_log_axis_is_even_in_ratios():
    svg = ET.fromstring(line_plot({"a": ([0, 1, 2, 3], [0.001, 0.1, 10.0, 0.0])}, "x", "y", "t", log=True))
    path = next(g for g in svg.iter(SVG + "g") if g.get("class") == "series").find(SVG + "path").get("d")
    ys = [float(y) for _, y in re.findall(r"[ML]([\d.]+) ([\d.]+)", path)]
    assert len(ys) == 3
    assert abs((ys[0] - ys[1]) - (ys[1] - ys[2])) < 0.2


def test_line_plot_interrupts_at_nan_thins_long_lines_and_takes_one_point(tmp_path):
    svg = line_plot({"a": ([0, 1, 2, 3], [1, np.nan, 2, 3])}, "x", "y", "t", tmp_path / "a.svg")
    assert (tmp_path / "a.svg").read_text(encoding="utf-8") == svg
    path = next(g for g in ET.fromstring(svg).iter(SVG + "g") if g.get("class") == "series").find(
        SVG + "path"
    )
    assert path.get("d").count("M") == 2
    assert len(line_plot({"a": (np.arange(100_000), np.ones(100_000))}, "x", "y", "t")) < 40_000
    ET.fromstring(line_plot({"a": ([1], [0])}, "x", "y", "t"))
    ET.fromstring(line_plot({"a": ([1], [5])}, "x", "y", "t", log=True))
    for series in ({}, {"a": ([], [])}, {"a": ([0, 1], [np.nan, np.inf])}, {"a": ([0, 1], [0])}):
        with pytest.raises(RequestError):
            line_plot(series, "x", "y", "t")


def test_a_box_is_quartiles_and_whiskers_without_outliers():
    box = Box.of([0, 1, 2, 3, 4, 5, 6, 7, 8, 30, np.nan])
    assert (box.lower, box.median, box.upper) == (2.25, 4.5, 6.75)
    assert (box.low, box.high) == (0, 8)
    assert Box.of([5.0]) == Box(5, 5, 5, 5, 5)
    with pytest.raises(RequestError, match="no finite value"):
        Box.of([np.inf])


def test_box_plot_places_values_right(tmp_path):
    series = {"a": [Box(0, 1, 2, 3, 4), Box(8, 8, 8, 8, 8)], "b": [Box(2, 2, 2, 2, 2)] * 2}
    text = box_plot(series, ["g\nh", "k"], "y", "t", tmp_path / "a.svg", dots=("truth", [2, 8]))
    assert (tmp_path / "a.svg").read_text(encoding="utf-8") == text
    svg = ET.fromstring(text)
    groups = {g.get("class") + g.find(SVG + "title").text: g for g in svg.iter(SVG + "g") if g.get("class")}
    assert list(groups) == ["seriesa", "seriesb", "dotstruth"]
    whiskers, median = (path.get("d") for path in groups["seriesa"].findall(SVG + "path")[:2])
    low, lower, upper, high = (
        float(y) for y in re.findall(r"^M\S+ (\S+)V(\S+)M\S+ (\S+)V([\d.]+)", whiskers)[0]
    )
    unit = (low - high) / 4
    assert unit > 0
    assert lower == pytest.approx(low - unit, abs=0.11)
    assert upper == pytest.approx(low - 3 * unit, abs=0.11)
    assert float(re.findall(r" ([\d.]+)h", median)[0]) == pytest.approx(low - 2 * unit, abs=0.11)
    heights = [float(dot.get("cy")) for dot in groups["dotstruth"].findall(SVG + "circle")]
    assert heights == pytest.approx([low - 2 * unit, low - 8 * unit], abs=0.21)
    left, right = (float(rect.get("x")) for rect in groups["seriesa"].findall(SVG + "rect"))
    beside = float(groups["seriesb"].find(SVG + "rect").get("x"))
    assert left < beside < right
    assert {"g", "h", "k", "truth"} <= {t.text for t in svg.iter(SVG + "text")}


def test_boxes_that_do_not_fit_their_groups_are_refused():
    one = Box.of([1])
    with pytest.raises(RequestError, match="1 values in 2 groups"):
        box_plot({"a": [one]}, ["g", "h"], "y", "t")
    with pytest.raises(RequestError, match="'truth'"):
        box_plot({"a": [one]}, ["g"], "y", "t", dots=("truth", []))
    with pytest.raises(RequestError, match="nothing to draw"):
        box_plot({}, ["g"], "y", "t")


# ---- in a browser, where there is one

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

PROBE = """<script>
const p = window.interposePlayer, key = k => dispatchEvent(new KeyboardEvent("keydown", { key: k }));
const out = { opened: p.frame, playing: p.playing, takes: p.takes.map(t => t.name) };
p.seek(45); out.sought = p.frame; out.badge = document.getElementById("badge").textContent;
key("ArrowRight"); out.stepped = p.frame;
key("End"); out.end = p.frame; key("g"); out.gap = p.frame;
key("2"); out.hidden = p.takes.map(t => t.visible); key("2");
for (const k of "tfal") key(k);
out.options = p.options; key(" "); out.played = p.playing; p.pause();
out.at = p.positions(1, 45);
const area = document.createElement("textarea");
area.id = "out"; area.textContent = JSON.stringify(out);
document.body.append(area);
</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine")
def test_player_in_a_browser(tmp_path):
    page = player(takes(), PARENTS, 30, [Gap(30, 60)], names=NAMES, title=HOSTILE, report="r")
    (tmp_path / "page.html").write_text(page.replace("</body>", PROBE), encoding="utf-8")
    options = ["--headless", "--no-sandbox"]
    options += ["--disable-gpu", "--disable-sync", "--disable-background-networking"]
    options += ["--disable-component-update", "--virtual-time-budget=500", "--dump-dom"]
    options += [f"--user-data-dir={tmp_path / 'profile'}"]
    try:
        done = subprocess.run(
            [BROWSER, *options, f"file://{tmp_path / 'page.html'}#frame=12"],
            capture_output=True, text=True, timeout=60,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        pytest.skip("the browser does not start here")
    if "<canvas" not in done.stdout:
        pytest.skip("the browser does not start here")
    out = json.loads(re.search(r'<textarea id="out">(.*?)</textarea>', done.stdout, re.S)[1])
    assert (out["opened"], out["playing"], out["takes"]) == (12, False, ["truth", "filled"])
    assert (out["sought"], out["stepped"], out["end"], out["gap"]) == (45, 46, 89, 30)
    assert out["badge"] == "gap 30:60, frame 16 of 30"
    assert out["hidden"] == [True, False]
    assert out["played"] is True
    assert out["options"] == {"follow": False, "trails": True, "apart": True, "loop": True, "speed": 1}
    assert np.abs(np.array(out["at"]).reshape(-1, 3) - takes()[1].positions[45]).max() < 1e-3


@pytest.mark.parametrize("tall", [0.5, 20.0])
def test_a_map_has_one_scale(tall):
    turn = np.linspace(0, 2 * np.pi, 40)
    svg = line_plot({"way": (5 + np.cos(turn), 3 + tall * np.sin(turn))}, "x", "z", "A way", alike=True)
    (shape,) = re.findall(r'd="([^"]+)"', svg)
    points = np.array([[float(v) for v in point.split()] for point in re.split("[ML]", shape)[1:]])
    across, down = np.ptp(points, axis=0)
    assert down / across == pytest.approx(tall, rel=0.02)
    assert (points.min(axis=0) > 0).all()
    assert (points.max(axis=0) < [760, 460]).all()
