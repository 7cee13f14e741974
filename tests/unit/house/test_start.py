"""The first second of a command: what it need not import it does not, and Ctrl-C is one line."""

import os
import signal
import subprocess
import sys

import pytest

import impostor
import runtime
from tests.data import ROOT


@pytest.mark.parametrize("package", [impostor, runtime])
def test_every_public_name_is_there_when_asked_for(package):
    for name in package.__all__:
        assert getattr(package, name) is getattr(package, name)
    with pytest.raises(AttributeError, match=f"module '{package.__name__}' has no attribute 'sprite'"):
        package.sprite  # noqa: B018


def test_listing_the_commands_imports_nothing_heavy():
    listed = "import sys; from impostor.cli import make_app; make_app(); print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", listed], cwd=ROOT, capture_output=True, text=True, check=True)
    assert {"bake.cli", "runtime.cli", "typer"} <= set(modules.stdout.split())
    heavy = {"numpy", "scipy", "PIL", "trimesh", "pyrender", "moderngl", "skimage"}
    assert not heavy & set(modules.stdout.split())


def test_a_ptm_file_that_is_not_compressed_needs_no_graphs():
    listed = "import sys, impostor.files.ptm_file; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", listed], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {"networkx", "scipy"} & set(modules.stdout.split())


def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path):
    (tmp_path / "typer.py").write_text("import time\nprint('ready', flush=True)\ntime.sleep(60)\n")
    command = [sys.executable, "-m", "impostor", "info", "a.fan"]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (130, "impostor: stopped\n")
