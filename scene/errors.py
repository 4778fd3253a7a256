"""Errors whose cause is the input: one message that says where, what was found and what to do."""


class SceneError(Exception):
    """The input is at fault. The command line prints the message alone and exits with 2."""


class SessionError(SceneError):
    """`session.toml`, or a file that it names, is at fault."""


class CaptureError(SceneError):
    """The photographs are at fault: unreadable, mixed, misfired, of different sizes."""


class CalibrationError(SceneError):
    """The lights cannot be had from these frames: no ball, too few lights, coplanar lights."""


class AlignError(SceneError):
    """The scan is at fault, or it does not fit the photographs."""


class RenderError(SceneError):
    """The twin cannot be rendered from what was given."""


class ClusterError(SceneError):
    """The cluster cannot do the work: no scheduler, no worker, or one that would not give the same results."""
