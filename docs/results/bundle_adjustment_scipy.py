#!/usr/bin/env python3
"""The bundle of the wall run solved by scipy and GTSAM: cost, poses and time beside ours.

    cargo build --release -p mono-geometry --example adjust_wall_run
    python3 bundle_adjustment_scipy.py target/release/examples/adjust_wall_run --core 1 --rounds 5 --csv peers.csv
    python3 bundle_adjustment_scipy.py ... --small ../../crates/mono-geometry/tests/reference/bundle_scipy.csv

The example simulates a problem, solves it and writes it down; scipy.optimize.least_squares (trf, analytic sparse
Jacobian) and GTSAM's Levenberg-Marquardt start from the same start and minimise the same cost

    1/2 sum rho(|pixel error / sigma|^2) + 1/2 sum |log(measured^-1 * motion)|^2_covariance.

scipy knows losses of single residuals only, so a pixel error r enters as r sqrt(rho(|r|^2) / |r|^2), whose square is
rho. Rounds alternate: ours, GTSAM, ours, GTSAM, ... ; scipy once (it is not made for this, minutes). Lines are appended to
the CSV; --case does one case. Times are those
of the minimisation alone, the problem in memory. Nothing here is shared with the Rust code but the file.
"""
import argparse
import csv
import json
import os
import statistics
import subprocess
import tempfile
import time

import numpy as np
import scipy
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation

try:
    import gtsam
except ImportError:
    gtsam = None

CASES = [
    ("planar", "none", 0.0),
    ("planar", "huber", 0.03),
    ("planar", "cauchy", 0.03),
    ("spatial", "none", 0.0),
    ("spatial", "huber", 0.03),
    ("spatial", "cauchy", 0.03),
]


def hat(v):
    zero = np.zeros(v.shape[:-1])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(v.shape[:-1] + (3, 3))


def left_jacobian(w):
    angle = np.linalg.norm(w)
    k = hat(w)
    if angle < 1e-4:
        return np.eye(3) + k / 2 + k @ k / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * k + (angle - np.sin(angle)) / angle**3 * k @ k


def exp6(xi):
    return Rotation.from_rotvec(xi[3:]).as_matrix(), left_jacobian(xi[3:]) @ xi[:3]


def log6(rotation, translation):
    w = Rotation.from_matrix(rotation).as_rotvec()
    return np.concatenate([np.linalg.solve(left_jacobian(w), translation), w])


