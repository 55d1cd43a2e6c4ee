//! Odometry in every form a robot may log it: wheels, steering, poses, a gyroscope, headers of its own.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::common::{ScratchFolder, data_folder};
use image::{GrayImage, Luma};
use mono_geometry::Se2;
use mono_geometry::motion::exact_arc;
use slam_io::{OdometryRow, OdometrySource, Sequence};

const CAMERA: &str =
    "width = 8\nheight = 6\nmodel = \"pinhole\"\nfx = 10.0\nfy = 11\ncx = 3.5\ncy = 2.5\n";
const ROBOT: &str = "[wheels]\nmetres_per_tick = 0.001\nbase_m = 0.2\n";

/// A sequence of images at `times_s` with the given text files.
pub(crate) fn sequence(times_s: &[f64], files: &[(&str, &str)]) -> ScratchFolder {
    let folder = ScratchFolder::new();
    let root = folder.path();
    fs::create_dir_all(root.join("images")).unwrap();
    let mut times = String::new();
    for (index, time) in times_s.iter().enumerate() {
        GrayImage::from_fn(8, 6, |x, y| Luma([(30 * x + 5 * y) as u8]))
            .save(root.join(format!("images/{index:06}.png")))
            .unwrap();
        writeln!(times, "{time}").unwrap();
    }
    fs::write(root.join("times.txt"), times).unwrap();
    fs::write(root.join("camera.toml"), CAMERA).unwrap();
    for (name, text) in files {
        fs::write(root.join(name), text).unwrap();
    }
    folder
}

fn open(times_s: &[f64], files: &[(&str, &str)]) -> Sequence {
    Sequence::open(sequence(times_s, files).path()).unwrap()
}

fn fault(times_s: &[f64], files: &[(&str, &str)]) -> String {
    let folder = sequence(times_s, files);
    let message = Sequence::open(folder.path()).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message:?} is one line");
    message.replace(&*folder.path().to_string_lossy(), "SEQ")
}

pub(crate) fn names(sequence: &Sequence) -> Vec<&str> {
    sequence.warnings.iter().map(|w| w.name.as_str()).collect()
}

fn end(rows: &[OdometryRow]) -> Se2 {
    rows.windows(2).fold(Se2::identity(), |pose, pair| {
        pose.compose(&exact_arc(
            pair[0].v_mps,
            pair[0].omega_radps,
            pair[1].t_s - pair[0].t_s,
        ))
    })
}

fn way_m(rows: &[OdometryRow]) -> f64 {
    rows.windows(2)
        .map(|pair| pair[0].v_mps * (pair[1].t_s - pair[0].t_s))
        .sum()
}

pub(crate) const TWO: [f64; 2] = [0.0, 1.0];

#[test]
fn wheels_give_back_their_way_and_their_turn() {
    // 0.4 m straight in uneven steps, half a turn on the spot to the left, 0.1 m back.
    let half = (std::f64::consts::PI * 100.0).round() as i64;
    let counts = [
        (0.0, 1000, 1000),
        (0.3, 1150, 1150),
        (0.4, 1400, 1400),
        (0.9, 1400 - half, 1400 + half),
        (1.0, 1300 - half, 1300 + half),
    ];
    let mut text = String::from("t_s,left_ticks,right_ticks\n");
    for (t_s, left, right) in counts {
        writeln!(text, "{t_s},{left},{right}").unwrap();
    }
    let folder = sequence(&TWO, &[("wheels.csv", &text), ("robot.toml", ROBOT)]);
    let read = Sequence::open(folder.path()).unwrap();
    assert_eq!(read.odometry_source, OdometrySource::Wheels);
    assert!(names(&read).is_empty(), "{:?}", read.warnings);
    let times: Vec<f64> = read.odometry.iter().map(|row| row.t_s).collect();
    assert_eq!(times, [0.0, 0.3, 0.4, 0.9, 1.0]);
    let pose = end(&read.odometry);
    let turn = half as f64 * 0.002 / 0.2;
    assert!(
        (pose.x - (0.4 - 0.1 * turn.cos())).abs() < 1e-12,
        "{pose:?}"
    );
    assert!((pose.y + 0.1 * turn.sin()).abs() < 1e-12, "{pose:?}");
    assert_eq!(read.odometry[2].v_mps, 0.0);
    assert!(read.odometry[2].omega_radps > 0.0, "left is positive");
    // The copy beside the results reads back to the same rows.
    let files = read.input_files().unwrap();
    let again = ScratchFolder::new();
    for (name, bytes) in files {
        fs::write(again.path().join(name), bytes).unwrap();
    }
    let (_, rows) = slam_io::read_run_inputs(again.path(), 0.0).unwrap();
    assert_eq!(rows, read.odometry);
}

