"""interpose's own arrays: exact, small, and safe to open."""

from __future__ import annotations

import contextlib
import io
from dataclasses import replace
from zipfile import ZipFile

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip, Skeleton
from interpose.errors import FileError, RequestError


def some_clip():
    rng = np.random.default_rng(1)
    rests = rng.standard_normal((3, 4))
    skeleton = Skeleton(
        ("Wurzel", "Häňd", "c"),
        (-1, 0, 1),
        rng.standard_normal((3, 3)),
        rests / np.linalg.norm(rests, axis=-1, keepdims=True),
        np.array([1, 2, 3.0]),
    )
    turned = rng.standard_normal((5, 3, 4))
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    return Clip(skeleton, turned, rng.standard_normal((5, 2, 3)), 29.97, (0, 2))


def test_exact(tmp_path):
    clip = some_clip()
    formats.save(clip, tmp_path / "a.npz")
    again = formats.load(tmp_path / "a.npz")
    assert (again.skeleton.names, again.skeleton.parents) == (clip.skeleton.names, clip.skeleton.parents)
    assert (again.fps, again.translated, again.name) == (29.97, (0, 2), "a")
    for name in ("rest_translation", "rest_rotation", "rest_scale"):
        np.testing.assert_array_equal(getattr(again.skeleton, name), getattr(clip.skeleton, name))
    np.testing.assert_array_equal(again.rotation, clip.rotation)
    np.testing.assert_array_equal(again.translation, clip.translation)
    formats.save(again, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@pytest.mark.parametrize("name", ["a.npz", "a.bvh", "a.amc"])
def test_clips_without_frames_are_not_written(tmp_path, name):
    with pytest.raises(RequestError, match="the clip has no frames") as error:
        formats.save(some_clip().slice(0, 0), tmp_path / name)
    assert len(str(error.value).splitlines()) == 3
    assert not list(tmp_path.iterdir())


def test_bvh_to_npz_and_back(cmu_walk, tmp_path):
    formats.save(cmu_walk, tmp_path / "a.npz")
    formats.save(formats.load(tmp_path / "a.npz"), tmp_path / "b.bvh")
    again = formats.load(tmp_path / "b.bvh")
    np.testing.assert_allclose(again.positions(), cmu_walk.positions(), atol=1e-6)


@pytest.mark.parametrize(
    "change",
    [
        {"rotation": np.full((5, 3, 4), np.nan)},
        {"rotation": np.zeros((5, 2, 4))},
        {"rotation": np.zeros((0, 3, 4)), "translation": np.zeros((0, 2, 3))},
        {"rotation": np.array([{"a": 1}], dtype=object)},
        {"rest_scale": np.full(3, np.nan)},
        {"rest_translation": np.zeros((2, 3))},
        {"names": np.array(["a", "a", "b"])},
        {"parents": np.array([-1, 2, 1])},
        {"translated": np.array([2])},
        {"translated": np.array([0, 7])},
        {"fps": np.array(0.0)},
        {"fps": np.array([1.0, 2.0])},
        {"version": np.array(99)},
        {"fps": np.array(True)},
        {"parents": np.array([-1.0, 0.0, 1.0])},
        {"names": np.arange(3)},
        {"translated": np.array([0, 0])},
        {"rotation": np.ones((5, 3, 4), complex)},
        {"translation": np.full((5, 2, 3), 1e150)},
        {"rest_translation": np.full((3, 3), 1e30)},
        {"rest_scale": np.full(3, 1e300)},
        {"rest_rotation": np.zeros((3, 4))},
    ],
)
def test_contradictions(tmp_path, change):
    formats.save(some_clip(), tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "b.npz", **(arrays | change))
    with pytest.raises(FileError) as caught:
        formats.load(tmp_path / "b.npz")
    assert caught.value.why
    assert caught.value.fix


@pytest.mark.parametrize(
    ("name", "kind", "shape"), [("rotation", "<f8", (10**9, 25, 4)), ("names", "<U50", (3 * 10**9,))]
)
def test_more_than_memory_holds_is_not_believed(tmp_path, name, kind, shape):
    """A file of some kilobytes says that an array has hundreds of gigabytes."""
    formats.save(some_clip(), tmp_path / "a.npz")
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": kind, "fortran_order": False, "shape": shape})
    with ZipFile(tmp_path / "a.npz") as old, ZipFile(tmp_path / "b.npz", "w") as new:
        for part in old.namelist():
            new.writestr(part, header.getvalue() if part == f"{name}.npy" else old.read(part))
    with pytest.raises(FileError, match="memory"):
        formats.load(tmp_path / "b.npz")


def test_damaged(tmp_path):
    path = tmp_path / "a.npz"
    formats.save(some_clip(), path)
    whole = path.read_bytes()
    rng = np.random.default_rng(2)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileError):
        formats.load(path)
    for text in (b"", b"PK\x03\x04 no", b"HIERARCHY\n"):
        path.write_bytes(text)
        with pytest.raises(FileError):
            formats.load(path)
    for _ in range(100):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 3):
            damaged[place] = rng.integers(256)
        path.write_bytes(bytes(damaged))
        with contextlib.suppress(FileError):
            assert len(formats.load(path)) > 0
    np.savez(path, rotation=np.zeros(3))
    with pytest.raises(FileError, match="no array"):
        formats.load(path)


def test_options_are_not_for_npz(tmp_path):
    formats.save(some_clip(), tmp_path / "a.npz")
    with pytest.raises(RequestError, match="unit"):
        formats.load(tmp_path / "a.npz", unit="cm")


def test_what_somebody_said_of_joints_is_kept(tmp_path):
    clip = some_clip()
    said = {"hand": "left", "Hips": clip.skeleton.names[0]}
    formats.save(replace(clip, skeleton=replace(clip.skeleton, roles=said)), tmp_path / "a.npz")
    assert formats.load(tmp_path / "a.npz").skeleton.roles == said
    assert formats.load(tmp_path / "a.npz", roles={"hand": "right"}).skeleton.roles == {"hand": "right"}


def test_what_is_too_far_to_be_read_again_is_not_written(tmp_path):
    clip = some_clip()
    with pytest.raises(RequestError, match="cannot write this motion"):
        formats.save(clip.with_motion(clip.rotation, clip.translation + 1e10), tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())
