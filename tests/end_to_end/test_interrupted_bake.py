"""A bake that is stopped leaves no fan, whole or half, and nothing that the next bake does not clean away."""

import contextlib
import os
import signal
import subprocess
import sys

import pytest

from impostor.files.fan_file import validate_fan
from tests.data import SAMPLES
from tests.end_to_end.commands import SMALL, run

KNOT = SAMPLES / "knot.stl"
# The command, which says when it has baked the third view and when it has written a file that has no name yet.
STOPPED = """
import ctypes, sys, time
import bake.fan
import impostor.files.fan_file as fan_file
from impostor.cli import main

place = sys.argv.pop(1)

def stop_at(name):
    if name == place:
        print("ready", flush=True)
        time.sleep(60)

# An argument whose conversion takes long: what is raised in it becomes an error of ctypes, as in PyOpenGL.
class Converted:
    @classmethod
    def from_param(cls, value):
        stop_at("converting")

call = ctypes.CDLL(None).abs
call.argtypes = [Converted]

def bake_fan(*arguments, bake_fan=bake.fan.bake_fan, **options):
    def progress(done, total, progress=options["progress"]):
        if done == 3:
            stop_at("baking")
        progress(done, total)

    if place == "converting":
        call(None)
    try:
        stop_at("swallowing")
    except:  # as libraries do that look for other libraries
        pass
    return bake_fan(*arguments, **{**options, "progress": progress})

def write_archive(*arguments, write_archive=fan_file.write_archive):
    write_archive(*arguments)
    stop_at("writing")

bake.fan.bake_fan, fan_file.write_archive = bake_fan, write_archive
sys.exit(main())
"""


@contextlib.contextmanager
def stopped_bake(folder, place, *flags):
    """A process that bakes `a.fan` and waits at a place."""
    command = [sys.executable, "-c", STOPPED, place, "bake", KNOT, "-o", folder / "a.fan", *SMALL, *flags]
    with subprocess.Popen(
        [str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        yield process


@pytest.mark.parametrize("place", ["baking", "writing"])
def test_a_killed_bake_leaves_no_fan_and_the_next_cleans_up(tmp_path, place):
    with stopped_bake(tmp_path, place) as process:
        process.kill()
    assert process.returncode == -signal.SIGKILL
    left = os.listdir(tmp_path)
    assert "a.fan" not in left
    assert all(name.startswith(".impostor-") for name in left)
    assert len(left) == (place == "writing")
    assert run("bake", KNOT, "-o", tmp_path / "a.fan", *SMALL) == 0
    assert os.listdir(tmp_path) == ["a.fan"]
    assert validate_fan(tmp_path / "a.fan") == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("place", ["baking", "writing", "converting", "swallowing"])
def test_ctrl_c_or_kill_is_one_line_and_leaves_nothing(tmp_path, place, number):
    with stopped_bake(tmp_path, place) as process:
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (128 + number, "", "impostor: stopped\n")
    assert os.listdir(tmp_path) == []


def test_a_killed_bake_with_force_keeps_the_old_fan(tmp_path):
    assert run("bake", KNOT, "-o", tmp_path / "a.fan", "--views", 2, "--size", 16, "--quiet") == 0
    old = (tmp_path / "a.fan").read_bytes()
    with stopped_bake(tmp_path, "writing", "--force") as process:
        process.kill()
    assert (tmp_path / "a.fan").read_bytes() == old


def test_a_bake_does_not_take_away_what_another_is_writing(tmp_path, capfd):
    with stopped_bake(tmp_path, "writing") as process:
        assert run("bake", KNOT, "-o", tmp_path / "a.fan", *SMALL) == 0
        assert len(os.listdir(tmp_path)) == 2
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert os.listdir(tmp_path) == ["a.fan"]
    assert capfd.readouterr().err == ""
