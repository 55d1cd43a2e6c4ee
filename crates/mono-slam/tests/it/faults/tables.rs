//! Faults of times, odometry and ground truth.

use super::Outcome::{Refused, Same, Warned};
use super::{Fault, assert_outcomes, row};

const TIMES: &str = "seq/times.txt";
const ODOMETRY: &str = "seq/odometry.csv";
const TRUTH: &str = "seq/groundtruth_planar.csv";

fn times() -> Vec<Fault> {
    vec![
        row(
            "times are out of order",
            |i| i.write(TIMES, "0\n1\n0.5\n1.5\n2\n"),
            Refused(&["seq/times.txt, line 3: expected a time after 1 s, found 0.5 s"]),
        ),
        row(
            "a time is there twice",
            |i| i.write(TIMES, "0\n0.5\n0.5\n1.5\n2\n"),
            Refused(&[
                "seq/times.txt, line 3: expected a time after 0.5 s, found 0.5 s, equal to the time before",
            ]),
        ),
        row(
            "a time is no number",
            |i| i.line(TIMES, 3, "nan"),
            Refused(&[
                "seq/times.txt, line 3: expected a finite number for the time of an image, found \"nan\"",
            ]),
        ),
        row(
            "a time is infinite",
            |i| i.line(TIMES, 3, "1e999"),
            Refused(&[
                "seq/times.txt, line 3: expected a finite number for the time of an image, found \"1e999\"",
            ]),
        ),
        row(
            "a time is a word",
            |i| i.line(TIMES, 3, "noon"),
            Refused(&[
                "seq/times.txt, line 3: expected a finite number for the time of an image, found \"noon\"",
            ]),
        ),
        row(
            "a time is missing",
            |i| i.write(TIMES, "0\n0.5\n1\n1.5\n"),
            Refused(&["seq/times.txt: expected 5 times, one per image, found 4"]),
        ),
        row(
            "a time is one too many",
            |i| i.write(TIMES, "0\n0.5\n1\n1.5\n2\n2.5\n"),
            Refused(&["seq/times.txt: expected 5 times, one per image, found 6"]),
        ),
        row(
            "times have decimal commas",
            |i| i.edit(TIMES, |t| t.replace('.', ",")),
            Refused(&[
                "seq/times.txt, line 1: expected a finite number for the time of an image, found \"0,000000\"",
            ]),
        ),
        row(
            "times have three columns",
            |i| i.write(TIMES, "0 a b\n0.5 a b\n1 a b\n1.5 a b\n2 a b\n"),
            Refused(&[
                "seq/times.txt, line 1: expected a finite number for the time of an image, found \"0 a b\"",
            ]),
        ),
        row(
            "times end in CRLF behind a byte order mark",
            |i| i.edit(TIMES, |t| format!("\u{feff}{}", t.replace('\n', "\r\n"))),
            Same,
        ),
        row(
            "times are UTF-16",
            |i| {
                let wide: Vec<u8> =
                    format!("\u{feff}{}", String::from_utf8(i.bytes(TIMES)).unwrap())
                        .encode_utf16()
                        .flat_map(u16::to_le_bytes)
                        .collect();
                i.write(TIMES, wide);
            },
            Same,
        ),
        row(
            "times are in Latin-1",
            |i| i.write(TIMES, b"0 # d\xe9but\n0.5\n1\n1.5\n2\n"),
            Refused(&["seq/times.txt: expected UTF-8 text, found a foreign byte at offset 5"]),
        ),
        row(
            "times are empty",
            |i| i.write(TIMES, ""),
            Refused(&["seq/times.txt: expected 5 times, one per image, found 0"]),
        ),
        row(
            "times are zeros, as a disk leaves them",
            |i| i.write(TIMES, [0; 50]),
            Refused(&["seq/times.txt, line 1: expected a finite number"]),
        ),
        row(
            "times are a folder",
            |i| i.folder(TIMES),
            Refused(&["seq/times.txt: cannot be read: Is a directory"]),
        ),
        row(
            "times are missing",
            |i| i.remove(TIMES),
            Refused(&[
                "seq/times.txt: not found; it holds the time of every image",
                "--fps 10",
            ]),
        ),
        row(
            "times leap by a year",
            |i| i.line(TIMES, 5, "31536000"),
            Warned(&["odometry-ends-early", "reference-in-part"]),
        ),
        row(
            "times are milliseconds",
            |i| i.write(TIMES, "0\n500\n1000\n1500\n2000\n"),
            Refused(&["these look like milliseconds, divide them by 1e3"]),
        ),
        row(
            "times are of another day than the odometry",
            |i| i.write(TIMES, "86400\n86400.5\n86401\n86401.5\n86402\n"),
            Refused(&[
                "seq/odometry.csv: expected rows while the images were taken, 86400 to 86402 s",
                "do both clocks count seconds from the same moment?",
            ]),
        ),
    ]
}