#[test]
fn wheels_of_every_description_drive_the_same_way() {
    let cumulative = "t_s,left_ticks,right_ticks\n0,0,0\n0.5,100,120\n1,180,260\n";
    let since = "t_s,left_ticks,right_ticks\n0,7,7\n0.5,100,120\n1,80,140\n";
    let wrapped = "Time\tRight_Ticks\tLeft_Ticks\tbattery\n0\t32700\t-32700\t11.9\n0.5\t-32716\t-32600\t11.9\n1\t-32576\t-32520\t11.9\n";
    let expected = open(&TWO, &[("wheels.csv", cumulative), ("robot.toml", ROBOT)]).odometry;
    let per_turn = std::f64::consts::TAU * 0.05 / 0.001;
    let radius =
        format!("[wheels]\nwheel_radius_m = 0.05\nticks_per_turn = {per_turn}\nbase_m = 0.2\n");
    let sides = format!(
        "[wheels]\nleft_wheel_radius_m = 0.05\nright_wheel_radius_m = 0.05\nticks_per_turn = {per_turn}\nbase_m = 0.2\n"
    );
    for (wheels, robot) in [
        (since, format!("{ROBOT}counts = \"since_last_row\"\n")),
        (wrapped, format!("{ROBOT}tick_range = [-32768, 32767]\n")),
        (cumulative, radius),
        (cumulative, sides),
    ] {
        let rows = open(&TWO, &[("wheels.csv", wheels), ("robot.toml", &robot)]).odometry;
        assert_eq!(rows.len(), expected.len(), "{robot}");
        for (row, expected) in rows.iter().zip(&expected) {
            assert_eq!(row.t_s, expected.t_s, "{robot}");
            assert!(
                (row.v_mps - expected.v_mps).abs() < 1e-12,
                "{robot}: {row:?}"
            );
            assert!(
                (row.omega_radps - expected.omega_radps).abs() < 1e-11,
                "{robot}: {row:?}"
            );
        }
    }
}

#[test]
fn jumps_that_no_wheel_makes_are_refused_with_their_likely_cause() {
    let mut wrap = String::from("t_s,left_ticks,right_ticks\n");
    for i in 0..20_i64 {
        let count = (32_000 + 100 * i + 32_768) % 65_536 - 32_768;
        writeln!(wrap, "{},{count},{}", 0.1 * i as f64, 100 * i).unwrap();
    }
    // 65 m in a tenth of a second, and 6.5 m, which is a speed that a car has.
    for metres in ["0.001", "0.0001"] {
        let robot = format!("[wheels]\nmetres_per_tick = {metres}\nbase_m = 0.2\n");
        let message = fault(&TWO, &[("wheels.csv", &wrap), ("robot.toml", &robot)]);
        assert!(
            message.starts_with(
                "SEQ/wheels.csv, line 10: expected a left count that a wheel can reach in 0.100 s, found a step of -65436 ticks"
            ),
            "{message}"
        );
        assert!(
            message.contains("tick_range = [-32768, 32767]"),
            "{message}"
        );
    }
    let byte = "t_s,left_ticks,right_ticks\n0,240,0\n1,245,5\n2,250,10\n3,255,15\n4,4,20\n5,9,25\n";
    let message = fault(&TWO, &[("wheels.csv", byte), ("robot.toml", ROBOT)]);
    assert!(
        message.contains("line 6") && message.contains("tick_range = [0, 255]"),
        "{message}"
    );
    let since = "t_s,left_ticks,right_ticks\n0,0,0\n0.1,9000,9000\n0.2,0,0\n0.3,9000,9000\n";
    let message = fault(&TWO, &[("wheels.csv", since), ("robot.toml", ROBOT)]);
    assert!(message.contains("counts = \"since_last_row\""), "{message}");
}

