"""A file is there whole or not at all, whatever ends the program that writes it."""

import errno
import os
import resource
import signal
import subprocess
import sys

import pytest

from impostor.errors import OutputError
from impostor.files import output
from impostor.files.output import atomic_output, check_output

WRITER = """
import sys, time
from impostor.files.output import atomic_output
with atomic_output(sys.argv[1], force=True) as temporary:
    temporary.write_bytes(b"half of ")
    print("ready", flush=True)
    time.sleep(60)
"""


def start_writer(path):
    """A process that has written half of an output and waits."""
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    assert writer.stdout.readline() == "ready\n"
    return writer


def end(writer):
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    writer.stdout.close()


def test_the_file_appears_whole_when_the_block_ends(tmp_path):
    with atomic_output(tmp_path / "a.png") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".png"
        temporary.write_bytes(b"all")
        assert not (tmp_path / "a.png").exists()
    assert (tmp_path / "a.png").read_bytes() == b"all"
    assert os.listdir(tmp_path) == ["a.png"]


def test_a_relative_path_and_a_link_are_followed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "real").mkdir()
    (tmp_path / "link.txt").symlink_to("real/file.txt")
    with atomic_output("link.txt") as temporary:
        temporary.write_bytes(b"x")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real" / "file.txt").read_bytes() == b"x"


def test_permissions_are_those_of_any_new_file(tmp_path):
    with atomic_output(tmp_path / "a") as temporary:
        temporary.write_bytes(b"x")
    (tmp_path / "b").write_bytes(b"x")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