fn odometry() -> Vec<Fault> {
    vec![
        row(
            "a speed is no number",
            |i| i.line(ODOMETRY, 4, "0.2,nan,0"),
            Refused(&[
                "seq/odometry.csv, line 4: expected a finite number for v_mps, found \"nan\"",
            ]),
        ),
        row(
            "a turn is infinite",
            |i| i.line(ODOMETRY, 4, "0.2,0.2,inf"),
            Refused(&[
                "seq/odometry.csv, line 4: expected a finite number for omega_radps, found \"inf\"",
            ]),
        ),
        row(
            "a speed is huge",
            |i| i.line(ODOMETRY, 4, "0.2,1e6,0"),
            Refused(&["seq/odometry.csv", "?"]),
        ),
        row(
            "a speed is beyond the numbers",
            |i| i.line(ODOMETRY, 4, "0.2,1e308,0"),
            Refused(&["seq/odometry.csv", "?"]),
        ),
        row(
            "a turn is huge",
            |i| i.line(ODOMETRY, 4, "0.2,0.2,1e6"),
            Refused(&["seq/odometry.csv", "?"]),
        ),
        row(
            "a speed is a thousand times too large",
            |i| i.line(ODOMETRY, 4, "0.2,99,0"),
            Warned(&["wheel-slip"]),
        ),
        row(
            "a time goes back",
            |i| i.line(ODOMETRY, 4, "0.05,0.2,0"),
            Refused(&["seq/odometry.csv, line 4: expected a time after 0.1 s, found 0.05 s"]),
        ),
        row(
            "a time is there twice",
            |i| i.line(ODOMETRY, 4, "0.1,0.2,0"),
            Refused(&[
                "seq/odometry.csv, line 4: expected a time after 0.1 s, found 0.1 s, equal to the time before",
            ]),
        ),
        row(
            "rows are missing",
            |i| {
                i.edit(ODOMETRY, |t| {
                    t.lines()
                        .enumerate()
                        .filter(|(n, _)| !(6..16).contains(n))
                        .map(|(_, l)| format!("{l}\n"))
                        .collect()
                });
            },
            Warned(&["odometry-hole"]),
        ),
        row(
            "it ends early",
            |i| i.edit(ODOMETRY, |t| t.split_inclusive('\n').take(8).collect()),
            Warned(&["odometry-ends-early"]),
        ),
        row(
            "it starts late",
            |i| {
                i.edit(ODOMETRY, |t| {
                    t.lines()
                        .enumerate()
                        .filter(|(n, _)| !(1..12).contains(n))
                        .map(|(_, l)| format!("{l}\n"))
                        .collect()
                });
            },
            Refused(&[
                "seq/odometry.csv, line 2: expected a first row no later than the first frame at 0 s, found 1.1 s; leave out the first 2 images",
            ]),
        ),
        row(
            "it is of another day",
            |i| {
                i.write(
                    ODOMETRY,
                    "t_s,v_mps,omega_radps\n86400,0.2,0\n86401,0.2,0\n",
                );
            },
            Refused(&["do both clocks count seconds from the same moment?"]),
        ),
        row(
            "one row is all",
            |i| i.write(ODOMETRY, "t_s,v_mps,omega_radps\n0,0.2,0\n"),
            Warned(&["odometry-one-row"]),
        ),
        row(
            "it is the header alone",
            |i| i.write(ODOMETRY, "t_s,v_mps,omega_radps\n"),
            Refused(&[
                "seq/odometry.csv: expected the header t_s,v_mps,omega_radps and at least one row, found the header alone",
            ]),
        ),
        row(
            "it is empty",
            |i| i.write(ODOMETRY, ""),
            Refused(&[
                "seq/odometry.csv: expected the header t_s,v_mps,omega_radps and at least one row, found an empty file",
            ]),
        ),
        row(
            "it is zeros, as a disk leaves them",
            |i| i.write(ODOMETRY, [0; 200]),
            Refused(&["seq/odometry.csv, line 1: expected the header t_s,v_mps,omega_radps"]),
        ),
        row(
            "it is missing",
            |i| i.remove(ODOMETRY),
            Refused(&[
                "seq/odometry.csv: not found; it holds the speeds of the robot",
                "--odometry none",
            ]),
        ),
        row(
            "it is a folder",
            |i| i.folder(ODOMETRY),
            Refused(&["seq/odometry.csv: cannot be read: Is a directory"]),
        ),
        row(
            "it has no header",
            |i| i.edit(ODOMETRY, |t| t.split_inclusive('\n').skip(1).collect()),
            Refused(&[
                "seq/odometry.csv, line 1: expected the header t_s,v_mps,omega_radps, found \"0.000000,0.182488124",
            ]),
        ),
        row(
            "a row has two columns",
            |i| i.line(ODOMETRY, 4, "0.2,0.2"),
            Refused(&["seq/odometry.csv, line 4: expected 3 values, found 2"]),
        ),
        row(
            "a row has four columns",
            |i| i.line(ODOMETRY, 4, "0.2,0.2,0,0"),
            Refused(&["seq/odometry.csv, line 4: expected 3 values, found 4"]),
        ),
        row(
            "the last row is cut",
            |i| i.edit(ODOMETRY, |t| t[..t.len() - 15].to_owned()),
            Refused(&["seq/odometry.csv, line 25: expected 3 values, found 2"]),
        ),
        row("it has semicolons", |i| i.replace(ODOMETRY, ",", ";"), Same),
        row(
            "it ends in CRLF behind a byte order mark",
            |i| i.edit(ODOMETRY, |t| format!("\u{feff}{}", t.replace('\n', "\r\n"))),
            Same,
        ),
        row(
            "it is UTF-16",
            |i| {
                let wide: Vec<u8> =
                    format!("\u{feff}{}", String::from_utf8(i.bytes(ODOMETRY)).unwrap())
                        .encode_utf16()
                        .flat_map(u16::to_be_bytes)
                        .collect();
                i.write(ODOMETRY, wide);
            },
            Same,
        ),
        row(
            "it has a byte that is no text",
            |i| i.write(ODOMETRY, b"t_s,v_mps,omega_radps\n0,0.2\xff,0\n"),
            Refused(&["seq/odometry.csv: expected UTF-8 text, found a foreign byte at offset 27"]),
        ),
        row(
            "it is an image",
            |i| i.write(ODOMETRY, i.bytes("seq/images/000000.png")),
            Refused(&["seq/odometry.csv: expected UTF-8 text, found a foreign byte at offset 0"]),
        ),
        row(
            "a cell is quoted and never closed",
            |i| i.line(ODOMETRY, 4, "\"0.200000,0.179016810,0.106968205"),
            Same,
        ),
    ]
}

