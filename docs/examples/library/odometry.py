"""Flies a recorded flight with one call, then sample by sample as with a camera and an IMU of your own: usage: odometry.py FOLDER.

Writes both trajectories, which are the same, bit by bit, as trajectory.tum of `epiline replay`."""

import csv
import pathlib
import sys

import epiline

folder = pathlib.Path(sys.argv[1]) / "mav0"

# One call.
flight = epiline.replay(folder, tracker={"max_features": 200})
flight.write_tum("replayed.tum")
speed = (flight.states["velocity"] ** 2).sum(axis=1) ** 0.5
print(f"{len(flight.trajectory)} poses, {epiline.HEALTH[flight.states['health'][-1]]}, at most {speed.max():.2f} m/s")
if flight.truth is not None:
    errors = epiline.evaluate(flight, flight.truth)
    print(f"position error {1000 * errors['ate_m']['rmse']:.1f} mm, yaw drift {errors['yaw_drift_deg']:+.2f} deg")

# Sample by sample.
estimator = epiline.Estimator(
    camera={"calibration": folder / "cam0/sensor.yaml"},
    imu={"calibration": folder / "imu0/sensor.yaml"},
    tracker={"max_features": 200},
)
tables = [csv.reader((folder / sensor / "data.csv").open()) for sensor in ("imu0", "cam0")]
imu, images = ([row for row in table if not row[0].startswith("#")] for table in tables)
samples = [(int(row[0]), [float(x) for x in row[1:]], None) for row in imu]
samples += [(int(row[0]), None, folder / "cam0/data" / row[1].strip()) for row in images]
with open("pushed.tum", "w") as out:
    for time_ns, reading, image in sorted(samples, key=lambda sample: sample[0]) + [(0, None, None)]:
        if reading:
            estimator.push_imu(time_ns, reading[:3], reading[3:])
        elif image:
            estimator.push_image(time_ns, epiline.read_image(image))
        else:
            estimator.end()
        while estimator.step():
            state = estimator.state
            if state["has_pose"]:
                t, p, (w, x, y, z) = int(state["image_ns"]), state["position"], state["orientation"]
                numbers = " ".join(f"{number:.9f}" for number in (*p, x, y, z, w))
                out.write(f"{t // 10**9}.{t % 10**9:09} {numbers}\n")
print(estimator.explain())