#[test]
fn what_wheels_lack_is_named() {
    let counts = (
        "wheels.csv",
        "t_s,left_ticks,right_ticks\n0,0,0\n1,100,120\n",
    );
    let cases = [
        (
            "[wheels]\nbase_m = 0.2\n",
            "SEQ/robot.toml: expected metres_per_tick, or wheel_radius_m and ticks_per_turn, in [wheels] to read wheels.csv, found none",
        ),
        (
            "[wheels]\nmetres_per_tick = 0.001\n",
            "SEQ/robot.toml: expected base_m, the distance between the two wheels, in [wheels] to read wheels.csv, found none",
        ),
        (
            "[wheels]\nmetres_per_tick = -1\nbase_m = 0.2\n",
            "SEQ/robot.toml: expected a positive metres_per_tick in [wheels], found -1",
        ),
        (
            "[wheels]\nleft_wheel_radius_m = 1\nbase_m = 0.2\n",
            "SEQ/robot.toml: expected left_wheel_radius_m and right_wheel_radius_m in [wheels], found one of them",
        ),
        (
            "[wheels]\nmetres_per_tick = 0.001\nbase_m = 0.2\ntick_range = [5, 5]\n",
            "SEQ/robot.toml: expected tick_range = [smallest, largest] in [wheels], found [5, 5]",
        ),
        (
            "[wheels]\nmetres_per_tick = 0.001\nbase_m = 0.2\ntick_range = [0, 110]\n",
            "SEQ/wheels.csv, line 3: expected right_ticks within tick_range = [0, 110] of robot.toml, found 120",
        ),
        (
            "[steering]\nwheelbase_m = 1\n",
            "SEQ/robot.toml: expected the wheels for wheels.csv: [wheels] with metres_per_tick (or wheel_radius_m and ticks_per_turn) and base_m, found no [wheels]",
        ),
    ];
    for (robot, expected) in cases {
        assert_eq!(fault(&TWO, &[counts, ("robot.toml", robot)]), expected);
    }
    let unknown = fault(&TWO, &[counts, ("robot.toml", "[wheels]\nbase = 0.2\n")]);
    assert!(
        unknown.starts_with("SEQ/robot.toml, line 2: expected [wheels] or [steering] of a robot, found unknown field `base`"),
        "{unknown}"
    );
    let missing = fault(&TWO, &[counts]);
    assert!(
        missing.starts_with("SEQ/robot.toml: not found; it holds the wheels for wheels.csv"),
        "{missing}"
    );
    let half = (
        "wheels.csv",
        "t_s,left_ticks,right_ticks\n0,0,0\n1,100.5,120\n",
    );
    assert_eq!(
        fault(&TWO, &[half, ("robot.toml", ROBOT)]),
        "SEQ/wheels.csv, line 3: expected a whole number for left_ticks, found 100.5"
    );
}

#[test]
fn coarse_encoders_are_named() {
    let robot = "[wheels]\nwheel_radius_m = 0.033\nticks_per_turn = 20\nbase_m = 0.15\n";
    let counts = "t_s,left_ticks,right_ticks\n0,0,0\n0.5,10,10\n1,20,20\n";
    let read = open(&TWO, &[("wheels.csv", counts), ("robot.toml", robot)]);
    assert_eq!(names(&read), ["coarse-encoders"]);
    assert!(
        read.warnings[0]
            .message
            .starts_with("One tick of a wheel is 10.4 mm and turns the robot by 0.069 rad")
    );
}

