"""The exceptions a user can meet. Every message says where, what the value was and what was expected."""

from __future__ import annotations

from os import PathLike


class ImpostorError(Exception):
    """Something the user gave, or asked for, cannot be done.

    Parameters
    ----------
    where : str or path-like
        The file, flag or argument that is wrong.
    problem : str
        The place inside it, the value found and what was expected, on one line.
    """

    def __init__(self, where: str | PathLike[str], problem: str):
        self.where = str(where)
        self.problem = " ".join(str(problem).split())
        super().__init__(f"{self.where}: {self.problem}")

    def __reduce__(self):
        return type(self), (self.where, self.problem)


class ModelError(ImpostorError):
    """A model file that cannot be read, or that would not give a true picture."""


class FanFileError(ImpostorError):
    """A `.fan` file that is truncated, altered, newer than this version, or not a fan at all."""


class OutputError(ImpostorError):
    """An output that exists already, or a place that cannot be written."""


class PhotographError(ImpostorError):
    """A photograph that cannot be decoded, or that does not fit to the others of its capture set."""


class SettingsError(ImpostorError):
    """A number or choice outside what the command or function takes."""


class GpuError(ImpostorError):
    """No OpenGL context, a shader that does not compile, or an image the GPU cannot hold."""


class ImpostorWarning(UserWarning):
    """Something that was done, and is not what the user may expect."""


class ModelWarning(ImpostorWarning):
    """Something in a model that was drawn differently from what its file asks for."""


class ViewWarning(ImpostorWarning):
    """A fan seen from where its views do not show it truly."""


class PtmFileError(ImpostorError):
    """A `.ptm` file that is truncated, lies about itself, or is of a kind that is not read."""


class LpFileError(ImpostorError):
    """A `.lp` file that does not say where the light was."""


class SceneFileError(ImpostorError):
    """A scene that is not TOML, breaks a rule of SCENE.md, or names a file that is missing."""


class SceneWarning(ImpostorWarning):
    """Something in a scene that was done otherwise than its file asks for."""


class EnvironmentFileError(ImpostorError):
    """An environment map that cannot be read, or that is not light from all around."""
