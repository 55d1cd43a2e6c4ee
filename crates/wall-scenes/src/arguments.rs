//! The command line of `wall-scenes`: every command and flag in one place.

use lexopt::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use std::str::FromStr;
use wall_scenes::{
    BoardSetSpec, CalibrationError, Carrier, FrameRate, FrameSpan, Kidnap, Mishaps, SceneKind,
    SceneSpec, Stop, Stops,
};

/// The text of `--help`.
pub(crate) const HELP: &str = "\
wall-scenes <command>

scene --out SEQ [--kind wall|room] [--seed S] [--frames N] [--noise-px LEVELS]
      render a sequence with ground truth; LEVELS is the pixel noise at mid grey
      [--laps N]                     rounds of the room (1)
      [--frame-rate R|1/R]           R times as many images of the same drive, or every R-th (1)
      [--curve-slip S]               slip angle per turn rate, seconds
      [--slip RATIO]                 white sideways slip of a frame, share of its length
      [--roll RAD] [--pitch RAD]     sway, root mean square
      [--origin-ahead M]             body origin ahead of the turning centre
      [--slope RAD]                  steepest slope of the floor
      [--turn-bias RADPS]            constant error of the reported turn rate
      [--wheel-radius RATIO]         constant relative error of the reported speed
      [--pause EVERY:COUNT]          after every EVERY frames of driving stand still for COUNT frames
      [--spin EVERY:COUNT]           after every EVERY frames of driving turn once around on the spot in COUNT frames
      [--soak]                       the room for 10,000 frames: laps, pauses, turns on the spot (instead of --laps)
      [--twin-posters]               the same poster in two places
      [--kidnap FRAME:METRES]        before FRAME the robot is carried METRES away; the odometry does not know
      [--dark FROM:TO]               no light from frame FROM until before frame TO
      [--blocked FROM:TO]            a covered lens in these frames: one dim tone with noise
      [--shutter SECONDS]            time of an exposure, about the time of the image: motion blur (0)
      [--walker]                     a person-sized block walks between the robot and the walls
      [--fisheye PX]                 an equidistant fisheye of this focal length instead of the paper's camera
      [--mount-yaw RAD]              error of the mount in camera.toml
      [--focal RATIO]                relative error of the focal length in camera.toml
board --out DIR [--count N] [--seed S] [--width PX] [--noise LEVELS]
      render pictures of a 9x6 checkerboard with its true corners and camera, for mono-slam calibrate
";

/// A parsed command line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Command {
    /// Print [`HELP`].
    Help,
    /// Render one sequence into a folder.
    Scene {
        /// Folder of the sequence.
        out: PathBuf,
        /// The sequence.
        spec: SceneSpec,
    },
    /// Render pictures of a checkerboard into a folder.
    Board {
        /// The folder.
        out: PathBuf,
        /// The pictures.
        spec: BoardSetSpec,
    },
}