/// A circle at 2 m/s with the front wheel at 0.2 rad, in the two units and through a steering wheel.
#[test]
fn steering_turns_the_rear_axle() {
    let omega = 2.0 * 0.2_f64.tan() / 2.5;
    let wheel = (0.2_f64 * 15.0 + 0.03).to_degrees();
    let degrees =
        format!("t_s,v_mps,steering_wheel_deg\n0,2,{wheel}\n0.5,2,{wheel}\n1,2,{wheel}\n");
    for (name, text, robot) in [
        (
            "steering.csv",
            "t_s,v_mps,steering_rad\n0,2,0.2\n0.5,2,0.2\n1,2,0.2\n",
            "[steering]\nwheelbase_m = 2.5\n",
        ),
        (
            "odometry.csv",
            "t_s,v_mps,steering_rad\n0,2,0.2\n0.5,2,0.2\n1,2,0.2\n",
            "[steering]\nwheelbase_m = 2.5\n",
        ),
        (
            "steering.csv",
            &degrees,
            "[steering]\nwheelbase_m = 2.5\nratio = 15\noffset_rad = 0.03\n",
        ),
    ] {
        let folder = sequence(&TWO, &[(name, text), ("robot.toml", robot)]);
        let read = Sequence::open(folder.path()).unwrap();
        assert_eq!(read.odometry_source, OdometrySource::Steering);
        for row in &read.odometry {
            assert!((row.omega_radps - omega).abs() < 1e-12, "{name}: {row:?}");
        }
        let files = read.input_files().unwrap();
        assert!(files.iter().any(|(name, bytes)| *name == "odometry.csv"
            && bytes.starts_with(b"t_s,v_mps,omega_radps\n")));
    }
    let text = ("steering.csv", "t_s,v_mps,steering_rad\n0,2,0.2\n1,2,0.2\n");
    assert_eq!(
        fault(&TWO, &[text]),
        "SEQ/robot.toml: expected wheelbase_m, the distance between the axles, in [steering] to read a steering angle, found no robot.toml"
    );
    let wheel = ("steering.csv", "t_s,v_mps,steering_rad\n0,2,4\n1,2,4\n");
    let message = fault(
        &TWO,
        &[wheel, ("robot.toml", "[steering]\nwheelbase_m = 2.5\n")],
    );
    assert!(message.contains("line 2: expected an angle of the front wheels of at most 1.4 rad, found 4.000 rad; degrees"), "{message}");
}

#[test]
fn a_gyroscope_replaces_the_turn_of_the_wheels() {
    let counts = (
        "wheels.csv",
        "t_s,left_ticks,right_ticks\n0,0,0\n0.5,100,100\n1,200,200\n",
    );
    let gyro = (
        "gyro.csv",
        "t_s,omega_radps\n-0.1,0.3\n0.2,0.3\n0.5,0.3\n0.8,0.3\n1.1,0.3\n",
    );
    let read = open(&TWO, &[counts, gyro, ("robot.toml", ROBOT)]);
    assert_eq!(names(&read), ["turn-rate-from-gyro"]);
    for row in &read.odometry {
        assert!((row.omega_radps - 0.3).abs() < 1e-12, "{row:?}");
        assert!((row.v_mps - 0.2).abs() < 1e-12);
    }
    // Then the base may be unknown.
    let robot = ("robot.toml", "[wheels]\nmetres_per_tick = 0.001\n");
    assert_eq!(open(&TWO, &[counts, gyro, robot]).odometry, read.odometry);
}

