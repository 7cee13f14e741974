"""A model file and the files it refers to: read within its own folder only, and hashed as they are read."""

from __future__ import annotations

import base64
import binascii
import hashlib
import re
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, unquote_to_bytes

from impostor.errors import ModelError

_SCHEME = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")
_DRIVE = re.compile(r"^[A-Za-z]:")
_DATA_URI = re.compile(r"^data:[^,]*?(;base64)?,", re.IGNORECASE)


class ModelFiles:
    """One model file, its bytes, and read access to its neighbours.

    Parameters
    ----------
    path : str or path-like
        The model file.

    Raises
    ------
    ModelError
        When the file is missing, a directory, unreadable, empty, or a Git LFS pointer.
    """

    def __init__(self, path):
        self.path = Path(path)
        self.suffix = self.path.suffix.lower()
        self.data = self._read_model()
        self._folder = self.path.resolve().parent
        self._digests: dict[str, bytes] = {}

    def _read_model(self) -> bytes:
        if not self.path.exists():
            raise ModelError(self.path, "no such file; expected a model file")
        if not self.path.is_file():
            raise ModelError(self.path, "is a directory or a device; expected a model file")
        try:
            data = self.path.read_bytes()
        except OSError as error:
            raise ModelError(self.path, f"cannot be read ({error.strerror}); expected a readable file") from error
        if not data:
            raise ModelError(self.path, "0 bytes; expected a model")
        if data.startswith(b"version https://git-lfs"):
            raise ModelError(self.path, "a Git LFS pointer; expected the model itself (run `git lfs pull`)")
        return data

    def read(self, reference: str, place: str) -> bytes:
        """Bytes of a file that the model refers to, or of a `data:` URI.

        Parameters
        ----------
        reference : str
            The reference as the model writes it; relative to the model's folder, percent-encoded or not.
        place : str
            Where in the model it stands, for the message.

        Raises
        ------
        ModelError
            When the reference leaves the model's folder, names a URL, or the file is missing or unreadable.
        """
        if match := _DATA_URI.match(reference):
            return self._decode_data_uri(reference, match, place)
        inside = self._inside(reference, place)
        try:
            data = inside.read_bytes()
        except OSError as error:
            expected = f"expected a file in {self._folder.name or '/'}/"
            raise ModelError(self.path, f"{place}: '{reference}' {_reason(error)}, {expected}") from error
        self._digests[inside.relative_to(self._folder).as_posix()] = hashlib.sha256(data).digest()
        return data

    def source_hash(self) -> str:
        """SHA-256 (hex) of the model's bytes and of every file read for it, in the order of their names."""
        digest = hashlib.sha256(self.data)
        for name in sorted(self._digests):
            digest.update(name.encode() + b"\0" + self._digests[name])
        return digest.hexdigest()

    def _decode_data_uri(self, reference: str, match: re.Match, place: str) -> bytes:
        payload = reference[match.end() :]
        if not match.group(1):
            return unquote_to_bytes(payload)
        try:
            return base64.b64decode(unquote_to_bytes(payload), validate=True)
        except (binascii.Error, ValueError) as error:
            raise ModelError(self.path, f"{place}: data URI is not base64 ({error})") from error

    def _inside(self, reference: str, place: str) -> Path:
        """The path of a reference, percent-decoded when only that name exists; refused outside the folder."""
        candidates = [self._relative(name, reference, place) for name in (reference, unquote(reference))]
        return next((path for path in candidates if path.is_file()), candidates[0])

    def _relative(self, name: str, reference: str, place: str) -> Path:
        relative = PurePosixPath(name.strip().replace("\\", "/"))
        outside = relative.is_absolute() or ".." in relative.parts or "\0" in name
        if outside or _DRIVE.match(name.strip()) or _SCHEME.match(name.strip()):
            raise ModelError(
                self.path, f"{place}: '{reference[:200]}' refused; expected a file in the model's own folder"
            )
        try:
            path = (self._folder / relative).resolve()
        except (OSError, RuntimeError) as error:
            raise ModelError(self.path, f"{place}: '{reference[:200]}' cannot be resolved ({error})") from error
        if not path.is_relative_to(self._folder):
            raise ModelError(self.path, f"{place}: '{reference}' links outside the model's own folder, refused")
        return path


def utf8(data: bytes) -> bytes:
    """Text as UTF-8 without a byte order mark; what is not UTF-8 is taken as Latin-1."""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1").encode("utf-8")
    return data.removeprefix(b"\xef\xbb\xbf")


def _reason(error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return "is missing"
    return f"cannot be read ({error.strerror})"
