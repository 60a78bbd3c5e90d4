"""epiline: visual-inertial odometry.

`replay` estimates a recorded flight, `evaluate` compares trajectories, and `Estimator` takes IMU samples and images, or
tracks, as they come. Each gives the same numbers as the command `epiline`, bit by bit.

Frames: W is the world, z up, with origin and heading of the start. B is the IMU. C is the camera, z along its axis.
Units: m, s, rad. Times are integer nanoseconds of one clock. Quaternions are Hamilton's, w x y z, and turn vectors from B
to W. Settings are those of `epiline config`, a keyword for each section: `tracker={"max_features": 150}`.
"""

from __future__ import annotations

import ctypes
import json
import os
import pathlib
import weakref
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from ._library import POINT, STATE, Section, library, settings_of

__all__ = ["Error", "Estimator", "Flight", "HEALTH", "Trajectory", "evaluate", "read_image", "read_trajectory", "replay"]
__version__: str = library.version().decode()

Path = Union[str, "os.PathLike[str]"]

#: Names of the values of the field `health`.
HEALTH = ("initialising", "tracking", "degraded", "lost")


class Error(Exception):
    """What was found where, and what was expected."""


def _desk_error() -> Error:
    return Error(library.desk_error().decode())


class Trajectory:
    """Poses of B in W over time.

    time_ns: (N,) int64, increasing. position: (N, 3), m. orientation: (N, 4), w x y z.
    """

    def __init__(self, time_ns: npt.ArrayLike, position: npt.ArrayLike, orientation: npt.ArrayLike) -> None:
        times = np.ascontiguousarray(time_ns, np.int64).reshape(-1)
        n = len(times)
        positions = np.ascontiguousarray(position, np.float64).reshape(n, 3)
        orientations = np.ascontiguousarray(orientation, np.float64).reshape(n, 4)
        self._adopt(library.desk_make_trajectory(n, times.ctypes.data, positions.ctypes.data, orientations.ctypes.data))

    @classmethod
    def _of(cls, handle: Optional[int]) -> Trajectory:
        trajectory = cls.__new__(cls)
        trajectory._adopt(handle)
        return trajectory

    def _adopt(self, handle: Optional[int]) -> None:
        if not handle:
            raise _desk_error()
        self._handle = handle
        self._finalizer = weakref.finalize(self, library.desk_destroy_trajectory, handle)
        n = library.desk_poses(handle)
        self.time_ns: npt.NDArray[np.int64] = np.empty(n, np.int64)
        self.position: npt.NDArray[np.float64] = np.empty((n, 3))
        self.orientation: npt.NDArray[np.float64] = np.empty((n, 4))
        arrays = (self.time_ns, self.position, self.orientation)
        library.desk_copy_poses(handle, *(array.ctypes.data for array in arrays))
        for array in arrays:
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.time_ns)


class Flight:
    """A replayed flight.

    states: (N,) structured array, one element for each image that was estimated, with the fields of `Estimator.state`;
    `states["position"]` is (N, 3), `states["covariance"]` is (N, 16, 16).
    trajectory: of the images with a pose. truth: the recording's ground truth, or None.
    statistics: the content of stats.json (docs/replay.md). notes: remarks for the user.
    """

    def __init__(self, handle: int) -> None:
        count = ctypes.c_size_t()
        first = library.desk_states(handle, ctypes.byref(count))
        self.states: npt.NDArray[Any] = np.frombuffer(
            ctypes.string_at(first, count.value * STATE.itemsize), STATE
        )
        self.trajectory = Trajectory._of(library.desk_estimate(handle))
        truth = library.desk_truth(handle)
        self.truth: Optional[Trajectory] = Trajectory._of(truth) if truth else None
        self.statistics: dict[str, Any] = json.loads(library.desk_statistics(handle))
        self.notes: list[str] = library.desk_notes(handle).decode().splitlines()
        self._tum: bytes = library.desk_tum(handle)

    def write_tum(self, path: Path) -> None:
        """Writes trajectory.tum as `epiline replay` does: t x y z qx qy qz qw, seconds and m."""
        pathlib.Path(path).write_bytes(self._tum)


def replay(
    dataset: Path,
    *,
    which: str = "cam0",
    config: Optional[Path] = None,
    start: float = 0.0,
    duration: Optional[float] = None,
    **settings: Section,
) -> Flight:
    """Estimates the odometry of a recorded flight, as `epiline replay` does, in this thread.

    dataset: an ASL folder, or a bag (ROS 1, ROS 2, MCAP). which: the camera, cam0 to cam3, or both, or all.
    config: a configuration file (TOML). start, duration: seconds from the first image.
    settings: sections of the configuration; they win over the file.
    """
    sets = [text.encode() for text in settings_of(settings)]
    handle = library.desk_replay(
        os.fsencode(dataset),
        which.encode(),
        os.fsencode(config) if config is not None else b"",
        (ctypes.c_char_p * len(sets))(*sets),
        len(sets),
        start,
        duration or 0.0,
    )
    if not handle:
        raise _desk_error()
    try:
        return Flight(handle)
    finally:
        library.desk_destroy_flight(handle)


def read_trajectory(path: Path) -> Trajectory:
    """Reads odometry.csv of a replay, a TUM trajectory, or an ASL ground truth; each may be gzipped."""
    return Trajectory._of(library.desk_read_trajectory(os.fsencode(path)))


