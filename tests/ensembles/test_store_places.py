"""Stores of ensembles where nothing can be written: told before the first case, with the cause and what mends it."""

import errno
import os
import sys

import pytest

import tsdyn as ts
from examples import top
from tests.helpers.refusals import refuse
from tsdyn.files.formats import format_of

TABLE = {"top.mass": [20.0, 30.0, 40.0]}
SUFFIXES = pytest.mark.parametrize("suffix", ["h5", "zarr"])


def study(path, **options):
    return ts.ensemble(top.build(), TABLE, (0.0, 0.02), store=path, **options)


def refused(path, words, **options):
    """A store that is refused before a case is run, by a message with these words that doesn't speak of space."""
    seen = []
    with pytest.raises(ts.StorageError) as caught:
        study(path, progress=seen.append, **options)
    assert not seen
    assert not [word for word in words if word not in str(caught.value)], caught.value
    assert "space" not in str(caught.value)


@SUFFIXES
def test_no_such_folder(suffix, tmp_path):
    refused(tmp_path / "none" / f"study.{suffix}", (f"no folder {tmp_path / 'none'}", "Make it, or take another path"))


@SUFFIXES
def test_a_file_in_the_way(suffix, tmp_path):
    (tmp_path / "notes").write_text("x")
    for path in (tmp_path / "notes" / f"study.{suffix}", tmp_path / "notes" / "more" / f"study.{suffix}"):
        refused(path, (f"{tmp_path / 'notes'} is a file", "Take another path"))


@SUFFIXES
def test_a_name_that_is_too_long(suffix, tmp_path):
    refused(tmp_path / f"{'x' * 300}.{suffix}", ("name too long", "Take a shorter name"))


@SUFFIXES
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a folder that not even root writes to")
def test_a_folder_in_which_no_file_can_be_made(suffix):
    refused(f"/proc/study.{suffix}", ("no file can be made in /proc", "Take another path"))


@SUFFIXES
@pytest.mark.parametrize("code", [errno.EACCES, errno.EROFS])
def test_a_folder_without_permission(code, suffix, tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("tempfile.NamedTemporaryFile", fail)
    refused(tmp_path / f"study.{suffix}", (f"folder {tmp_path} can't be written to", "change the permissions"))


@pytest.mark.parametrize(("code", "words"), [
    (errno.ENOSPC, ("No space left", "Free space there, and go on: resume=True")),
    (errno.EIO, ("Input/output error", "Mend that, and go on: resume=True")),
], ids=["full", "broken"])  # fmt: skip
def test_what_happens_later(code, words, tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(format_of("study.h5").Store, "write", fail)
    refuse(lambda: study(tmp_path / "study.h5"), ts.StorageError, words)


def test_a_folder_by_the_name_of_a_file(tmp_path):
    (tmp_path / "study.h5").mkdir()
    refused(tmp_path / "study.h5", ("study.h5 exists",))
    refused(tmp_path / "study.h5", ("can't be read: it is a folder, not a regular file.",), resume=True)


def test_no_path_at_all():
    refuse(lambda: study(""), ts.InvalidArgument, ("store must end in .zarr", "got ''"))
    refuse(lambda: study("a\0.h5"), ts.InvalidArgument, ("store must be a path",))


def test_a_store_that_is_complete_is_read_where_nothing_can_be_written(tmp_path, monkeypatch):
    path = tmp_path / "study.h5"
    study(path)

    def fail(*arguments, **options):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("tempfile.NamedTemporaryFile", fail)
    assert study(path, resume=True).success.all()