#[test]
fn poses_are_read_as_their_differences() {
    let steps = [(0.5, 0.4), (0.4, -0.2), (-0.2, 0.0)];
    let mut pose = Se2::new(1.0, 2.0, 0.5);
    let mut planar = String::from("t_s,x_m,y_m,phi_rad\n");
    let mut tum = String::from("# t x y z qx qy qz qw\n");
    for index in 0..=steps.len() {
        let t_s = 0.5 * index as f64;
        let Se2 { x, y, phi } = pose;
        writeln!(planar, "{t_s},{x},{y},{phi}").unwrap();
        let (sin, cos) = (0.5 * phi).sin_cos();
        writeln!(tum, "{t_s} {x} {y} 0.1 0 0 {sin} {cos}").unwrap();
        if let Some((v, omega)) = steps.get(index) {
            pose = pose.compose(&exact_arc(*v, *omega, 0.5));
        }
    }
    for text in [&planar, &tum] {
        let read = open(&[0.0, 0.5, 1.0], &[("odometry.csv", text)]);
        assert_eq!(names(&read), ["odometry-from-poses"]);
        assert_eq!(
            read.warnings[0].message,
            "odometry.csv holds poses: the speeds are their differences, 3 in all."
        );
        for (row, (v, omega)) in read.odometry.iter().zip(steps) {
            assert!((row.v_mps - v).abs() < 1e-12, "{row:?}");
            assert!((row.omega_radps - omega).abs() < 1e-12, "{row:?}");
        }
    }
    assert_eq!(
        fault(&TWO, &[("odometry.csv", "t_s,x_m,y_m,phi_rad\n0,0,0,0\n")]),
        "SEQ/odometry.csv: expected at least two poses, a motion is their difference, found 1"
    );
}

#[test]
fn regress_headers_of_other_programs_are_read_by_name() {
    // Capitals, tabs, other names, another order and columns that nobody asked for were refused.
    let rows = "0,0.1,0.2\n0.5,0.3,0.4\n1,0.5,-0.6\n";
    let native = format!("t_s,v_mps,omega_radps\n{rows}");
    let expected = open(&TWO, &[("odometry.csv", &native)]).odometry;
    let other_order = "\"omega_radps\", \"t_s\", \"dist\", \"v_mps\"\n0.2,0,9,0.1\n0.4, 0.5, 9, 0.3\n-0.6,1,9,0.5\n";
    let cases = [
        (native.to_uppercase(), 0),
        (native.replace(',', "\t"), 0),
        (native.replace(',', ";"), 0),
        (native.replace(',', "  "), 0),
        (format!("\u{feff}# {native}"), 0),
        (
            native.replace("t_s,v_mps,omega_radps", "timestamp,linear_x,angular_z"),
            1,
        ),
        (native.replace("t_s,v_mps,omega_radps", "t,v,w"), 1),
        (other_order.to_owned(), 1),
    ];
    for (text, remarks) in &cases {
        let read = open(&TWO, &[("odometry.csv", text)]);
        assert_eq!(read.odometry, expected, "{text}");
        assert_eq!(names(&read), vec!["odometry-columns"; *remarks], "{text}");
    }
    let read = open(&TWO, &[("odometry.csv", &cases[5].0)]);
    assert_eq!(
        read.warnings[0].message,
        "odometry.csv: timestamp is read as t_s; linear_x is read as v_mps; angular_z is read as omega_radps."
    );
    let read = open(&TWO, &[("odometry.csv", other_order)]);
    assert_eq!(read.warnings[0].message, "odometry.csv: not read: dist.");
    // Another unit is another quantity.
    let message = fault(&TWO, &[("odometry.csv", "t_s,v_kmh,omega_degps\n0,1,1\n")]);
    assert_eq!(
        message,
        "SEQ/odometry.csv, line 1: expected the header t_s,v_mps,omega_radps, found \"t_s,v_kmh,omega_degps\""
    );
}