def evaluate(
    estimate: Union[Trajectory, Flight, Path], reference: Union[Trajectory, Path], align: str = "4dof"
) -> dict[str, Any]:
    """Errors of an estimated trajectory: what `epiline evaluate --json` prints.

    align: 4dof (position and yaw), se3, sim3 or none. `["ate_m"]["rmse"]` is the position error after that, m.
    """
    if isinstance(estimate, Flight):
        estimate = estimate.trajectory
    if not isinstance(estimate, Trajectory):
        estimate = read_trajectory(estimate)
    if not isinstance(reference, Trajectory):
        reference = read_trajectory(reference)
    text = library.desk_evaluate(estimate._handle, reference._handle, align.encode())
    if text is None:
        raise _desk_error()
    result: dict[str, Any] = json.loads(text)
    return result


def read_image(path: Path) -> npt.NDArray[np.uint8]:
    """Reads a PNG, JPEG or PGM as 8-bit grey, (height, width)."""
    name, width, height = os.fsencode(path), ctypes.c_int(), ctypes.c_int()
    size = ctypes.byref(width), ctypes.byref(height)
    if library.desk_read_image(name, None, *size) != 0:
        raise _desk_error()
    image = np.empty((height.value, width.value), np.uint8)
    if library.desk_read_image(name, image.ctypes.data, *size) != 0:
        raise _desk_error()
    return image


class Estimator:
    """Odometry from samples as they come. One thread at a time.

    tracks: False for images, True for tracks of a tracker of your own. settings: sections of the configuration;
    `camera={"calibration": "camera.yaml"}` is required, `imu={"calibration": "imu.yaml"}` gives the noise of the IMU.
    Push each sensor's samples in the order of time, and call `step` after each push until it returns False.
    """

    def __init__(self, *, tracks: bool = False, **settings: Section) -> None:
        text = "\n".join(setting.replace("=", " = ", 1) for setting in settings_of(settings))
        error = ctypes.create_string_buffer(1000)
        handle = library.create(text.encode(), int(tracks), error, len(error))
        if not handle:
            raise Error(error.value.decode())
        self._handle: int = handle
        self._finalizer = weakref.finalize(self, library.destroy, handle)

    def push_imu(self, time_ns: int, angular_velocity: npt.ArrayLike, specific_force: npt.ArrayLike) -> None:
        """angular_velocity: (3,), rad/s. specific_force: (3,), m/s^2, +9.81 upwards at rest. Both in B."""
        rates = np.ascontiguousarray(angular_velocity, np.float64).reshape(3)
        forces = np.ascontiguousarray(specific_force, np.float64).reshape(3)
        self._check(library.push_imu(self._handle, int(time_ns), rates.ctypes.data, forces.ctypes.data))

    def push_image(self, time_ns: int, image: npt.NDArray[np.uint8]) -> None:
        """image: (height, width), uint8, as large as in the calibration. time_ns: of its mid-exposure."""
        if image.dtype != np.uint8 or image.ndim != 2:
            raise TypeError(f"an image of {image.dtype}, {image.ndim} dimensions; expected uint8, (height, width)")
        rows = image if image.strides[1] == 1 and image.strides[0] > 0 else np.ascontiguousarray(image)
        height, width = rows.shape
        self._check(library.push_image(self._handle, int(time_ns), rows.ctypes.data, width, height, rows.strides[0]))

    def push_tracks(self, time_ns: int, ids: npt.ArrayLike, pixels: npt.ArrayLike) -> None:
        """The points of one image. ids: (N,), each once, from 0 to 2^32 - 1. pixels: (N, 2), u and v, raw."""
        numbers = np.asarray(ids)
        points = np.empty(len(numbers), POINT)
        points["id"] = numbers
        places = np.asarray(pixels, np.float32).reshape(len(numbers), 2)
        points["u"], points["v"] = places[:, 0], places[:, 1]
        self._check(library.push_tracks(self._handle, int(time_ns), points.ctypes.data, len(points)))

    def push_wheel(self, time_ns: int, forward_speed: float) -> None:
        """Speed of the vehicle along its forward axis, m/s."""
        self._check(library.push_wheel(self._handle, int(time_ns), float(forward_speed)))

    def push_height(self, time_ns: int, metres: float, *, range_finder: bool = False) -> None:
        """A barometer's height above any level, or the distance to the ground along a range finder's beam, m."""
        self._check(library.push_height(self._handle, int(time_ns), int(range_finder), float(metres)))

    def end(self) -> None:
        """No more samples come: the images that wait need no later IMU samples."""
        library.end(self._handle)

    def step(self) -> bool:
        """Estimates the oldest image that waits. False: none waits, or IMU samples up to it are missing."""
        return bool(library.step(self._handle))

    @property
    def state(self) -> Any:
        """The estimate at the last image, a copy. Its fields:

        image_ns, stamp_ns: stamp of the image, and the same instant on the IMU's clock. position (3,), velocity (3,): of
        B in W. orientation (4,): w x y z. angular_velocity (3,): in B. accelerometer_bias, gyroscope_bias: (3,).
        imu_scale (2,): accelerometer, gyroscope, less 1. time_offset: t_IMU - t_image. covariance (16, 16): position (W),
        rotation (B), velocity, accelerometer bias, gyroscope bias, time offset. has_pose: 0 before the start.
        health: index into HEALTH. quality: 0 to 100, -1 when lost. reasons: bits, `explain` names them.
        reset_counter: changes when the pose continues somewhere else. tracks: points in the image.
        """
        return np.frombuffer(ctypes.string_at(library.get_state(self._handle), STATE.itemsize), STATE)[0]

    def explain(self) -> str:
        """Health in words: state, reasons, and what contradicts the configured numbers."""
        text: str = library.explain(self._handle).decode()
        return text

    def _check(self, result: int) -> None:
        if result != 0:
            raise Error(library.error(self._handle).decode())
