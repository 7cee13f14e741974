"""Fans that a scene names by their models: baked where they are missing, by `impostor bake` in a process of its own."""

from __future__ import annotations

import signal
import subprocess
import sys

from impostor.scene import Scene, Subject


def unbaked(scene: Scene) -> list[Subject]:
    """The subjects whose fans are not there yet, each once."""
    subjects = dict.fromkeys(placement.subject for placement in scene.instances)
    return [subject for subject in subjects if subject.bake is not None and not subject.fan.exists()]


def described(subject: Subject) -> str:
    """What is baked, in a few words."""
    bake = subject.bake
    assert bake is not None
    return f"baking {subject.model} ({bake.views} views of {bake.size}x{bake.size}) into {subject.fan}"


def bake_command(subject: Subject, quiet: bool = False) -> list[str]:
    """The command line that makes a subject's fan."""
    bake = subject.bake
    assert bake is not None
    subject.fan.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "impostor", "bake", str(subject.model), "-o", str(subject.fan)]
    command += ["--views", str(bake.views), "--layout", bake.layout, "--size", str(bake.size), "--up", bake.up]
    if bake.elevation_deg is not None:
        command += ["--elevation", str(bake.elevation_deg)]
    if bake.samples is not None:
        command += ["--samples", str(bake.samples)]
    return [*command, "--quiet"] if quiet else command


class Bakery:
    """Bakes one fan after the other, while something else goes on.

    Parameters
    ----------
    subjects : list of Subject
    quiet : bool
        Say only what goes wrong.

    Attributes
    ----------
    current : Subject or None
        What is being baked.
    failed : bool
        A bake has ended badly, and said why on standard error; the rest is left.
    """

    def __init__(self, subjects: list[Subject], quiet: bool = False):
        self._waiting, self._quiet = list(subjects), quiet
        self._process: subprocess.Popen[bytes] | None = None
        self.current: Subject | None = None
        self.failed = False
        self._next()

    def _next(self) -> None:
        self._process, self.current = None, None
        if self._waiting:
            self.current = self._waiting.pop(0)
            if not self._quiet:
                print(f"impostor: {described(self.current)}", file=sys.stderr, flush=True)
            # Its summary is no result of this command; its progress bar shows on standard error.
            self._process = subprocess.Popen(bake_command(self.current, self._quiet), stdout=subprocess.DEVNULL)

    def poll(self, wait: bool = False) -> bool:
        """Whether all is done, or nothing more will be; `wait` comes back when it is."""
        while self._process is not None:
            code = self._process.wait() if wait else self._process.poll()
            if code is None:
                return False
            if code:
                self._process, self.current, self.failed = None, None, True
                return True
            self._next()
        return True

    def stop(self) -> None:
        """End what is being baked; a half-written fan vanishes."""
        if self._process is not None and self._process.poll() is None:
            if sys.platform == "win32":
                self._process.terminate()
            else:
                self._process.send_signal(signal.SIGINT)  # as Ctrl-C does, so that it cleans up
            self._process.wait()
        self._process, self.current = None, None
