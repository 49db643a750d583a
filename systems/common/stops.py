"""Codes with texts, and why the robot stands: one list for all that may stop it."""

from enum import IntEnum


class Code(IntEnum):
    """A code, as signals carry it, and its text.

    A compiled function makes a float of it with `float(code.value)`.
    """

    text: str

    def __new__(cls, code: int, text: str) -> "Code":
        """Makes a member of its code and its text."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.text = text
        return member


class Stop(Code):
    """Of a stop."""

    MOVING = 0, "it moves"
    TARGET_LOST = 1, "target lost by the tracker"
    OBSTACLE_LOST = 2, "obstacle lost by the tracker"
    NOT_A_NUMBER = 3, "input is not a number"
    OUT_OF_REACH = 4, "target out of reach"
    OUT_OF_VIEW = 5, "target outside the view cone"
    NOT_FOLLOWED = 6, "arm does not follow"
    WAITING = 7, "waiting for the tracker's first frame"
    WALL_LOADED = 8, "force on the wall over its limit"
    SENSOR_LOST = 9, "wrist sensor lost"
    PROBING = 10, "probing the wall"
    TOUCHED = 11, "touched by a tool"