class Bundle:
    """Unknowns: per free pose a tangent vector at its start (columns 0, 1, 5 if planar), then the landmarks."""

    def __init__(self, p):
        self.p = p
        self.columns = np.array([0, 1, 5] if p["kind"] == "planar" else range(6))
        self.d = len(self.columns)
        poses = np.array(p["poses"])
        self.r0, self.t0 = poses[:, :9].reshape(-1, 3, 3), poses[:, 9:]
        self.free = [k for k in range(len(poses)) if k not in p["fixed"]]
        self.place = {pose: k for k, pose in enumerate(self.free)}
        mount = np.array(p["body_from_camera"])
        self.rm, self.tm = mount[:9].reshape(3, 3), mount[9:]
        o = np.array(p["observations"])
        self.pose, self.mark = o[:, 0].astype(int), o[:, 1].astype(int)
        self.pixel, self.sigma = o[:, 2:4], o[:, 4]
        self.odometry = []
        for i, j, motion, covariance in p["odometry"]:
            motion = np.array(motion)
            lower = np.linalg.cholesky(np.array(covariance).reshape(self.d, self.d))
            self.odometry.append((i, j, motion[:9].reshape(3, 3), motion[9:], np.linalg.inv(lower)))
        self.size = self.d * len(self.free) + 3 * len(p["landmarks"])
        self.start = np.concatenate([np.zeros(self.d * len(self.free)), np.ravel(p["landmarks"])])

    def poses(self, x):
        r, t = self.r0.copy(), self.t0.copy()
        for pose, k in self.place.items():
            xi = np.zeros(6)
            xi[self.columns] = x[self.d * k : self.d * (k + 1)]
            dr, dt = exp6(xi)
            r[pose], t[pose] = r[pose] @ dr, r[pose] @ dt + t[pose]
        return r, t

    def weight(self, s):
        """rho(s) and rho'(s)."""
        k2 = self.p["threshold"] ** 2
        if self.p["loss"] == "huber":
            root = np.sqrt(np.maximum(s, k2))
            return np.where(s <= k2, s, 2 * np.sqrt(k2) * root - k2), np.where(s <= k2, 1, np.sqrt(k2) / root)
        if self.p["loss"] == "cauchy":
            return k2 * np.log1p(s / k2), 1 / (1 + s / k2)
        return s, np.ones_like(s)

    def in_camera(self, x):
        r, t = self.poses(x)
        marks = x[self.d * len(self.free) :].reshape(-1, 3)
        body = np.einsum("nji,nj->ni", r[self.pose], marks[self.mark] - t[self.pose])
        return r, t, body, (body - self.tm) @ self.rm

    def motion_errors(self, r, t):
        for i, j, rm, tm, white in self.odometry:
            rij, tij = r[i].T @ r[j], r[i].T @ (t[j] - t[i])
            yield i, j, rij, tij, log6(rm.T @ rij, rm.T @ (tij - tm))[self.columns], white

    def residuals(self, x):
        fx, fy, cx, cy = self.p["camera"]
        r, t, _, c = self.in_camera(x)
        e = np.stack([fx * c[:, 0] / c[:, 2] + cx, fy * c[:, 1] / c[:, 2] + cy], 1) - self.pixel
        e /= self.sigma[:, None]
        s = (e**2).sum(1)
        rho, _ = self.weight(s)
        e = e * np.sqrt(rho / np.maximum(s, 1e-300))[:, None]
        return np.concatenate([e.ravel()] + [white @ error for *_, error, white in self.motion_errors(r, t)])

    def jacobian(self, x):
        """Analytic for pixels; central differences for the few motions."""
        fx, fy, _, _ = self.p["camera"]
        r, t, body, c = self.in_camera(x)
        z = 1 / c[:, 2]
        zero = np.zeros_like(z)
        by_c = np.stack([fx * z, zero, -fx * c[:, 0] * z**2, zero, fy * z, -fy * c[:, 1] * z**2], 1).reshape(-1, 2, 3)
        by_c /= self.sigma[:, None, None]
        by_body = by_c @ self.rm.T
        e = np.stack([fx * c[:, 0] * z + self.p["camera"][2], fy * c[:, 1] * z + self.p["camera"][3]], 1) - self.pixel
        e /= self.sigma[:, None]
        s = np.maximum((e**2).sum(1), 1e-300)
        rho, slope = self.weight(s)
        w = np.sqrt(rho / s)
        # d(w e) = (w I + e e^T w' 2 / ...) de with dw/ds = (slope - rho / s) / (2 s w)
        outer = e[:, :, None] * e[:, None, :] * ((slope - rho / s) / (s * w))[:, None, None]
        chain = w[:, None, None] * np.eye(2) + outer
        by_body = chain @ by_body
        by_point = by_body @ np.transpose(r[self.pose], (0, 2, 1))
        # The pose is start * exp(xi): its motion in the body at xi is J_r(xi) dxi, by the adjoint series for small xi.
        by_pose = np.concatenate([-by_body, by_body @ hat(body)], 2)
        right = {pose: self.right_jacobian(x, k) for pose, k in self.place.items()}
        rows, cols, vals = [], [], []
        index = np.arange(len(self.pose))
        for pose, k in self.place.items():
            seen = index[self.pose == pose]
            block = by_pose[seen] @ right[pose]
            for axis in range(2):
                for a in range(self.d):
                    rows.append(2 * seen + axis)
                    cols.append(np.full(len(seen), self.d * k + a))
                    vals.append(block[:, axis, a])
        first = self.d * len(self.free)
        for axis in range(2):
            for a in range(3):
                rows.append(2 * index + axis)
                cols.append(first + 3 * self.mark + a)
                vals.append(by_point[:, axis, a])
        row = 2 * len(index)
        h = 1e-6
        for i, j, rm, tm, white in self.odometry:
            for pose in (i, j):
                if pose not in self.place:
                    continue
                for a in range(self.d):
                    column = self.d * self.place[pose] + a
                    errors = []
                    for sign in (1, -1):
                        rr, tt = dict(), dict()
                        for q in (i, j):
                            xi = np.zeros(6)
                            if q in self.place:
                                k = self.place[q]
                                xi[self.columns] = x[self.d * k : self.d * (k + 1)]
                            if q == pose:
                                xi[self.columns[a]] += sign * h
                            dr, dt = exp6(xi)
                            rr[q], tt[q] = self.r0[q] @ dr, self.r0[q] @ dt + self.t0[q]
                        rij, tij = rr[i].T @ rr[j], rr[i].T @ (tt[j] - tt[i])
                        errors.append(white @ log6(rm.T @ rij, rm.T @ (tij - tm))[self.columns])
                    rows.append(row + np.arange(self.d))
                    cols.append(np.full(self.d, column))
                    vals.append((errors[0] - errors[1]) / (2 * h))
            row += self.d
        return csr_matrix((np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols))), (row, self.size))

    def right_jacobian(self, x, k):
        """J_r(xi) = sum (-ad)^n / (n + 1)!."""
        xi = np.zeros(6)
        xi[self.columns] = x[self.d * k : self.d * (k + 1)]
        ad = np.zeros((6, 6))
        ad[:3, :3] = ad[3:, 3:] = hat(xi[3:])
        ad[:3, 3:] = hat(xi[:3])
        total, term = np.eye(6), np.eye(6)
        for n in range(1, 25):
            term = term @ (-ad) / (n + 1)
            total = total + term
        return total[:, self.columns]

    def solve(self):
        """trf with lsmr, then Gauss-Newton through sparse normal equations, so that the cost is the minimum to rounding."""
        began = time.perf_counter()
        found = least_squares(
            self.residuals, self.start, self.jacobian, method="trf", x_scale="jac", tr_solver="lsmr",
            tr_options={"atol": 1e-14, "btol": 1e-14, "maxiter": 4000}, ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=100,
        )
        return found, time.perf_counter() - began