fn truth() -> Vec<Fault> {
    vec![
        row(
            "it is short",
            |i| i.edit(TRUTH, |t| t.split_inclusive('\n').take(3).collect()),
            Warned(&["reference-in-part"]),
        ),
        row(
            "it is of another time",
            |i| {
                i.write(
                    TRUTH,
                    "frame,t_s,x_m,y_m,phi_rad\n0,1000,0,0,0\n1,1001,1,0,0\n",
                );
            },
            Warned(&["reference-elsewhere"]),
        ),
        row(
            "its times go back",
            |i| i.line(TRUTH, 4, "2,0.1,0,0,0"),
            Refused(&[
                "seq/groundtruth_planar.csv, line 4: expected a time after 0.5 s, found 0.1 s",
            ]),
        ),
        row(
            "a pose is no number",
            |i| i.line(TRUTH, 4, "2,1.0,0,nan,0"),
            Refused(&[
                "seq/groundtruth_planar.csv, line 4: expected a finite number for y_m, found \"nan\"",
            ]),
        ),
        row(
            "a row is short",
            |i| i.line(TRUTH, 4, "2,1.0,0"),
            Refused(&["seq/groundtruth_planar.csv, line 4: expected 5 values, found 3"]),
        ),
        row(
            "it has another header",
            |i| i.line(TRUTH, 1, "a,b,c,d,e"),
            Refused(&[
                "seq/groundtruth_planar.csv, line 1: expected the header frame,t_s,x_m,y_m,phi_rad, found \"a,b,c,d,e\"",
            ]),
        ),
        row(
            "it is empty",
            |i| i.write(TRUTH, ""),
            Refused(&[
                "seq/groundtruth_planar.csv: expected the header frame,t_s,x_m,y_m,phi_rad and at least one row, found an empty file",
            ]),
        ),
        row(
            "it is a folder",
            |i| i.folder(TRUTH),
            Refused(&["seq/groundtruth_planar.csv: cannot be read: Is a directory"]),
        ),
        row(
            "the TUM file has seven columns",
            |i| {
                i.remove(TRUTH);
                i.write("seq/groundtruth.txt", "0 0 0 0 0 0 0 1\n0.5 0 0 0 0 0 1\n");
            },
            Refused(&[
                "seq/groundtruth.txt, line 2: expected eight numbers (t x y z qx qy qz qw), found 7",
            ]),
        ),
        row(
            "the TUM file has a quaternion of zeros",
            |i| {
                i.remove(TRUTH);
                i.write(
                    "seq/groundtruth.txt",
                    "0 0 0 0 0 0 0 1\n0.5 0 0 0 0 0 0 0\n",
                );
            },
            Refused(&[
                "seq/groundtruth.txt, line 2: expected a quaternion of unit length, found length 0",
            ]),
        ),
    ]
}

#[test]
fn faults_of_the_times_end_as_they_should() {
    assert_outcomes(&times());
}

#[test]
fn faults_of_the_odometry_end_as_they_should() {
    assert_outcomes(&odometry());
}

#[test]
fn faults_of_the_ground_truth_end_as_they_should() {
    assert_outcomes(&truth());
}