#[test]
fn units_that_do_not_fit_are_named() {
    let millimetres = fault(
        &TWO,
        &[("odometry.csv", "t_s,v_mps,omega_radps\n0,180,0\n1,190,0\n")],
    );
    assert_eq!(
        millimetres,
        "SEQ/odometry.csv, line 2: expected |v_mps| of at most 100, found 180 (in millimetres per second? v_mps is in metres per second)"
    );
    let degrees = "t_s,v_mps,omega_radps\n0,0.2,-17.2\n1,0.2,3\n";
    let read = open(&TWO, &[("odometry.csv", degrees)]);
    assert_eq!(names(&read), ["turn-rate-implausible"]);
    assert_eq!(
        read.warnings[0].message,
        "The largest omega_radps is 17.2, 2.7 turns a second: if it is in degrees per second, it is 0.30 rad/s."
    );
    assert_eq!(read.odometry[0].omega_radps, -17.2, "nothing is changed");
}

#[test]
fn regress_a_first_row_shortly_after_the_first_image_is_accepted() {
    // A row 50 ms late was refused.
    let mut text = String::from("t_s,v_mps,omega_radps\n");
    for i in 0..20 {
        writeln!(text, "{},0.2,0.1", 0.05 + 0.1 * f64::from(i)).unwrap();
    }
    let read = open(&[0.0, 0.5, 1.0], &[("odometry.csv", &text)]);
    assert_eq!(names(&read), ["odometry-begins-late"]);
    assert_eq!(
        read.warnings[0].message,
        "odometry.csv begins 0.05 s after the first image: its first speed is taken for that time, too."
    );
    let held: f64 = read
        .odometry_between(0.0, 0.5)
        .iter()
        .map(|piece| piece.0)
        .sum();
    assert!((held - 0.5).abs() < 1e-12);
}

#[test]
fn regress_speeds_held_for_long_are_named() {
    // Odometry that ended at 3 s of 9.5 s was held on without a word.
    let mut text = String::from("t_s,v_mps,omega_radps\n");
    for i in 0..=30 {
        if !(8..20).contains(&i) {
            writeln!(text, "{},0.2,0.1", 0.1 * f64::from(i)).unwrap();
        }
    }
    let images = [0.0, 1.0, 5.0, 9.5];
    let read = open(&images, &[("odometry.csv", &text)]);
    assert_eq!(names(&read), ["odometry-ends-early", "odometry-hole"]);
    assert_eq!(
        read.warnings[0].message,
        "odometry.csv ends at 3 s, the images at 9.5 s: for 6.5 s its last speed is held, 0.20 m/s and 0.10 rad/s."
    );
    let holes = read.odometry_holes();
    assert_eq!(holes.len(), 2);
    assert!((holes[0].0 - 0.7).abs() < 1e-12 && (holes[0].1 - 2.0).abs() < 1e-12);
    assert_eq!(holes[1], (3.0, 9.5));
}

#[test]
fn one_file_of_several_is_read_and_named() {
    let speeds = ("odometry.csv", "t_s,v_mps,omega_radps\n0,1,0\n1,1,0\n");
    let counts = ("wheels.csv", "t_s,left_ticks,right_ticks\n0,0,0\n1,9,9\n");
    let read = open(&TWO, &[speeds, counts, ("robot.toml", ROBOT)]);
    assert_eq!(
        read.odometry_source,
        OdometrySource::File("odometry.csv".into())
    );
    assert_eq!(
        read.warnings[0].to_string(),
        "[odometry-not-used] odometry.csv is read, wheels.csv is not."
    );
}

/// Copies the data lines of a file with other names for its columns.
fn renamed(path: &Path, header: &str) -> String {
    let text = fs::read_to_string(path).unwrap();
    format!("{header}\n{}", text.split_once('\n').unwrap().1)
}