/// Reads a command line without the program's name.
///
/// # Errors
/// Anything unknown, missing or out of place, in one sentence.
pub(crate) fn parse(
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<Command, lexopt::Error> {
    let mut parser = lexopt::Parser::from_args(arguments);
    let name = match parser.next()? {
        None => return Err("a command is required: scene or board".into()),
        Some(Long("help") | Short('h')) => return Ok(Command::Help),
        Some(Value(name)) => name.string()?,
        Some(other) => return Err(other.unexpected()),
    };
    match name.as_str() {
        "scene" => scene(&mut parser),
        "board" => board(&mut parser),
        "help" => Ok(Command::Help),
        other => Err(format!("no command `{other}`: use scene or board").into()),
    }
}

/// An error with `message` unless `holds`.
fn require(holds: bool, message: impl FnOnce() -> String) -> Result<(), lexopt::Error> {
    if holds { Ok(()) } else { Err(message().into()) }
}

fn scene(parser: &mut lexopt::Parser) -> Result<Command, lexopt::Error> {
    let (mut out, mut kind, mut seed) = (None, String::from("wall"), 1);
    let (mut frames, mut noise_px, mut laps) = (None, None, None);
    let (mut carrier, mut calibration) = (Carrier::IDEAL, CalibrationError::default());
    let mut frame_rate = FrameRate::ONE;
    let (mut stops, mut soak, mut twin_posters) = (Stops::default(), false, false);
    let (mut mishaps, mut fisheye_px) = (Mishaps::default(), None);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("out") => out = Some(PathBuf::from(parser.value()?)),
            Long("kind") => kind = parser.value()?.string()?,
            Long("seed") => seed = parser.value()?.parse()?,
            Long("frames") => frames = Some(parser.value()?.parse()?),
            Long("noise-px") => noise_px = Some(parser.value()?.parse()?),
            Long("laps") => laps = Some(parser.value()?.parse()?),
            Long("frame-rate") => frame_rate = rate(&parser.value()?.string()?)?,
            Long("curve-slip") => carrier.curve_slip_s = parser.value()?.parse()?,
            Long("slip") => carrier.slip_ratio = parser.value()?.parse()?,
            Long("roll") => carrier.roll_rad = parser.value()?.parse()?,
            Long("pitch") => carrier.pitch_rad = parser.value()?.parse()?,
            Long("origin-ahead") => carrier.origin_ahead_m = parser.value()?.parse()?,
            Long("slope") => carrier.slope_rad = parser.value()?.parse()?,
            Long("turn-bias") => carrier.turn_bias_radps = parser.value()?.parse()?,
            Long("wheel-radius") => carrier.wheel_radius_ratio = parser.value()?.parse()?,
            Long("pause") => stops.pause = Some(stop("pause", parser)?),
            Long("spin") => stops.spin = Some(stop("spin", parser)?),
            Long("soak") => soak = true,
            Long("twin-posters") => twin_posters = true,
            Long("kidnap") => {
                let (frame, metres) = pair("kidnap", "FRAME:METRES", parser)?;
                mishaps.kidnap = Some(Kidnap { frame, metres });
            }
            Long("dark") => mishaps.dark = Some(span("dark", parser)?),
            Long("blocked") => mishaps.blocked = Some(span("blocked", parser)?),
            Long("shutter") => mishaps.shutter_s = parser.value()?.parse()?,
            Long("walker") => mishaps.walker = true,
            Long("fisheye") => fisheye_px = Some(parser.value()?.parse()?),
            Long("mount-yaw") => calibration.mount_yaw_rad = parser.value()?.parse()?,
            Long("focal") => calibration.focal_ratio = parser.value()?.parse()?,
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected()),
        }
    }
    let mut spec = match kind.as_str() {
        "room" if soak => SceneSpec::soak(seed),
        "wall" => SceneSpec::wall(seed),
        "room" => SceneSpec::laps(seed, laps.unwrap_or(1)),
        other => return Err(format!("--kind must be wall or room, not `{other}`").into()),
    };
    require(
        !soak || (spec.kind, laps) == (SceneKind::Room, None),
        || "--soak needs --kind room, and brings its own laps".into(),
    )?;
    if stops != Stops::default() {
        spec = spec.with_stops(stops);
    }
    spec.twin_posters = twin_posters;
    spec.mishaps = mishaps;
    spec.fisheye_px = fisheye_px;
    spec.frames = frames.unwrap_or(spec.frames);
    require(laps.is_none() || spec.kind == SceneKind::Room, || {
        "--laps needs --kind room".into()
    })?;
    spec.noise_px = noise_px.unwrap_or(spec.noise_px);
    spec.carrier = carrier;
    spec.calibration = calibration;
    spec.frame_rate = frame_rate;
    spec.check().map_err(|error| error.to_string())?;
    let out = out.ok_or("scene needs --out SEQ")?;
    require(!out.as_os_str().is_empty(), || {
        "--out must not be empty".into()
    })?;
    Ok(Command::Scene { out, spec })
}

