"""Writes the logs that robots record (ROS 1 bags, ROS 2 bags as sqlite3 and MCAP) from a sequence folder.

No public log of a few megabytes holds images, odometry, calibration and mount together. These do, they are written by
the formats' own libraries and not by this project, and the right answer is known: a run on a log must give the poses of
a run on the folder (`crates/mono-slam/tests/it/recorded_logs.rs` runs them).

    python -m pip install rosbags==0.11.9 mcap==1.6.0 numpy pillow
    python xtask/scripts/make_bags.py fixtures/wall OUT          # every variant with all frames, into the folder OUT
    python xtask/scripts/make_bags.py fixtures/wall OUT --small  # the small files that are kept in fixtures/logs
    python xtask/scripts/make_bags.py fixtures/wall OUT --check target/release/mono-slam   # and runs each and the folder

The check prints the largest difference of a number of `trajectory.tum` to the run on the folder. It is 0 where the log
holds the folder's velocities (times, speeds, pixels, calibration and mount are then equal to the bit), and rounding where
speeds are differences of poses. Logs of wheel angles are written and not run: the program does not read them yet. It
ends with 1 where a difference is larger than a micrometre.

Messages bear the times of the sequence in their headers; the recorder "received" images 3 ms and odometry 1 ms later.
The mount stands in /tf_static as two transforms, body to camera and camera to optical frame. Odometry by pose is the
exact arcs of the folder's rows; wheel angles are those of a robot with wheels of 33 mm and a base of 160 mm.
"""

import argparse
import math
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from PIL import Image as Picture
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as FolderWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

WHEEL_RADIUS_M = 0.033
WHEEL_BASE_M = 0.160
IMAGE_DELAY_NS = 3_000_000
ODOMETRY_DELAY_NS = 1_000_000
BODY, CAMERA, OPTICAL = "base_link", "camera_link", "camera_optical_frame"


class Sequence:
    """The numbers of a sequence folder."""

    def __init__(self, folder, frames):
        """Reads times, odometry, camera and the names of the images; keeps the first `frames` images."""
        self.images = sorted((folder / "images").glob("*.png"))[:frames]
        times = [line for line in (folder / "times.txt").read_text().split("\n") if line and line[0] != "#"]
        self.times_ns = [nanoseconds(text) for text in times][:frames]
        rows = (folder / "odometry.csv").read_text().split("\n")[1:]
        rows = [line.split(",") for line in rows if line]
        self.rows = [(nanoseconds(t), float(v), float(w)) for t, v, w in rows]
        if frames is not None:
            self.rows = [row for row in self.rows if row[0] <= self.times_ns[-1] + 200_000_000]
        self.camera = tomllib.loads((folder / "camera.toml").read_text())


def nanoseconds(text):
    """A decimal number of seconds without rounding."""
    whole, _, part = text.strip().partition(".")
    return int(whole) * 1_000_000_000 + int((part + "000000000")[:9])


def quaternion(rotation):
    """x, y, z, w of a rotation matrix (Shepperd's method)."""
    r = np.asarray(rotation, float)
    squares = [1 + r[0, 0] - r[1, 1] - r[2, 2], 1 - r[0, 0] + r[1, 1] - r[2, 2], 1 - r[0, 0] - r[1, 1] + r[2, 2]]
    squares.append(1 + r[0, 0] + r[1, 1] + r[2, 2])
    largest = int(np.argmax(squares))
    i, j, k = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 1, 2)][largest]
    half = math.sqrt(squares[largest]) / 2
    q = [0.0] * 4
    if largest == 3:
        q = [(r[2, 1] - r[1, 2]) / (4 * half), (r[0, 2] - r[2, 0]) / (4 * half), (r[1, 0] - r[0, 1]) / (4 * half), half]
    else:
        q[i], q[j], q[k] = half, (r[j, i] + r[i, j]) / (4 * half), (r[k, i] + r[i, k]) / (4 * half)
        q[3] = (r[k, j] - r[j, k]) / (4 * half)
    return [float(value) for value in q]