/// Two drives of a differential robot with four wheels through corridors and back. Its encoders give ticks since the last
/// row; a wheel of this program is the sum of the front and the rear wheel of a side, its tick half the 2.2 mm of one. With
/// the gyroscope the paths end 2.9 and 3.0 m from their start (notes of the data set, which integrate a little
/// differently), after 96 and 92 m.
#[test]
fn val_ucsd_wheels_and_gyroscope_come_back_to_the_start() {
    let Some(folder) = data_folder("ucsd_diffdrive_logs") else {
        return;
    };
    for (number, length_m, gap_m) in [(20, 96.0, 2.9), (21, 92.0, 3.0)] {
        let text = fs::read_to_string(folder.join(format!("encoders{number}.csv"))).unwrap();
        let mut wheels = String::from("t_s,left_ticks,right_ticks\n");
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let ticks = |index: usize| cells[index].parse::<i64>().unwrap();
            // front right, front left, rear right, rear left
            writeln!(
                wheels,
                "{},{},{}",
                cells[0],
                ticks(2) + ticks(4),
                ticks(1) + ticks(3)
            )
            .unwrap();
        }
        let gyro = renamed(
            &folder.join(format!("imu{number}.csv")),
            "t_s,wx,wy,omega_radps",
        );
        let robot =
            "[wheels]\nmetres_per_tick = 0.0011\nbase_m = 0.4\ncounts = \"since_last_row\"\n";
        let read = open(
            &[0.0, 100.0],
            &[
                ("wheels.csv", &wheels),
                ("gyro.csv", &gyro),
                ("robot.toml", robot),
            ],
        );
        let way = way_m(&read.odometry);
        assert!((way - length_m).abs() < 0.5, "drive {number}: {way} m");
        let last = end(&read.odometry);
        let gap = last.x.hypot(last.y);
        assert!(
            (gap - gap_m).abs() < 0.25,
            "drive {number} ends {gap} m from its start"
        );
        assert_eq!(names(&read), ["turn-rate-from-gyro"], "{:?}", read.warnings);
    }
}

/// A car over one kilometre: the mean of its four wheel speeds and the angle of its steering wheel. By pose it drove
/// 1011.8 m, by wheels 1003.2 m: a scale error of -0.85 %.
#[test]
fn val_comma_wheels_are_short_by_their_known_scale() {
    let Some(folder) = data_folder("comma2k19_seg40_odometry") else {
        return;
    };
    let numbers = |name: &str| -> Vec<Vec<f64>> {
        let text = fs::read_to_string(folder.join(name)).unwrap();
        text.lines()
            .skip(1)
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect()
    };
    let (speeds, angles) = (numbers("wheel_speed.csv"), numbers("steering.csv"));
    let mut text = String::from("t_s,v_mps,steering_wheel_deg\n");
    for (speed, angle) in speeds.iter().zip(&angles) {
        let mean = speed[1..].iter().sum::<f64>() / 4.0;
        writeln!(text, "{},{mean},{}", speed[0], angle[1]).unwrap();
    }
    // The wheels begin 42 ms after the first frame, three and a half of their intervals: it is left out.
    let truth = numbers("groundtruth_planar.csv").split_off(1);
    let (first, last) = (truth[0][1], truth[truth.len() - 1][1]);
    let length: f64 = truth
        .windows(2)
        .map(|pair| (pair[1][2] - pair[0][2]).hypot(pair[1][3] - pair[0][3]))
        .sum();
    assert!((length - 1011.0).abs() < 0.5, "{length}");
    // The ratio of its steering and the wheelbase of a saloon of its size; the road is almost straight.
    let robot = "[steering]\nwheelbase_m = 2.7\nratio = 15.3\n";
    let read = open(
        &[first, last],
        &[("steering.csv", &text), ("robot.toml", robot)],
    );
    assert_eq!(names(&read), ["odometry-columns"]);
    let pieces = read.odometry_between(first, last);
    let way: f64 = pieces.iter().map(|(duration, v, _)| duration * v).sum();
    let scale_error = way / length - 1.0;
    assert!(
        (scale_error + 0.0085).abs() < 0.0006,
        "{way} m for {length} m: {scale_error}"
    );
}