@pytest.mark.parametrize("exception", [ValueError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("force", [False, True])
def test_nothing_is_left_when_the_block_fails(tmp_path, exception, force):
    (tmp_path / "other").write_bytes(b"other")
    if force:
        (tmp_path / "a.fan").write_bytes(b"old")
    with pytest.raises(exception), atomic_output(tmp_path / "a.fan", force) as temporary:
        temporary.write_bytes(b"half of ")
        raise exception
    assert sorted(os.listdir(tmp_path)) == (["a.fan", "other"] if force else ["other"])
    assert not force or (tmp_path / "a.fan").read_bytes() == b"old"


def test_an_existing_file_is_replaced_only_with_force(tmp_path):
    (tmp_path / "a.fan").write_bytes(b"old")
    with pytest.raises(OutputError, match="exists already"), atomic_output(tmp_path / "a.fan"):
        pytest.fail("the block must not run")
    assert (tmp_path / "a.fan").read_bytes() == b"old"
    with atomic_output(tmp_path / "a.fan", force=True) as temporary:
        temporary.write_bytes(b"new")
    assert (tmp_path / "a.fan").read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["a.fan"]


@pytest.mark.parametrize("hard_links", [True, False])
def test_a_file_that_appears_meanwhile_is_kept(tmp_path, monkeypatch, hard_links):
    def link(*_):
        raise PermissionError(errno.EPERM, "no hard links here")

    if not hard_links:
        monkeypatch.setattr(os, "link", link)
    with (
        pytest.raises(OutputError, match="appeared while it was being written"),
        atomic_output(tmp_path / "a.fan") as temporary,
    ):
        temporary.write_bytes(b"mine")
        (tmp_path / "a.fan").write_bytes(b"theirs")
    assert (tmp_path / "a.fan").read_bytes() == b"theirs"
    assert os.listdir(tmp_path) == ["a.fan"]
    with atomic_output(tmp_path / "b.fan") as temporary:
        temporary.write_bytes(b"mine")
    assert (tmp_path / "b.fan").read_bytes() == b"mine"


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_bytes(b"")
    for path, words in (
        (tmp_path, "is a directory"),
        (tmp_path / "none" / "a.fan", "does not exist"),
        (tmp_path / "file" / "a.fan", "does not exist"),
        (tmp_path / "file", "exists already"),
        ("/dev/null", "not an ordinary file"),
    ):
        with pytest.raises(OutputError, match=words) as caught:
            check_output(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)
    with pytest.raises(OutputError, match="not an ordinary file"):
        check_output("/dev/null", force=True)
    monkeypatch.setattr(os, "access", lambda *_: False)  # the tests may run as root, who may write anywhere
    with pytest.raises(OutputError, match="cannot be written"):
        check_output(tmp_path / "a.fan")
    assert os.listdir(tmp_path) == ["file"]


def test_a_full_disk_is_one_line(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, before[1]))
    try:
        with (
            pytest.raises(OutputError, match="cannot be written: File too large"),
            atomic_output(tmp_path / "a.fan") as temporary,
        ):
            temporary.write_bytes(bytes(1 << 20))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert os.listdir(tmp_path) == []


def test_an_error_of_the_block_itself_is_not_hidden(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_output(tmp_path / "a.fan"):
        (tmp_path / "texture.png").read_bytes()
    assert os.listdir(tmp_path) == []


def test_a_name_too_long_is_one_line(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"), atomic_output(tmp_path / ("n" * 250)):
        pytest.fail("the block must not run")


def test_a_killed_writer_leaves_no_output_and_the_next_one_cleans_up(tmp_path):
    path = tmp_path / "a.fan"
    end(start_writer(path))
    assert not path.exists()
    litter = os.listdir(tmp_path)
    assert len(litter) == 1
    (tmp_path / f"{litter[0]}.old").write_bytes(b"of another name")
    (tmp_path / ".impostor-12.b.fan").write_bytes(b"of another output")
    with atomic_output(path) as temporary:
        assert litter[0] not in os.listdir(tmp_path)
        temporary.write_bytes(b"all")
    assert path.read_bytes() == b"all"
    assert sorted(os.listdir(tmp_path)) == sorted([".impostor-12.b.fan", f"{litter[0]}.old", "a.fan"])


def test_litter_with_this_process_number_is_cleaned_up(tmp_path):
    (tmp_path / f".impostor-{os.getpid()}.a.fan").write_bytes(b"of a process that had this number before")
    with atomic_output(tmp_path / "a.fan") as temporary:
        temporary.write_bytes(b"all")
    assert os.listdir(tmp_path) == ["a.fan"]


def test_a_living_writer_is_left_alone(tmp_path):
    path = tmp_path / "a.fan"
    writer = start_writer(path)
    try:
        held = os.listdir(tmp_path)
        with atomic_output(path) as temporary:
            temporary.write_bytes(b"all")
        assert sorted(os.listdir(tmp_path)) == sorted([*held, "a.fan"])
    finally:
        end(writer)


@pytest.mark.parametrize(("force", "publishing"), [(False, "link"), (True, "replace")])
def test_a_finished_file_is_held_until_it_has_its_name(tmp_path, monkeypatch, force, publishing):
    """Another writer that cleans up at that very moment takes nothing away."""

    published = getattr(os, publishing)

    def publish(source, destination):
        output._remove_litter(tmp_path / "a.fan")
        published(source, destination)

    monkeypatch.setattr(os, publishing, publish)
    with atomic_output(tmp_path / "a.fan", force) as temporary:
        temporary.write_bytes(b"all")
    assert (tmp_path / "a.fan").read_bytes() == b"all"
    assert os.listdir(tmp_path) == ["a.fan"]


def test_one_process_cannot_write_one_output_twice_at_once(tmp_path):
    with atomic_output(tmp_path / "a.fan") as temporary:
        temporary.write_bytes(b"first")
        with (
            pytest.raises(OutputError, match="expected no other writer"),
            atomic_output(tmp_path / "a.fan"),
        ):
            pytest.fail("the block must not run")
    assert (tmp_path / "a.fan").read_bytes() == b"first"


def test_without_locks_files_are_still_written(tmp_path, monkeypatch):
    monkeypatch.setattr(output, "fcntl", None)
    with atomic_output(tmp_path / "a.fan") as temporary:
        temporary.write_bytes(b"all")
    assert (tmp_path / "a.fan").read_bytes() == b"all"