/// Two numbers with a colon between them.
fn pair<A: FromStr, B: FromStr>(
    flag: &str,
    form: &str,
    parser: &mut lexopt::Parser,
) -> Result<(A, B), lexopt::Error> {
    let text = parser.value()?.string()?;
    let parts = text.split_once(':');
    parts
        .and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)))
        .ok_or_else(|| format!("--{flag} takes {form}, not `{text}`").into())
}

fn stop(flag: &str, parser: &mut lexopt::Parser) -> Result<Stop, lexopt::Error> {
    let (every, frames) = pair(flag, "EVERY:COUNT", parser)?;
    Ok(Stop { every, frames })
}

fn span(flag: &str, parser: &mut lexopt::Parser) -> Result<FrameSpan, lexopt::Error> {
    let (from, to) = pair(flag, "FROM:TO", parser)?;
    Ok(FrameSpan { from, to })
}

/// `R` or `1/R`.
fn rate(text: &str) -> Result<FrameRate, lexopt::Error> {
    let (multiple, divisor) = text.split_once('/').unwrap_or((text, "1"));
    let number = |text: &str| text.trim().parse::<usize>().ok().filter(|&n| n > 0);
    match (number(multiple), number(divisor)) {
        (Some(multiple), Some(divisor)) => Ok(FrameRate { multiple, divisor }),
        _ => Err(format!("--frame-rate takes R or 1/R, not `{text}`").into()),
    }
}

