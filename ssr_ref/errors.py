"""Error and warning classes.

Every error that a user can cause is one line: what was found, what was expected, the way out.
"""


class SsrRefError(Exception):
    """Base of every error that `ssr_ref` raises on purpose. The command line exits with code 2."""


class SceneError(SsrRefError):
    """A scene, mesh, material or light that cannot be used."""


class CameraError(SsrRefError):
    """A camera or matrix outside the pinhole and orthographic families, or out of range."""


class SettingsError(SsrRefError):
    """A setting with an unknown name, a wrong type or a value out of range."""


class MathsError(SsrRefError):
    """An array that a formula cannot take: its shape, its type or a parameter out of range."""


class FileError(SsrRefError):
    """A file that is missing, unreadable, of an unknown format, or that cannot be written."""


class BundleError(SsrRefError):
    """A golden bundle that is incomplete or whose hashes do not agree."""


class SsrRefWarning(UserWarning):
    """Something the result is still valid with, but that its reader must know."""
