"""The C functions behind the module: pipeline/library/epiline.h and drivers/study/library/desk.h, by ctypes."""

from __future__ import annotations

import ctypes as c
import os
import pathlib
from typing import Any, Mapping, Sequence, Union

import numpy as np

Setting = Union[bool, int, float, str, "os.PathLike[str]", Mapping[str, int], Sequence[float]]
Section = Mapping[str, Setting]

_FLOAT, _INT, _UINT = np.float64, np.int32, np.uint32
#: epiline_state, field by field
STATE = np.dtype(
    [
        ("image_ns", np.int64),
        ("stamp_ns", np.int64),
        ("position", _FLOAT, 3),
        ("orientation", _FLOAT, 4),
        ("velocity", _FLOAT, 3),
        ("angular_velocity", _FLOAT, 3),
        ("accelerometer_bias", _FLOAT, 3),
        ("gyroscope_bias", _FLOAT, 3),
        ("imu_scale", _FLOAT, 2),
        ("time_offset", _FLOAT),
        ("covariance", _FLOAT, (16, 16)),
        ("has_pose", _INT),
        ("health", _INT),
        ("quality", _INT),
        ("reasons", _UINT),
        ("reset_counter", _UINT),
        ("tracks", _UINT),
    ],
    align=True,
)
#: epiline_point
POINT = np.dtype([("id", _UINT), ("u", np.float32), ("v", np.float32)])

_FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
    "version": (c.c_char_p, []),
    "create": (c.c_void_p, [c.c_char_p, c.c_int, c.c_char_p, c.c_size_t]),
    "destroy": (None, [c.c_void_p]),
    "push_imu": (c.c_int, [c.c_void_p, c.c_int64, c.c_void_p, c.c_void_p]),
    "push_image": (c.c_int, [c.c_void_p, c.c_int64, c.c_void_p, c.c_int, c.c_int, c.c_int]),
    "push_tracks": (c.c_int, [c.c_void_p, c.c_int64, c.c_void_p, c.c_size_t]),
    "push_wheel": (c.c_int, [c.c_void_p, c.c_int64, c.c_double]),
    "push_height": (c.c_int, [c.c_void_p, c.c_int64, c.c_int, c.c_double]),
    "end": (None, [c.c_void_p]),
    "step": (c.c_int, [c.c_void_p]),
    "get_state": (c.c_void_p, [c.c_void_p]),
    "explain": (c.c_char_p, [c.c_void_p]),
    "error": (c.c_char_p, [c.c_void_p]),
    "desk_error": (c.c_char_p, []),
    "desk_replay": (
        c.c_void_p,
        [c.c_char_p, c.c_char_p, c.c_char_p, c.POINTER(c.c_char_p), c.c_size_t, c.c_double, c.c_double],
    ),
    "desk_destroy_flight": (None, [c.c_void_p]),
    "desk_states": (c.c_void_p, [c.c_void_p, c.POINTER(c.c_size_t)]),
    "desk_statistics": (c.c_char_p, [c.c_void_p]),
    "desk_tum": (c.c_char_p, [c.c_void_p]),
    "desk_notes": (c.c_char_p, [c.c_void_p]),
    "desk_estimate": (c.c_void_p, [c.c_void_p]),
    "desk_truth": (c.c_void_p, [c.c_void_p]),
    "desk_read_trajectory": (c.c_void_p, [c.c_char_p]),
    "desk_make_trajectory": (c.c_void_p, [c.c_size_t, c.c_void_p, c.c_void_p, c.c_void_p]),
    "desk_destroy_trajectory": (None, [c.c_void_p]),
    "desk_poses": (c.c_size_t, [c.c_void_p]),
    "desk_copy_poses": (None, [c.c_void_p, c.c_void_p, c.c_void_p, c.c_void_p]),
    "desk_evaluate": (c.c_char_p, [c.c_void_p, c.c_void_p, c.c_char_p]),
    "desk_read_image": (c.c_int, [c.c_char_p, c.c_void_p, c.POINTER(c.c_int), c.POINTER(c.c_int)]),
}


class _Library:
    """epiline_NAME as an attribute NAME."""

    def __init__(self) -> None:
        library = c.CDLL(str(pathlib.Path(__file__).with_name("_epiline.so")))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, "epiline_" + name)
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:  # for type checkers: the attributes are set above
        raise AttributeError(name)


library = _Library()


def _toml(value: Any) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f'"{name}" = {int(number)}' for name, number in value.items()) + " }"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_toml(number) for number in value) + "]"
    text = str(value)
    escaped = "".join(f"\\u{ord(x):04x}" if ord(x) < 32 or x in '"\\\x7f' else x for x in text)
    return f'"{escaped}"'


def settings_of(sections: Mapping[str, Section]) -> list[str]:
    """`section.key=value` of each setting, as TOML writes the value."""
    return [f"{name}.{key}={_toml(value)}" for name, section in sections.items() for key, value in section.items()]