fn board(parser: &mut lexopt::Parser) -> Result<Command, lexopt::Error> {
    let (mut out, mut spec) = (None, BoardSetSpec::small(20, 1));
    spec.image = (640, 480);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("out") => out = Some(PathBuf::from(parser.value()?)),
            Long("count") => spec.count = parser.value()?.parse()?,
            Long("seed") => spec.seed = parser.value()?.parse()?,
            Long("width") => spec.image.0 = parser.value()?.parse()?,
            Long("noise") => spec.look.noise = parser.value()?.parse()?,
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected()),
        }
    }
    require((1..=1000).contains(&spec.count), || {
        format!("--count must be from 1 to 1000, not {}", spec.count)
    })?;
    require((160..=8000).contains(&spec.image.0), || {
        format!(
            "--width must be from 160 to 8000 pixels, not {}",
            spec.image.0
        )
    })?;
    require((0.0..=50.0).contains(&spec.look.noise), || {
        format!(
            "--noise must be from 0 to 50 levels, not {}",
            spec.look.noise
        )
    })?;
    spec.image.1 = spec.image.0 * 3 / 4;
    let out = out.ok_or("board needs --out DIR")?;
    require(!out.as_os_str().is_empty(), || {
        "--out must not be empty".into()
    })?;
    Ok(Command::Board { out, spec })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Command, lexopt::Error> {
        parse(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn every_flag_reaches_the_specification() {
        let line = "scene --out a/b --kind room --seed 9 --frames 12 --noise-px 1.5";
        let spec = SceneSpec {
            frames: 12,
            noise_px: 1.5,
            ..SceneSpec::room(9)
        };
        assert_eq!(
            read(line).unwrap(),
            Command::Scene {
                out: "a/b".into(),
                spec
            }
        );
        let line = "scene --out a --kind room --laps 3 --frame-rate 1/4 --curve-slip 0.2 --slip 0.03 --roll 0.01 \
                    --pitch 0.02 --origin-ahead -0.5 --slope 0.1 --turn-bias 0.004 --wheel-radius -0.02 \
                    --mount-yaw 0.005 --focal 0.006";
        let spec = SceneSpec {
            frame_rate: FrameRate {
                multiple: 1,
                divisor: 4,
            },
            carrier: Carrier {
                curve_slip_s: 0.2,
                slip_ratio: 0.03,
                roll_rad: 0.01,
                pitch_rad: 0.02,
                origin_ahead_m: -0.5,
                slope_rad: 0.1,
                turn_bias_radps: 0.004,
                wheel_radius_ratio: -0.02,
            },
            calibration: CalibrationError {
                mount_yaw_rad: 0.005,
                focal_ratio: 0.006,
            },
            ..SceneSpec::laps(1, 3)
        };
        assert_eq!(
            read(line).unwrap(),
            Command::Scene {
                out: "a".into(),
                spec
            }
        );
        let line = "scene --out a --kind room --pause 5:20 --spin 60:24 --twin-posters --kidnap 30:1.25 --dark 4:6 \
                    --blocked 8:9 --shutter 0.02 --walker";
        let spec = SceneSpec {
            twin_posters: true,
            mishaps: Mishaps {
                kidnap: Some(Kidnap {
                    frame: 30,
                    metres: 1.25,
                }),
                dark: Some(FrameSpan { from: 4, to: 6 }),
                blocked: Some(FrameSpan { from: 8, to: 9 }),
                shutter_s: 0.02,
                walker: true,
            },
            ..SceneSpec::room(1).with_stops(Stops {
                pause: Some(Stop {
                    every: 5,
                    frames: 20,
                }),
                spin: Some(Stop {
                    every: 60,
                    frames: 24,
                }),
            })
        };
        assert_eq!(spec.frames, 186 + 37 * 20 + 3 * 24);
        assert_eq!(
            read(line).unwrap(),
            Command::Scene {
                out: "a".into(),
                spec
            }
        );
        let fisheye = SceneSpec {
            fisheye_px: Some(150.5),
            ..SceneSpec::wall(1)
        };
        assert_eq!(
            read("scene --out a --fisheye 150.5").unwrap(),
            Command::Scene {
                out: "a".into(),
                spec: fisheye
            }
        );
        assert_eq!(
            read("scene --out a --kind room --soak --seed 4").unwrap(),
            Command::Scene {
                out: "a".into(),
                spec: SceneSpec::soak(4)
            }
        );
        let mut board = BoardSetSpec::small(7, 5);
        board.image = (800, 600);
        board.look.noise = 2.5;
        assert_eq!(
            read("board --out b --count 7 --seed 5 --width 800 --noise 2.5").unwrap(),
            Command::Board {
                out: "b".into(),
                spec: board
            }
        );
        assert_eq!(read("board --help").unwrap(), Command::Help);
    }

    #[test]
    fn wrong_lines_say_what_is_wrong() {
        for (line, word) in [
            ("", "command"),
            ("paint", "paint"),
            ("scene", "--out"),
            ("scene --out x --kind cave", "cave"),
            ("scene --out x --frames 1", "1"),
            ("scene --out x --seed -3", "-3"),
            ("scene --out x --noise-px", "--noise-px"),
            ("scene --out x --laps 2", "--laps"),
            ("scene --out x --soak", "--soak"),
            ("scene --out x --soak --kind room --laps 2", "--soak"),
            ("scene --out x --pause 5", "EVERY:COUNT"),
            ("scene --out x --spin 5:-2", "--spin"),
            ("scene --out x --kidnap 5:far", "FRAME:METRES"),
            ("scene --out x --dark 5", "FROM:TO"),
            ("scene --out x --blocked 7:5", "blocked"),
            ("scene --out x --shutter 9", "shutter"),
            ("scene --out x --frame-rate 0", "--frame-rate"),
            ("scene --out x --slope 3", "slope"),
            ("scene --out x --focal nan", "focal"),
            ("scene --out x --fisheye 20", "fisheye"),
            ("board", "--out"),
            ("board --out b --count 0", "--count"),
            ("board --out b --width 20", "--width"),
            ("board --out b --noise nan", "--noise"),
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(
                message.contains(word) && !message.contains('\n'),
                "{line}: {message}"
            );
        }
    }
}