def arcs(rows):
    """Poses (x, y, heading) at the times of the rows, along exact arcs."""
    x = y = heading = 0.0
    poses = []
    for index, (time_ns, v, w) in enumerate(rows):
        poses.append((time_ns, x, y, heading))
        if index + 1 < len(rows):
            dt = (rows[index + 1][0] - time_ns) / 1e9
            turn = w * dt
            chord = v * dt if abs(turn) < 1e-12 else v * dt * math.sin(turn / 2) / (turn / 2)
            x += chord * math.cos(heading + turn / 2)
            y += chord * math.sin(heading + turn / 2)
            heading += turn
    return poses


class Messages:
    """Messages of a sequence in one type store (ROS 1 or ROS 2)."""

    def __init__(self, sequence, store, start_ns):
        """Messages of `sequence` whose times begin at `start_ns`."""
        self.sequence, self.store, self.start_ns = sequence, store, start_ns
        self.types = store.types
        self.sequence_number = 0

    def header(self, time_ns, frame):
        """A header; that of ROS 1 has a sequence number."""
        time_ns += self.start_ns
        kind = self.types["std_msgs/msg/Header"]
        stamp = self.types["builtin_interfaces/msg/Time"](time_ns // 1_000_000_000, time_ns % 1_000_000_000)
        self.sequence_number += 1
        if "seq" in kind.__dataclass_fields__:
            return kind(seq=self.sequence_number, stamp=stamp, frame_id=frame)
        return kind(stamp=stamp, frame_id=frame)

    def vector(self, x, y, z, kind="Vector3"):
        """A vector or point."""
        return self.types[f"geometry_msgs/msg/{kind}"](float(x), float(y), float(z))

    def rotation(self, q):
        """A quaternion."""
        return self.types["geometry_msgs/msg/Quaternion"](*q)

    def images(self, compressed):
        """Images as raw grey pixels, or as the PNG files."""
        for path, time_ns in zip(self.sequence.images, self.sequence.times_ns):
            header = self.header(time_ns, OPTICAL)
            if compressed:
                data = np.frombuffer(path.read_bytes(), np.uint8)
                kind, message = "CompressedImage", (header, "mono8; png compressed", data)
            else:
                pixels = np.asarray(Picture.open(path).convert("L"))
                height, width = pixels.shape
                kind, message = "Image", (header, height, width, "mono8", 0, width, pixels.reshape(-1))
            name = f"sensor_msgs/msg/{kind}"
            topic = "/camera/image_raw/compressed" if compressed else "/camera/image_raw"
            yield time_ns + IMAGE_DELAY_NS, topic, name, self.types[name](*message)

    def camera_info(self):
        """The calibration beside every image."""
        c = self.sequence.camera
        k = [c["fx"], 0, c["cx"], 0, c["fy"], c["cy"], 0, 0, 1]
        p = [c["fx"], 0, c["cx"], 0, 0, c["fy"], c["cy"], 0, 0, 0, 1, 0]
        roi = self.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        name = "sensor_msgs/msg/CameraInfo"
        for time_ns in self.sequence.times_ns:
            values = [np.array(list(v), float) for v in (np.zeros(5), k, np.eye(3).reshape(-1), p)]
            header = self.header(time_ns, OPTICAL)
            message = self.types[name](header, c["height"], c["width"], "plumb_bob", *values, 0, 0, roi)
            yield time_ns + IMAGE_DELAY_NS, "/camera/camera_info", name, message

    def odometry(self, twist, pose):
        """Odometry with the velocities, with the poses, or with both."""
        name = "nav_msgs/msg/Odometry"
        g = "geometry_msgs/msg/"
        for (time_ns, v, w), (_, x, y, heading) in zip(self.sequence.rows, arcs(self.sequence.rows)):
            if not pose:
                x = y = heading = 0.0
            if not twist:
                v = w = 0.0
            q = self.rotation([0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)])
            placed = self.types[g + "PoseWithCovariance"](
                self.types[g + "Pose"](self.vector(x, y, 0, "Point"), q), np.zeros(36))
            moved = self.types[g + "TwistWithCovariance"](
                self.types[g + "Twist"](self.vector(v, 0, 0), self.vector(0, 0, w)), np.zeros(36))
            message = self.types[name](self.header(time_ns, "odom"), BODY, placed, moved)
            yield time_ns + ODOMETRY_DELAY_NS, "/odom", name, message

    def twists(self):
        """Velocities with a header."""
        name, twist = "geometry_msgs/msg/TwistStamped", self.types["geometry_msgs/msg/Twist"]
        for time_ns, v, w in self.sequence.rows:
            message = self.types[name](self.header(time_ns, BODY), twist(self.vector(v, 0, 0), self.vector(0, 0, w)))
            yield time_ns + ODOMETRY_DELAY_NS, "/cmd_vel_stamped", name, message

    def joints(self):
        """Angles of the two wheels, the right one first, a third joint beside them."""
        name = "sensor_msgs/msg/JointState"
        left = right = 0.0
        rows = self.sequence.rows
        for index, (time_ns, v, w) in enumerate(rows):
            position = np.array([right, 0.3, left])
            names = ["wheel_right_joint", "pan_joint", "wheel_left_joint"]
            message = self.types[name](self.header(time_ns, ""), names, position, np.zeros(0), np.zeros(0))
            yield time_ns + ODOMETRY_DELAY_NS, "/joint_states", name, message
            if index + 1 < len(rows):
                dt = (rows[index + 1][0] - time_ns) / 1e9
                left += (v - w * WHEEL_BASE_M / 2) * dt / WHEEL_RADIUS_M
                right += (v + w * WHEEL_BASE_M / 2) * dt / WHEEL_RADIUS_M

    def mount(self):
        """The mount as two static transforms."""
        name, g = "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/"
        mount = self.sequence.camera["mount"]
        body_from_optical = np.array(mount["rotation_body_from_camera"], float)
        link_from_optical = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float)
        body_from_link = body_from_optical @ link_from_optical.T

        def transform(parent, child, position, rotation):
            inner = self.types[g + "Transform"](self.vector(*position), self.rotation(quaternion(rotation)))
            return self.types[g + "TransformStamped"](self.header(0, parent), child, inner)

        message = self.types[name]([
            transform(CAMERA, OPTICAL, (0, 0, 0), link_from_optical),
            transform(BODY, CAMERA, mount["position_in_body"], body_from_link),
        ])
        yield 0, "/tf_static", name, message