def compare(p, r, t):
    """Largest distance (m) and angle (rad) from our poses."""
    ours = np.array(p["result_poses"])
    distance = np.abs(ours[:, 9:] - t).max()
    turns = [Rotation.from_matrix(a.T @ b).magnitude() for a, b in zip(ours[:, :9].reshape(-1, 3, 3), r)]
    return distance, max(turns)


def gtsam_problem(p):
    bundle = Bundle(p)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    mark_key, pose_key = gtsam.symbol_shorthand.L, gtsam.symbol_shorthand.X
    planar = p["kind"] == "planar"
    fx, fy, cx, cy = p["camera"]
    mount = gtsam.Pose3(gtsam.Rot3(bundle.rm), bundle.tm)
    # Rotation first in GTSAM's tangent of Pose3; translation first in that of Pose2.
    order = [0, 1, 2] if planar else [3, 4, 5, 0, 1, 2]
    unit = gtsam.noiseModel.Isotropic.Sigma(2, bundle.sigma[0])
    if p["loss"] == "huber":
        unit = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(p["threshold"]), unit)
    if p["loss"] == "cauchy":
        unit = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(p["threshold"]), unit)
    spatial_k = gtsam.Cal3_S2(fx, fy, 0, cx, cy)
    planar_k = gtsam.Cal3DS2(fx, fy, 0, cx, cy, 0, 0, 0, 0)
    for k in range(len(bundle.r0)):
        r, t = bundle.r0[k], bundle.t0[k]
        pose = gtsam.Pose2(t[0], t[1], np.arctan2(r[1, 0], r[0, 0])) if planar else gtsam.Pose3(gtsam.Rot3(r), t)
        values.insert(pose_key(k), pose)
    for k, point in enumerate(p["landmarks"]):
        values.insert(mark_key(k), np.array(point))
    for pose, mark, pixel in zip(bundle.pose, bundle.mark, bundle.pixel):
        if planar:
            factor = gtsam.PlanarProjectionFactor2(pose_key(pose), mark_key(mark), pixel, mount, planar_k, unit)
        else:
            factor = gtsam.GenericProjectionFactorCal3_S2(pixel, unit, pose_key(pose), mark_key(mark), spatial_k, mount)
        graph.add(factor)
    for (i, j, motion, covariance), (_, _, rm, tm, _) in zip(p["odometry"], bundle.odometry):
        covariance = np.array(covariance).reshape(bundle.d, bundle.d)[np.ix_(order, order)]
        noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
        if planar:
            graph.add(planar_motion(pose_key(i), pose_key(j), rm, tm, noise))
        else:
            graph.add(gtsam.BetweenFactorPose3(pose_key(i), pose_key(j), gtsam.Pose3(gtsam.Rot3(rm), tm), noise))
    for k in p["fixed"]:
        pose = pose_key(k)
        # All else is free of the gauge, so a prior of any strength holds the pose exactly (an equality would cost QR).
        graph.add(gtsam.PriorFactorPose2(pose, values.atPose2(pose), gtsam.noiseModel.Isotropic.Sigma(3, 1e-3)) if planar
                  else gtsam.PriorFactorPose3(pose, values.atPose3(pose), gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)))
    return graph, values, pose_key, planar


def planar_motion(i, j, rm, tm, noise):
    """log(measured^-1 motion) as a custom factor: BetweenFactorPose2 of the wheel leaves the logarithm out."""
    measured = gtsam.Pose2(tm[0], tm[1], np.arctan2(rm[1, 0], rm[0, 0]))

    def error(this, values, jacobians):
        a, b = values.atPose2(i), values.atPose2(j)
        moved = a.between(b)
        missing = measured.between(moved)
        e = gtsam.Pose2.Logmap(missing)
        if jacobians is not None:
            inverse = gtsam.Pose2.LogmapDerivative(missing)
            jacobians[0] = -inverse @ moved.inverse().AdjointMap()
            jacobians[1] = inverse
        return e

    return gtsam.CustomFactor(noise, [i, j], error)


