"""usage: python_test.py FLIGHT TRACKS OUT. What the Python module promises besides the example: FLIGHT and TRACKS are data sets, OUT is
what `epiline replay FLIGHT` wrote."""

import csv
import gc
import json
import pathlib
import sys
import unittest

import numpy as np

import epiline

flight, tracks, out = (pathlib.Path(name) for name in sys.argv[1:4])
CALIBRATION = {"calibration": flight / "mav0/cam0/sensor.yaml"}


def read_table(path):
    return [row for row in csv.reader(path.open()) if not row[0].startswith("#")]


class Replay(unittest.TestCase):
    def test_arrays_say_what_the_files_say(self):
        result = epiline.replay(flight, tracker={"max_features": 200})
        written = epiline.read_trajectory(out / "trajectory.tum")
        np.testing.assert_array_equal(result.trajectory.time_ns, written.time_ns)
        np.testing.assert_allclose(result.trajectory.position, written.position, atol=6e-10)
        states = result.states[result.states["has_pose"] == 1]
        np.testing.assert_array_equal(states["position"], result.trajectory.position)
        np.testing.assert_array_equal(states["orientation"], result.trajectory.orientation)
        self.assertEqual(states["covariance"].shape, (len(written), 16, 16))
        covariance = states["covariance"]
        np.testing.assert_allclose(covariance, covariance.transpose(0, 2, 1), rtol=1e-9, atol=1e-12)
        self.assertTrue((np.diagonal(covariance, axis1=1, axis2=2) >= 0).all())
        stats = json.loads((out / "stats.json").read_text())
        self.assertEqual(result.statistics["error"], stats["error"])
        self.assertLess(epiline.evaluate(result, result.truth)["ate_m"]["rmse"], 0.05)

    def test_start_and_duration_choose_images(self):
        whole, part = epiline.replay(flight), epiline.replay(flight, start=0.5, duration=1.0)
        self.assertLess(len(part.states), len(whole.states) / 2)

    def test_errors_are_texts(self):
        with self.assertRaisesRegex(epiline.Error, "does not exist|expected"):
            epiline.replay("/none")
        with self.assertRaisesRegex(epiline.Error, "tracker.max_features"):
            epiline.replay(flight, tracker={"max_feature": 1})
        with self.assertRaisesRegex(epiline.Error, "the alignment \"2dof\"; expected 4dof"):
            epiline.evaluate(out / "trajectory.tum", out / "trajectory.tum", "2dof")


class Trajectories(unittest.TestCase):
    def test_evaluation_is_that_of_the_command(self):
        truth = flight / "mav0/state_groundtruth_estimate0/data.csv"
        stats = json.loads((out / "stats.json").read_text())["error"]
        figures = epiline.evaluate(out / "odometry.csv", truth)
        self.assertAlmostEqual(figures["ate_m"]["rmse"], stats["ate_4dof_m"]["rmse"], places=8)
        self.assertAlmostEqual(figures["nees_position"], stats["nees_position"], places=3)

    def test_arrays_become_trajectories(self):
        time = np.arange(50) * 100_000_000
        place = np.stack([np.sin(1e-9 * time), np.cos(1e-9 * time), 0 * time], axis=1)
        turn = np.tile([1.0, 0, 0, 0], (50, 1))
        true = epiline.Trajectory(time, place, turn)
        self.assertAlmostEqual(epiline.evaluate(epiline.Trajectory(time, place + 1, turn), true)["ate_m"]["rmse"], 0)
        self.assertAlmostEqual(epiline.evaluate(epiline.Trajectory(time, place + [3, 0, 0], turn), true, "none")["ate_m"]["rmse"], 3)
        with self.assertRaisesRegex(epiline.Error, "pose 1"):
            epiline.Trajectory(time[::-1], place, turn)


class Estimator(unittest.TestCase):
    def test_tracks_give_the_trajectory_of_a_replay(self):
        folder = tracks / "mav0"
        expected = epiline.replay(tracks).states
        estimator = epiline.Estimator(
            tracks=True,
            camera={"calibration": folder / "cam0/sensor.yaml"},
            imu={"calibration": folder / "imu0/sensor.yaml"},
        )
        imu, points = read_table(folder / "imu0/data.csv"), read_table(folder / "cam0/tracks.csv")
        states, at = [], 0
        for time in sorted({int(row[0]) for row in points}):
            rows = [row for row in points if int(row[0]) == time]
            estimator.push_tracks(np.int64(time), [int(row[1]) for row in rows], [[float(x) for x in row[2:4]] for row in rows])
            while at < len(imu) and (at == 0 or int(imu[at - 1][0]) < time + 20_000_000):  # more than the image needs
                reading = [float(x) for x in imu[at][1:]]
                estimator.push_imu(int(imu[at][0]), reading[:3], reading[3:])
                at += 1
            while estimator.step():
                states.append(estimator.state)
        estimator.end()
        while estimator.step():
            states.append(estimator.state)
        self.assertEqual(np.array(states).tobytes(), expected.tobytes())

    def test_errors_are_texts(self):
        with self.assertRaisesRegex(epiline.Error, "camera.calibration is not set"):
            epiline.Estimator()
        with self.assertRaisesRegex(epiline.Error, "unknown section \"cameras\"; expected \\[camera\\]"):
            epiline.Estimator(cameras={"calibration": "x"})
        estimator = epiline.Estimator(camera=CALIBRATION)
        with self.assertRaisesRegex(epiline.Error, "4x3 pixels; expected"):
            estimator.push_image(0, np.zeros((3, 4), np.uint8))
        with self.assertRaisesRegex(epiline.Error, "tracks; expected images"):
            estimator.push_tracks(0, [], [])
        with self.assertRaises(TypeError):
            estimator.push_image(0, np.zeros((3, 4)))
        image = epiline.read_image(next((flight / "mav0/cam0/data").iterdir()))
        for i in range(4):
            estimator.push_image(i, image)
        with self.assertRaisesRegex(epiline.Error, "too many images wait; expected a step after each push"):
            estimator.push_image(5, image)
        self.assertFalse(estimator.step())
        self.assertEqual(estimator.explain(), "initialising")
        del estimator
        gc.collect()

    def test_images_may_have_padded_rows(self):
        image = epiline.read_image(next((flight / "mav0/cam0/data").iterdir()))
        wide = np.zeros((image.shape[0], image.shape[1] + 7), np.uint8)
        wide[:, : image.shape[1]] = image
        estimator = epiline.Estimator(camera=CALIBRATION)
        estimator.push_image(0, wide[:, : image.shape[1]])
        estimator.push_image(50_000_000, image[:, ::-1])
        estimator.end()
        while estimator.step():
            self.assertGreater(estimator.state["tracks"], 20)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