def in_order(*streams):
    """All messages in the order in which a recorder receives them."""
    return sorted((message for stream in streams for message in stream), key=lambda message: message[0])


def write_bag(path, compression, messages, store, start_ns):
    """A ROS 1 bag."""
    path.unlink(missing_ok=True)
    writer = BagWriter(path)
    if compression:
        writer.set_compression(BagWriter.CompressionFormat[compression.upper()])
    with writer:
        connections = {}
        for time_ns, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], start_ns + time_ns, store.serialize_ros1(message, kind))


def write_folder(path, plugin, message_compression, messages, store, start_ns):
    """A ROS 2 bag: a folder with metadata.yaml."""
    shutil.rmtree(path, ignore_errors=True)
    writer = FolderWriter(path, version=9, storage_plugin=plugin)
    if message_compression:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for time_ns, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], start_ns + time_ns, store.serialize_cdr(message, kind))


def write_mcap(path, compression, messages, store, start_ns, chunk_size=200_000):
    """A bare MCAP file."""
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk_size, compression=CompressionType[compression])
        writer.start(profile="ros2", library="make_bags.py")
        channels = {}
        for index, (time_ns, topic, kind, message) in enumerate(messages):
            if topic not in channels:
                text, _ = store.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=text.encode())
                channels[topic] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            time_ns += start_ns
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], log_time=time_ns, publish_time=time_ns, sequence=index, data=data)
        writer.finish()


def write_unfinished_db3(path, messages, store):
    """A database as a killed recorder leaves it: its last pages still lie in the write-ahead log."""
    work = path.with_suffix(".work")
    for old in (work, path, Path(f"{path}-wal")):
        old.unlink(missing_ok=True)
    base = sqlite3.connect(work, isolation_level=None)
    base.execute("PRAGMA page_size = 1024")
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
                 "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)")
    base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
                 "timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
    topics = {}
    for index, (time_ns, topic, kind, message) in enumerate(messages):
        if topic not in topics:
            topics[topic] = len(topics) + 1
            base.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (topics[topic], topic, kind))
        row = (topics[topic], time_ns, bytes(store.serialize_cdr(message, kind)))
        base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
        if index == len(messages) // 2:
            base.execute("PRAGMA wal_checkpoint(FULL)")
    shutil.copy(work, path)
    shutil.copy(f"{work}-wal", f"{path}-wal")
    base.close()
    work.unlink()