def solve_gtsam(p):
    graph, values, pose_key, planar = gtsam_problem(p)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-11)
    parameters.setAbsoluteErrorTol(0.0)
    parameters.setMaxIterations(100)
    parameters.setlambdaInitial(1e-7)
    parameters.setDiagonalDamping(True)
    began = time.perf_counter()
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters)
    result = optimizer.optimize()
    seconds = time.perf_counter() - began
    r, t = [], []
    for k in range(len(p["poses"])):
        pose = gtsam.Pose3(result.atPose2(pose_key(k))) if planar else result.atPose3(pose_key(k))
        r.append(pose.rotation().matrix())
        t.append(pose.translation())
    return graph.error(result), np.array(r), np.array(t), seconds, optimizer.iterations(), graph.error(values)


def run(example, arguments, core):
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "bundle.json")
        command = [example, *arguments, "--write", file]
        if core is not None:
            command = ["taskset", "-c", str(core), *command]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        with open(file) as f:
            return json.load(f)


def write_small(example, file):
    """A problem of 5 frames and 20 landmarks with scipy's minimum, for the test val_scipy_*."""
    with open(file, "w") as f:
        f.write(f"# bundle_adjustment_scipy.py --small; scipy {scipy.__version__}, numpy {np.__version__}\n")
        for kind, loss in [("planar", "none"), ("planar", "huber"), ("spatial", "cauchy")]:
            p = run(example, [kind, "--frames", "5", "--landmarks", "20", "--seed", "7", "--loss", loss,
                              "--outliers", "0.0" if loss == "none" else "0.05"], None)
            bundle = Bundle(p)
            found, _ = bundle.solve()
            r, t = bundle.poses(found.x)
            agree = abs(found.cost / p["result_cost"] - 1)
            print(f"small {kind} {loss}: scipy {found.cost:.12g}, ours {p['result_cost']:.12g}, relative {agree:.1e}, "
                  f"poses {compare(p, r, t)}, {found.status}")

            def line(name, values):
                f.write(name + "," + ",".join(repr(float(v)) for v in values) + "\n")

            f.write(f"problem,{kind},{loss}\n")
            line("threshold", [p["threshold"]])
            line("camera", p["camera"])
            line("mount", p["body_from_camera"])
            for pose in p["poses"]:
                line("pose", pose)
            for mark in p["landmarks"]:
                line("landmark", mark)
            for o in p["observations"]:
                line("observation", o)
            for i, j, motion, covariance in p["odometry"]:
                line("odometry", [i, j, *motion, *covariance])
            line("cost", [found.cost])
            for rotation, translation in zip(r, t):
                line("solved", [*rotation.ravel(), *translation])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("example")
    parser.add_argument("--core", type=int)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--csv")
    parser.add_argument("--small")
    parser.add_argument("--no-scipy", action="store_true")
    parser.add_argument("--no-gtsam", action="store_true")
    parser.add_argument("--case", help="KIND-LOSS only")
    options = parser.parse_args()
    if options.small:
        return write_small(options.example, options.small)
    if options.core is not None:
        os.sched_setaffinity(0, {options.core})
    rows = []
    for kind, loss, outliers in CASES:
        if options.case and options.case != f"{kind}-{loss}":
            continue
        arguments = [kind, "--loss", loss, "--outliers", str(outliers), "--repeat", "3"]
        ours, theirs = [], []
        p = None
        for _ in range(options.rounds):
            p = run(options.example, arguments, options.core)
            ours += p["result_seconds"]
            if gtsam and not options.no_gtsam:
                theirs.append(solve_gtsam(p))
        row = [kind, loss, outliers, len(p["observations"])]
        rows.append([*row, "ours", p["result_cost"], 0, 0, 0, statistics.median(ours), min(ours), max(ours), p["result_iterations"]])
        if theirs:
            cost, r, t, _, iterations, _ = theirs[-1]
            times = [x[3] for x in theirs]
            rows.append([*row, "gtsam", cost, cost / p["result_cost"] - 1, *compare(p, r, t),
                         statistics.median(times), min(times), max(times), iterations])
        if not options.no_scipy:
            bundle = Bundle(p)
            found, seconds = bundle.solve()
            r, t = bundle.poses(found.x)
            rows.append([*row, "scipy", found.cost, found.cost / p["result_cost"] - 1, *compare(p, r, t),
                         seconds, seconds, seconds, found.nfev])
        for line in rows:
            print([float(v) if isinstance(v, np.floating) else v for v in line], flush=True)
    if options.csv:
        new = not os.path.exists(options.csv)
        with open(options.csv, "a", newline="") as f:
            out = csv.writer(f)
            new and out.writerow("poses loss outlier_share observations solver cost cost_relative_difference largest_position_m "
                         "largest_angle_rad median_s min_s max_s iterations".split())
            out.writerows(rows)


if __name__ == "__main__":
    main()
