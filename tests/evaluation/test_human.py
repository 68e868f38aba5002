"""Surveys keep their secret, votes are counted as in the paper's table, and no figure comes from nowhere."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from interpose import formats
from interpose.cli import main
from interpose.errors import FileError, RequestError
from interpose.evaluation.human import Votes, read_key, read_votes, survey, tally
from interpose.show.player import decode
from interpose.skeletons import find_humanoid
from interpose.skeletons.body import facing

# Frames of the clips, by which the tests know them.
LENGTHS = {"real/anna": 31, "real/berta": 32, "real/carla": 33, "gan/anna": 41, "gan/dora": 42, "mean/e": 43}


@pytest.fixture(scope="module")
def folder(cmu_walk, tmp_path_factory):  # type: ignore[no-untyped-def]
    """A folder with clips of the names and lengths above."""
    top = tmp_path_factory.mktemp("clips")
    for start, (name, length) in enumerate(LENGTHS.items()):
        (top / name).parent.mkdir(exist_ok=True)
        formats.save(cmu_walk.slice(20 * start, 20 * start + length), top / f"{name}.npz")
    (top / "real" / "notes.txt").write_text("no clip")
    return top


@pytest.fixture(scope="module")
def made(folder):  # type: ignore[no-untyped-def]
    return survey(folder / "real", [folder / "gan", folder / "mean"])


def data_of(page: str):  # type: ignore[no-untyped-def]
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S)[1])


def clips_of(page: str):  # type: ignore[no-untyped-def]
    return [data_of(one) for one in data_of(page)["pages"]]


def test_the_page_shows_what_the_key_says_and_tells_nothing(folder, made):
    shown = [clip["frames"] for clip in clips_of(made.page)]
    listed = [clip["file"].removeprefix(f"{folder}/").removesuffix(".npz") for clip in made.key["clips"]]
    assert [LENGTHS[name] for name in listed] == shown
    assert {clip["model"] for clip in made.key["clips"]} == {"recorded", "gan", "mean"}
    assert [clip["clip"] for clip in made.key["clips"]] == [1, 2, 3, 4, 5, 6]
    for secret in ("anna", "berta", "carla", "dora", "gan/", ".npz", str(folder), '"mean"'):
        assert secret not in made.page
    assert {clip["title"] for clip in clips_of(made.page)} == {f"clip {n}" for n in range(1, 7)}
    assert {take["name"] for clip in clips_of(made.page) for take in clip["takes"]} == {"motion"}
    assert [note.split(":")[0] for note in made.notes] == ["recorded and generated clips differ in length"]


def test_the_seed_is_the_order(folder, made):
    folders = folder / "real", [folder / "gan", folder / "mean"]
    assert survey(*folders, seed=0) == made
    other = survey(*folders, seed=1)
    assert [c["file"] for c in other.key["clips"]] != [c["file"] for c in made.key["clips"]]
    assert other.key["survey"] != made.key["survey"], "votes on one order are none on another"
    assert [c["file"] for c in made.key["clips"]] != sorted(c["file"] for c in made.key["clips"])


def test_relative_clips_stay_in_place_and_face_one_way(folder, made, cmu_walk):
    relative = survey(folder / "real", [folder / "gan"], relative=True)
    assert (made.key["motion"], relative.key["motion"]) == ("absolute", "relative")
    body = find_humanoid(cmu_walk)
    for listed, clip in zip(relative.key["clips"], clips_of(relative.page)):
        points = decode(clip["takes"][0], len(clip["parents"]))
        hips = points[:, body.mapping["Hips"]]
        assert np.ptp(hips, axis=0).max() < 1e-3
        assert 0.5 < hips[0, 1] < 1.2
        canonical = np.einsum("cj,fjx->fcx", body.mapping.weights, points)
        assert np.abs(facing(canonical)).max() < 0.01
        # Poses are as they were.
        own = formats.load(listed["file"]).positions()
        apart = [np.linalg.norm(p[:, 5] - p[:, 10], axis=-1) for p in (points, own)]
        np.testing.assert_allclose(*apart, atol=1e-3)


def test_folders_that_cannot_be_used(folder, tmp_path):
    for real, generated, error, text in (
        (tmp_path / "none", [folder / "gan"], FileError, "there is no such folder"),
        (tmp_path, [folder / "gan"], FileError, "it has no file of .bvh"),
        (folder / "real", [folder / "gan", folder / "gan"], RequestError, "would be called gan"),
    ):
        with pytest.raises(error, match=text) as caught:
            survey(real, generated)
        assert caught.value.fix


# ---- votes

MODELS = ("recorded", "gan", "gan", "recorded", "nogan", "gan", "gan")
KEY = {
    "survey": "s",
    "motion": "absolute",
    "clips": [{"clip": number, "model": model} for number, model in enumerate(MODELS, 1)],
}


def says(person: str, answers: str) -> Votes:
    """Answers to clips 1, 2, ...: r recorded, g generated, - none."""
    words = {"r": "recorded", "g": "generated"}
    return Votes(person, person, {n: words[a] for n, a in enumerate(answers, 1) if a in words})  # type: ignore[arg-type]


def test_votes_are_counted_by_person():
    result = tally(KEY, [says("a", "rrgrgrr"), says("b", "rggggrg"), says("c", "grrr---")])
    rows = {row.model: row for row in result.rows}
    assert list(rows) == ["recorded", "gan", "nogan"]
    # Of gan's clips 2, 3, 6 and 7 a takes three of four for recorded, b one of four, c two of two.
    gan = rows["gan"]
    assert (gan.least, gan.mean, gan.most) == pytest.approx((25, 200 / 3, 100))
    assert (gan.persons, gan.clips, gan.answers) == (3, 4, 10)
    # Clips 1 and 4: a both, b and c one.
    assert (rows["recorded"].least, rows["recorded"].mean, rows["recorded"].most) == pytest.approx(
        (50, 200 / 3, 100)
    )
    # c said nothing about the only clip of nogan.
    assert (rows["nogan"].most, rows["nogan"].persons, rows["nogan"].answers) == (0, 2, 2)
    assert "| gan | absolute | 25.00 % | 66.67 % | 100.00 % | 3 | 4 | 10 |" in str(result)
    assert result.to_dict()["rows"][1]["mean"] == pytest.approx(200 / 3)


def test_nobody_counts_twice_and_nothing_counts_as_nothing():
    with pytest.raises(RequestError, match="of the same person"):
        tally(KEY, [says("a", "rrr"), says("b", "r"), says("a", "ggg")])
    with pytest.raises(RequestError, match="nobody but people"):
        tally(KEY, [])


GOOD = {"survey": "s", "person": "p", "name": "", "votes": {"1": "recorded", "2": "generated"}}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (json.dumps(GOOD)[:-9], "damaged"),
        ("", "damaged"),
        ("[" * 100_000, "damaged"),
        ("\x00\xff", "damaged"),
        ("[1]", "no votes file"),
        (json.dumps(GOOD | {"survey": "t"}), "another survey"),
        (json.dumps(GOOD | {"votes": {}}), "nobody has answered"),
        (json.dumps(GOOD | {"votes": ["recorded"]}), "nobody has answered"),
        (json.dumps(GOOD | {"person": ["p"]}), "nobody has answered"),
        (json.dumps(GOOD | {"votes": {"8": "recorded"}}), "clip 8 is recorded, which is no answer"),
        (json.dumps(GOOD | {"votes": {"1": "real" * 9}}), "clip 1 is realrealrealrealreal, which"),
        (json.dumps(GOOD | {"votes": {"1": {"a": 1}}}), "no answer"),
    ],
)
def test_votes_that_cannot_be_counted(tmp_path, text, why):
    path = tmp_path / "votes.json"
    path.write_bytes(text.encode("latin1"))
    with pytest.raises(FileError) as error:
        read_votes(path, KEY)
    assert why in error.value.why
    assert error.value.fix
    path.write_text(json.dumps(GOOD))
    assert read_votes(path, KEY).answers == {1: "recorded", 2: "generated"}


@pytest.mark.parametrize("key", [{}, [], KEY | {"clips": []}, KEY | {"clips": [{"clip": "1", "model": "a"}]}])
def test_keys_that_are_none(tmp_path, key):
    (tmp_path / "key.json").write_text(json.dumps(key))
    with pytest.raises(FileError, match="does not say what each clip is"):
        read_key(tmp_path / "key.json")


# ---- the command


def test_the_command_makes_and_counts(folder, tmp_path, capsys):
    place = str(tmp_path / "survey")
    make = ["bench", "human", "--real", str(folder / "real"), "--generated", str(folder / "gan")]
    make += ["--survey", place]
    assert main(make) == 0
    made = {path.name: path.read_bytes() for path in (tmp_path / "survey").iterdir()}
    assert set(made) == {"index.html", "key.json"}
    capsys.readouterr()
    assert main([*make, "--seed", "1"]) == 2
    assert capsys.readouterr().err.count("\n") == 3
    assert made == {path.name: path.read_bytes() for path in (tmp_path / "survey").iterdir()}
    assert main([*make, "--seed", "1", "--force"]) == 0
    key = json.loads((tmp_path / "survey" / "key.json").read_text())
    votes = {str(clip["clip"]): "recorded" for clip in key["clips"]}
    (tmp_path / "a.json").write_text(json.dumps({"survey": key["survey"], "person": "a", "votes": votes}))
    capsys.readouterr()
    assert main(["bench", "human", "--survey", place, "--votes", str(tmp_path / "a.json"), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["model"], row["mean"], row["clips"]) for row in rows] == [
        ("recorded", 100, 3),
        ("gan", 100, 2),
    ]


def test_no_figure_without_votes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for tokens in ([], ["--real", "."], ["--real", ".", "--generated", ".", "--votes", "a.json"]):
        assert main(["bench", "human", *tokens]) == 2
        caught = capsys.readouterr()
        assert not caught.out
        assert caught.err.count("\n") == 3
    assert not list(tmp_path.iterdir())


# ---- in a browser, where there is one

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

PROBE = """<script>
(async () => {
  const b = interposeBallot, frame = document.getElementById("clip"), out = {};
  const wait = ms => new Promise(done => setTimeout(done, ms));
  document.getElementById("start").click(); await wait(300);
  out.frames = frame.contentWindow.interposePlayer.frames;
  document.getElementById("recorded").click(); await wait(600);
  out.second = b.at;
  frame.contentWindow.dispatchEvent(new KeyboardEvent("keydown", { key: "2" })); await wait(600);
  out.third = b.at; out.visible = frame.contentWindow.interposePlayer.takes[0].visible;
  document.getElementById("back").click(); document.getElementById("recorded").click(); await wait(600);
  for (let n = b.at; n <= b.clips; n++) { b.answer("generated"); await wait(600); }
  out.words = document.getElementById("thanks").textContent;
  document.getElementById("name").value = "</textarea>"; b.save();
  out.file = b.file();
  const area = document.createElement("textarea");
  area.id = "out"; area.textContent = JSON.stringify(out).replace(/</g, "\\\\u003c");
  document.body.append(area);
})();
</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine")
def test_a_person_votes(made, tmp_path):
    (tmp_path / "page.html").write_text(made.page.replace("</body>\n", PROBE), encoding="utf-8")
    options = ["--headless", "--no-sandbox"]
    options += ["--disable-gpu", "--disable-sync", "--disable-background-networking"]
    options += ["--disable-component-update", "--dump-dom", f"--user-data-dir={tmp_path / 'profile'}"]
    said = None
    for patience in (8000, 60_000):  # milliseconds of the page's own clock: busy machines need more
        try:
            done = subprocess.run(
                [BROWSER, *options, f"--virtual-time-budget={patience}", f"file://{tmp_path / 'page.html'}"],
                capture_output=True,
                text=True,
                timeout=60,
            )
        except subprocess.TimeoutExpired:
            pytest.skip("the browser does not start here")
        if "<iframe" not in done.stdout:
            pytest.skip("the browser does not start here")
        said = re.search(r'<textarea id="out">(.*?)</textarea>', done.stdout, re.S)
        if said:
            break
    assert said, "the page's script has not come to its end"
    out = json.loads(said[1])
    assert out["frames"] == clips_of(made.page)[0]["frames"]
    assert (out["second"], out["third"], out["visible"]) == (2, 3, True)
    assert out["words"] == "That was all. Thank you!"
    (tmp_path / "votes.json").write_text(out["file"])
    votes = read_votes(tmp_path / "votes.json", made.key)
    assert votes.answers == {1: "recorded", 2: "recorded", **dict.fromkeys(range(3, 7), "generated")}