def main():
    """Writes the variants."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--small", action="store_true", help="four frames in three small files")
    parser.add_argument("--start", type=int, default=0, help="seconds added to all times")
    parser.add_argument("--check", metavar="PROGRAM", help="run mono-slam on the folder and on every log, and compare")
    arguments = parser.parse_args()
    out, start_ns = arguments.out, arguments.start * 1_000_000_000
    out.mkdir(parents=True, exist_ok=True)
    sequence = Sequence(arguments.sequence, 4 if arguments.small else None)
    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    for store in (ros1, ros2):
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    one, two = Messages(sequence, ros1, start_ns), Messages(sequence, ros2, start_ns)

    def all_of(m, compressed=False, twist=True, pose=True, odometry=None):
        odometry = m.odometry(twist, pose) if odometry is None else odometry
        return in_order(m.mount(), m.images(compressed), m.camera_info(), odometry)

    if arguments.small:
        write_bag(out / "wall.bag", "bz2", all_of(one), ros1, start_ns)
        write_mcap(out / "wall.mcap", "ZSTD", all_of(two, compressed=True), ros2, start_ns, 60_000)
        write_unfinished_db3(out / "unfinished.db3", in_order(two.mount(), two.camera_info(), two.odometry(True, True)),
                             ros2)
        return
    write_bag(out / "ros1_none.bag", None, all_of(one, pose=False), ros1, start_ns)
    write_bag(out / "ros1_lz4_compressed_image.bag", "lz4", all_of(one, compressed=True), ros1, start_ns)
    write_bag(out / "ros1_bz2_poses.bag", "bz2", all_of(one, twist=False), ros1, start_ns)
    write_bag(out / "ros1_twist_stamped.bag", "lz4", all_of(one, odometry=one.twists()), ros1, start_ns)
    write_bag(out / "ros1_joints.bag", None, all_of(one, odometry=one.joints()), ros1, start_ns)
    write_folder(out / "db3", StoragePlugin.SQLITE3, False, all_of(two), ros2, start_ns)
    write_folder(out / "db3_zstd_messages", StoragePlugin.SQLITE3, True, all_of(two), ros2, start_ns)
    write_folder(out / "mcap_folder", StoragePlugin.MCAP, False, all_of(two, compressed=True), ros2, start_ns)
    write_mcap(out / "mcap_none.mcap", "NONE", all_of(two, pose=False), ros2, start_ns)
    write_mcap(out / "mcap_lz4_poses.mcap", "LZ4", all_of(two, twist=False), ros2, start_ns)
    write_mcap(out / "mcap_zstd_compressed_image.mcap", "ZSTD", all_of(two, compressed=True), ros2, start_ns)
    write_mcap(out / "mcap_zstd_joints.mcap", "ZSTD", all_of(two, odometry=two.joints()), ros2, start_ns)
    (out / "robot.toml").write_text(f"[wheels]\nwheel_radius_m = {WHEEL_RADIUS_M}\nbase_m = {WHEEL_BASE_M}\n")
    if arguments.check and check(arguments.check, arguments.sequence, out) > 1e-6:
        sys.exit(1)


def trajectory(program, sequence, out):
    """The numbers of the trajectory of a run."""
    subprocess.run([program, "run", sequence, "--out", out, "--quiet"], check=True)
    return np.loadtxt(out / "trajectory.tum")


def check(program, folder, logs):
    """Compares the run on every log with the run on the folder; the largest difference."""
    largest = 0.0
    with tempfile.TemporaryDirectory() as scratch:
        expected = trajectory(program, folder, Path(scratch) / "folder")
        for log in sorted(path for path in logs.iterdir() if path.suffix != ".toml"):
            own = trajectory(program, log, Path(scratch) / log.name)
            difference = float(np.abs(own - expected).max()) if own.shape == expected.shape else math.inf
            largest = max(largest, difference)
            print(f"{log.name:<36}{difference:.3g}")
    return largest


if __name__ == "__main__":
    main()
